//! What of a set of scans is not the object, as all of them together decide: the turntable, floor or wall about it ([`support_plane`]) and points far off ([`outliers`]).
//!
//! Each scan is looked at alone, since poses are not known yet; then the set has its say: what stands about an object
//! stands about it in many scans, while a flat part of the object looks like a floor from a few sides at most. In doubt
//! everything is kept.

pub mod copies;

use rayon::prelude::*;

use crate::sensor::Sensor;
use crate::view::{MIN_POINTS, View};
use visage_geometry::cleaning::support_plane::{Support, ToScanner};
use visage_geometry::cleaning::{CoarseScan, outliers, support_plane};
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::progress::{Canceled, Progress};

/// What is left out of a scan.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct LeftOut {
    /// Points of planes that the object stands on or before, and what lies behind those.
    pub support: usize,
    /// Points far from the rest.
    pub strays: usize,
    /// For each point whether it stays; empty if all do.
    #[serde(skip)]
    pub kept: Vec<bool>,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A support is believed if at least this share of the scans shows one,
        shown_by: f64 = 0.5,
        /// and as many scans as this.
        shown_by_scans: usize = 2,
        /// What is left must be at least this share of the scan, or nothing is left out.
        least_rest: f64 = 0.02,
    }
}

/// A view as it is looked at.
struct Look<'a> {
    view: &'a View,
    coarse: CoarseScan,
    candidates: Vec<Support>,
    supports: Vec<Support>,
}

/// Looks for what is not the object in all views of a set. `sensors` tell where the scanner stood (local frame), where
/// that is known.
pub fn clean(views: &[View], sensors: &[Option<Sensor>], progress: &Progress) -> Result<Vec<LeftOut>, Canceled> {
    let coarse_scans: Vec<(CoarseScan, bool)> = views
        .par_iter()
        .with_max_len(1)
        .map(|view| {
            progress.check()?;
            let coarse = CoarseScan::new(view.points(), view.spacing, view.range_accuracy);
            let may_have_support = support_plane::may_have_support(&coarse);
            Ok((coarse, may_have_support))
        })
        .collect::<Result<_, Canceled>>()?;
    let likely = coarse_scans.iter().filter(|(_, may_have_support)| *may_have_support).count();
    let coarse_scans = coarse_scans.into_iter().map(|(coarse, _)| coarse).collect();
    let looks = if is_believed(likely, views.len()) {
        closer_looks(views, coarse_scans, sensors, progress)?
    } else {
        let look = |(view, coarse)| Look { view, coarse, candidates: Vec::new(), supports: Vec::new() };
        views.iter().zip(coarse_scans).map(look).collect()
    };
    let expected = expected_supports(&looks);
    let left_out = |look: &Look| {
        let supports = match (expected, look.supports.len()) {
            (0, _) => Vec::new(),
            (most, 0) => {
                support_plane::supports(&look.coarse, &look.candidates, support_plane::AROUND_IF_EXPECTED, most)
            }
            _ => look.supports.clone(),
        };
        LeftOut::of(look.view, &look.coarse, &supports)
    };
    Ok(looks.par_iter().with_max_len(1).map(left_out).collect())
}

/// Looks at each scan by itself for what its object may stand on.
fn closer_looks<'a>(
    views: &'a [View],
    coarse_scans: Vec<CoarseScan>,
    sensors: &[Option<Sensor>],
    progress: &Progress,
) -> Result<Vec<Look<'a>>, Canceled> {
    let look = |((view, coarse), sensor): ((&'a View, CoarseScan), &Option<Sensor>)| {
        progress.check()?;
        let coarse = coarse.with_normals(&view.indexed);
        let to_scanner = sensor.map(|sensor| move |point: &LocalPoint| sensor.direction_from(point));
        let candidates = support_plane::bounding_planes(&coarse, to_scanner.as_ref().map(|toward| toward as ToScanner));
        let supports = support_plane::supports(&coarse, &candidates, support_plane::AROUND, support_plane::MOST);
        Ok(Look { view, coarse, candidates, supports })
    };
    views.par_iter().zip(coarse_scans).zip(sensors).with_max_len(1).map(look).collect()
}

