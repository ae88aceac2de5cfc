//! Hints on their way through a run: regions are cut before anything else, and at the end it is said what became of
//! picked points.

use rayon::prelude::*;

use super::report::{HintsReport, OverlapReport, PickedReport};
use super::{NamedScan, PipelineError};
use visage_geometry::{Motion, Point3};
use visage_registration::hinted::{Hinted, PickedPair};
use visage_registration::hints::{HintError, Hints};
use visage_registration::quality::Finding;
use visage_registration::view::MIN_POINTS;

/// The code of hints that can't be used.
pub(super) const CODE: &str = "invalid_hints";
/// A picked point lies no farther from its scan than this, in diagonals of the scan: picks miss holes and rims.
const OFF_SURFACE: f64 = 0.1;

impl From<HintError> for PipelineError {
    fn from(HintError { scan, message, remedy }: HintError) -> Self {
        PipelineError::Unusable { code: CODE, scan, message, hint: remedy.into() }
    }
}

/// Holds picked points against the scans and cuts the scans to their regions; answers with the points left out of each.
pub(super) fn apply(scans: &mut [NamedScan], hints: &Hints) -> Result<Vec<usize>, PipelineError> {
    let of_scans: Vec<Result<usize, PipelineError>> = scans
        .par_iter_mut()
        .map(|scan| {
            check_picks(scan, hints)?;
            cut(scan, hints)
        })
        .collect();
    // of several errors the first scan's, whichever thread met its own first
    of_scans.into_iter().collect()
}

fn cut(scan: &mut NamedScan, hints: &Hints) -> Result<usize, PipelineError> {
    let Some(is_used) = hints.filter(&scan.name) else { return Ok(0) };
    let kept: Vec<bool> = scan.surface.cloud.points.iter().map(is_used).collect();
    let (all, left) = (kept.len(), kept.iter().filter(|kept| **kept).count());
    if left < MIN_POINTS && left < all {
        let name = &scan.name;
        let message =
            format!("the regions leave {left} of the {all} points of {name}, at least {MIN_POINTS} are needed");
        let remedy = "regions are in the scan's own frame and unit: widen what is to be used, or leave less out";
        return Err(HintError { scan: Some(scan.name.clone()), message, remedy }.into());
    }
    if left < all {
        scan.surface = scan.surface.kept(&kept);
    }
    Ok(all - left)
}

/// Refuses picked points that lie off their scan.
fn check_picks(scan: &NamedScan, hints: &Hints) -> Result<(), PipelineError> {
    let of_scan = hints.points.iter().flat_map(|picked| {
        let side = if picked.a == scan.name { Some(0) } else { (picked.b == scan.name).then_some(1) };
        side.into_iter().flat_map(move |side| picked.pairs.iter().map(move |pair| Point3::from(pair[side])))
    });
    let points = &scan.surface.cloud.points;
    let diagonal = scan.surface.cloud.bounds().map_or(0.0, |bounds| bounds.diagonal());
    for place in of_scan {
        let nearest2 = points.iter().map(|point| (point - place).norm_squared()).fold(f64::INFINITY, f64::min);
        if nearest2.sqrt() > OFF_SURFACE * diagonal {
            let message = format!(
                "a point picked in {} at {:?} lies {:.3} from the nearest point of the scan",
                scan.name,
                <[f64; 3]>::from(place.coords),
                nearest2.sqrt()
            );
            let remedy = "picked points are in the scan's own frame and unit, first in a, then in b";
            return Err(HintError { scan: Some(scan.name.clone()), message, remedy }.into());
        }
    }
    Ok(())
}

/// What became of the hints: of each pair of views whether they were brought together, and how far its picked points lie
/// apart. Picked points that were not followed are a finding. `relative` tells the motion between two views that
/// hang together. `None` if nothing was said of pairs.
pub(super) fn report(
    hinted: &Hinted,
    relative: impl Fn(usize, usize) -> Option<Motion>,
    names: &[String],
    findings: &mut Vec<Finding>,
) -> Option<HintsReport> {
    if hinted.picked.is_empty() && hinted.overlapping.is_empty() {
        return None;
    }
    let picked = hinted.picked.iter().map(|pair| {
        let distances = relative(pair.i, pair.j).map(|motion| (pair.is_met(&motion), pair.distances(&motion)));
        let followed = distances.is_some_and(|(is_met, _)| is_met);
        if !followed {
            findings.push(Finding::doubt(not_followed(pair, distances.map(|(_, (rms, _))| rms), names)));
        }
        PickedReport {
            a: names[pair.i].clone(),
            b: names[pair.j].clone(),
            pairs: pair.places.len(),
            followed,
            misfit: pair.fit.rms,
            residual: distances.map(|(_, (rms, _))| rms),
            largest: distances.map(|(_, (_, largest))| largest),
        }
    });
    let points = picked.collect();
    let together = |&(i, j): &(usize, usize)| OverlapReport {
        a: names[i].clone(),
        b: names[j].clone(),
        together: relative(i, j).is_some(),
    };
    Some(HintsReport { points, overlaps: hinted.overlapping.iter().map(together).collect() })
}

fn not_followed(pair: &PickedPair, residual: Option<f64>, names: &[String]) -> String {
    let (a, b) = (&names[pair.i], &names[pair.j]);
    match residual {
        Some(rms) => format!(
            "the points picked in {a} and {b} lie {rms:.3} apart at the poses found (up to {:.3} would agree): the surfaces \
             speak against them, pick them anew or look at the poses",
            pair.tolerance
        ),
        None => format!(
            "the points picked in {a} and {b} did not bring them together: laid so, their surfaces contradict each other or \
             don't meet, pick them anew"
        ),
    }
}