/// Whether so many scans of a set are enough to believe what they show.
fn is_believed(shown_by: usize, scans: usize) -> bool {
    shown_by >= TUNING.shown_by_scans && shown_by as f64 >= TUNING.shown_by * scans as f64
}

/// How many supports the scans of this set have, by the median of those that show any; none if these are too few.
fn expected_supports(looks: &[Look]) -> usize {
    let mut shown: Vec<usize> = looks.iter().map(|look| look.supports.len()).filter(|count| *count > 0).collect();
    shown.sort_unstable();
    if is_believed(shown.len(), looks.len()) { shown[shown.len() / 2] } else { 0 }
}

impl LeftOut {
    fn of(view: &View, coarse: &CoarseScan, supports: &[Support]) -> Self {
        let is_supporting = |p: &nalgebra::Vector3<f64>| supports.iter().any(|support| support.holds(p));
        let points = || view.points().iter().map(|p| nalgebra::Vector3::from(*p).cast::<f64>());
        let rest: Vec<usize> = (0..coarse.count()).filter(|surfel| !is_supporting(&coarse.position(*surfel))).collect();
        let body = outliers::main_body(coarse, &rest);
        if supports.is_empty() && body.is_none() {
            return LeftOut::default();
        }
        let standing: Vec<bool> = match supports.is_empty() {
            true => vec![true; view.points().len()],
            false => points().map(|p| !is_supporting(&p)).collect(),
        };
        let kept = match body {
            Some(body) => {
                standing.iter().zip(view.points()).map(|(standing, p)| *standing && body.reaches(p)).collect()
            }
            None => standing.clone(),
        };
        let count = |mask: &[bool]| mask.iter().filter(|is| **is).count();
        let (all, standing, left) = (view.points().len(), count(&standing), count(&kept));
        if left == all || (left as f64) < (TUNING.least_rest * all as f64).max(2.0 * MIN_POINTS as f64) {
            return LeftOut::default();
        }
        LeftOut { support: all - standing, strays: standing - left, kept }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    /// A dome of 30 mm on a square floor of 200 mm, its points 2 mm apart.
    fn dome(on_floor: bool) -> Vec<Point3> {
        let steps = || (-50..=50).map(|k| 2.0 * f64::from(k));
        let height = |x: f64, y: f64| (30.0f64.powi(2) - x * x - y * y).max(0.0).sqrt();
        let all = steps().flat_map(|x| steps().map(move |y| Point3::new(x, y, height(x, y))));
        all.filter(|p| on_floor || p.z > 0.0).collect()
    }

    fn view(points: Vec<Point3>) -> View {
        View::new(&Cloud::from_points(points)).expect("a sound scan")
    }

    fn cleaned(views: &[View]) -> Vec<LeftOut> {
        clean(views, &vec![None; views.len()], &Progress::silent()).expect("not canceled")
    }

    #[test]
    fn the_floor_goes_and_the_dome_stays() {
        let views = [view(dome(true)), view(dome(true))];
        for left_out in cleaned(&views) {
            let of_dome = dome(false).len();
            let kept = left_out.kept.iter().filter(|kept| **kept).count();
            assert!(kept > of_dome * 9 / 10 && kept <= of_dome, "{kept} of {of_dome}");
            assert_eq!(left_out.support + left_out.strays + kept, dome(true).len());
        }
    }

    #[test]
    fn one_scan_of_four_with_a_floor_is_not_believed() {
        let views = [view(dome(true)), view(dome(false)), view(dome(false)), view(dome(false))];
        assert_eq!(cleaned(&views), vec![LeftOut::default(); 4]);
    }

    #[test]
    fn specks_far_off_go_and_a_part_that_stands_apart_stays() {
        let mut points = dome(false);
        let of_dome = points.len();
        points.extend((0..40).map(|k| Point3::new(36.0 + f64::from(k % 8), f64::from(k / 8), 10.0)));
        points.extend((0..2).map(|k| Point3::new(0.0, 90.0 + f64::from(k), 40.0)));
        let left_out = &cleaned(&[view(points)])[0];
        assert_eq!((left_out.support, left_out.strays), (0, 2));
        assert!(left_out.kept[..of_dome + 40].iter().all(|kept| *kept));
    }
}
