//! The verdict on a registration: what it would look like if it were wrong, and whether it does.
//!
//! The chief sign is *sharpness*: of the points that have another view's surface somewhere near (within
//! [`NEAR`] spacings), the share that has it at touching distance ([`TOUCHING`] spacings). Surfaces that are the same
//! lie on each other; surfaces brought together wrongly cross, and most points near the crossing don't touch.

pub mod colour;
pub mod free_space;
pub mod walls;
pub mod witness;

use rayon::prelude::*;

use crate::geometry::neighbours::LocalPoint;
use crate::geometry::normals;
use crate::registration::covariance::PoseCovariance;
use crate::registration::covariance::weak_axes::weak_axes;
use crate::registration::outcome::{Outcome, PairOutcome};
use crate::registration::quality::free_space::Intrusion;
use crate::registration::quality::walls::mixed_faces;
use crate::registration::resolution::resolution;
use crate::registration::view::View;

/// "Near" in spacings.
pub const NEAR: f64 = 8.0;
/// "Touching" in spacings.
pub const TOUCHING: f64 = 2.0;

/// How a registration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Nothing speaks against it.
    Good,
    /// Something does; look before using it.
    Doubtful,
    /// It is wrong, or too little of it is right.
    Failed,
}

/// A verdict and what it rests on.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// The verdict.
    pub quality: Quality,
    /// Why it is not better, in words; empty for `good`.
    pub reasons: Vec<String>,
    /// Sharpness of each view, 0 to 1; absent for a view with nothing near it.
    pub sharpness: Vec<Option<f64>>,
}

/// Thresholds, set between what right and wrong registrations show (docs/ALGORITHM.md, "Verdict").
pub(super) mod limits {
    /// Sharpness of a view below which it is doubtful, and below which it is wrong.
    pub const SHARP: f64 = 0.85;
    pub const BLUNT: f64 = 0.6;
    /// Disagreement of a pair with the averaged poses, in spacings.
    pub const DISAGREEMENT: f64 = 2.0;
    /// Robust averaging may overrule a few such pairs; more than this share is a doubt.
    pub const OVERRULED: f64 = 0.25;
    /// Trimmed RMS of a pair, in spacings.
    pub const RESIDUAL: f64 = 1.5;
    /// How far a view's surface may lie from where the joint cost is least, in spacings.
    pub const UNREST: f64 = 1.0;
    /// Probability that the place of a view is right, where it was found by surface.
    pub const LEAST_SURE: f64 = 0.9;
    /// Agreement of a view's texture with the neighbour it agrees with best, in what noise allows: on right poses 0.7 and
    /// more, on a bottle that is turned at random 0.2 to 0.4.
    pub const TEXTURE: f64 = 0.5;
    /// Share of a view without a side that lies on the other face of a wall than the rest of it.
    pub const MIXED_FACES: f64 = 0.05;
    /// Share of a view's points, where another saw something, that may lie before it; and of how many points.
    pub const LOOKED_THROUGH: f64 = 0.03;
    pub const LOOKED_THROUGH_POINTS: usize = 30;
}

/// Judges a registration of the views with these names.
pub fn judge(views: &[View], result: &Outcome, names: &[String]) -> Verdict {
    let spacing = resolution(views, result);
    let sharpness = sharpness(views, result, spacing);
    let mut verdict = Verdict { quality: Quality::Good, reasons: Vec::new(), sharpness };
    judge_placement(result, names, &mut verdict);
    judge_sharpness(names, &mut verdict);
    judge_pairs(result, spacing, names, &mut verdict);
    judge_walls(result, names, &mut verdict);
    verdict
}

impl Verdict {
    /// Adds what the evidence for the poses says: motions that nothing holds, and poses that are not at rest.
    pub fn weigh(&mut self, poses: &[Option<PoseCovariance>], spacing: f64, names: &[String]) {
        for (pose, name) in poses.iter().zip(names) {
            let Some(pose) = pose else { continue };
            let axes = weak_axes(pose, spacing);
            if let Some(first) = axes.first() {
                let motions: Vec<String> = axes.iter().map(|axis| axis.in_words()).collect();
                self.lower(Quality::Doubtful, format!("{name} can {}: {}", motions.join(", and "), first.why));
            }
            let unrest = pose.unrest() / spacing;
            if unrest > limits::UNREST {
                self.lower(
                    Quality::Doubtful,
                    format!("{name} would fit better {unrest:.1} spacings from where it was left"),
                );
            }
        }
    }

    /// Adds what the scanners saw: a view may not have surface where another looked through.
    pub fn look(&mut self, intrusions: &[Intrusion], names: &[String]) {
        for found in intrusions.iter().filter(|found| found.counts()) {
            let (name, other) = (&names[found.view], &names[found.seen_by]);
            self.lower(
                Quality::Doubtful,
                format!("{name} has {:.0} % of its surface there where {other} looked through", found.share * 100.0),
            );
        }
    }

    /// Adds that the scanner did not move: a background that stands still holds such scans together, also when what stood
    /// before it was turned. `moved` is the share of each scan that is not where it is in the others.
    pub fn doubt_what_stands_still(&mut self, moved: &[f64], names: &[String]) {
        let most = moved.iter().zip(names).max_by(|a, b| a.0.total_cmp(b.0)).filter(|(share, _)| **share > 0.0);
        let seen = match most {
            Some((share, name)) => {
                let percent = (100.0 * share).ceil();
                format!("what moved before it, up to {percent:.0} % of {name}, could not be placed")
            }
            None => "if an object was turned before it, the object is not placed".into(),
        };
        self.lower(
            Quality::Doubtful,
            format!(
                "all scans were taken from one place and show the same: what stands still holds them together, and {seen}; \
                 cut the rest away (`regions` of the hints) or leave it out"
            ),
        );
    }

    /// Adds what colours say: views with texture that does not agree with that of any neighbour.
    pub fn compare_colours(&mut self, agreement: &[Option<f64>], names: &[String]) {
        for (agreement, name) in agreement.iter().zip(names) {
            if agreement.is_some_and(|agreement| agreement < limits::TEXTURE) {
                self.lower(
                    Quality::Doubtful,
                    format!("the colours of {name} don't agree with its neighbours' where their surfaces meet"),
                );
            }
        }
    }

    /// Adds what the placement says: a view whose place was found by its surface and is less sure than
    /// [`limits::LEAST_SURE`] speaks against the whole.
    pub fn doubt(&mut self, confidences: &[f64], placed: &[bool], names: &[String]) {
        for ((sure, placed), name) in confidences.iter().zip(placed).zip(names) {
            if *placed && *sure < limits::LEAST_SURE {
                self.lower(
                    Quality::Doubtful,
                    format!("{name} may lie elsewhere: that its place is right is {:.0} % sure", sure * 100.0),
                );
            }
        }
    }

    /// Adds a reason for which it is no better than `quality`.
    pub fn lower(&mut self, quality: Quality, reason: String) {
        self.quality = self.quality.max(quality);
        self.reasons.push(reason);
    }
}

fn judge_placement(result: &Outcome, names: &[String], verdict: &mut Verdict) {
    let unplaced: Vec<&str> =
        names.iter().zip(&result.placed).filter(|(_, placed)| !**placed).map(|(name, _)| name.as_str()).collect();
    if unplaced.is_empty() {
        return;
    }
    let placed = names.len() - unplaced.len();
    let quality = if placed < 2 { Quality::Failed } else { Quality::Doubtful };
    verdict.lower(quality, format!("without a place among the others: {}", unplaced.join(", ")));
}

fn judge_sharpness(names: &[String], verdict: &mut Verdict) {
    let mut wrong = 0;
    for (view, name) in names.iter().enumerate() {
        let Some(sharpness) = verdict.sharpness[view] else { continue };
        if sharpness < limits::SHARP {
            wrong += usize::from(sharpness < limits::BLUNT);
            verdict.lower(
                Quality::Doubtful,
                format!("{name} crosses its neighbours: of the points near them only {:.0} % touch", sharpness * 100.0),
            );
        }
    }
    if 2 * wrong > names.len() {
        verdict.lower(Quality::Failed, format!("{wrong} of {} views don't fit their neighbours", names.len()));
    }
}

fn judge_pairs(result: &Outcome, spacing: f64, names: &[String], verdict: &mut Verdict) {
    let apart = |pair: &PairOutcome| pair.disagreement / spacing > limits::DISAGREEMENT;
    let overruled: Vec<&PairOutcome> = result.pairs.iter().filter(|pair| apart(pair)).collect();
    if overruled.len() as f64 > limits::OVERRULED * result.pairs.len() as f64 {
        let named: Vec<String> = overruled
            .iter()
            .map(|pair| format!("{} - {} ({:.1})", names[pair.i], names[pair.j], pair.disagreement / spacing))
            .collect();
        verdict.lower(
            Quality::Doubtful,
            format!("pairs that disagree with the averaged poses (by spacings): {}", named.join(", ")),
        );
    }
    for pair in &result.pairs {
        let (a, b) = (&names[pair.i], &names[pair.j]);
        // too few points that touch have no distance
        if pair.icp.correspondences == 0 {
            verdict
                .lower(Quality::Doubtful, format!("{a} and {b} were laid on each other, and hardly a point touches"));
            continue;
        }
        let residual = pair.icp.mean_distance2.sqrt() / spacing;
        if residual > limits::RESIDUAL && !apart(pair) {
            verdict.lower(Quality::Doubtful, format!("{a} and {b} lie {residual:.1} spacings apart"));
        }
    }
}

fn judge_walls(result: &Outcome, names: &[String], verdict: &mut Verdict) {
    let Some(surfels) = &result.surfels else { return };
    for (mixed, name) in mixed_faces(result, surfels).into_iter().zip(names) {
        if mixed.is_some_and(|share| share > limits::MIXED_FACES) {
            let remedy = "tell where the scanner stood";
            verdict.lower(
                Quality::Doubtful,
                format!("{name} lies on both faces of a thin wall, and which of them it saw is not clear: {remedy}"),
            );
        }
    }
}

/// Sample points of a view at which sharpness is measured, at most: a share to about 3 %.
const MAX_SAMPLES: usize = 400;
/// A point that lies farther than this beside the nearest point of another view, in spacings, lies beyond its rim.
const BESIDE: f64 = 2.0;

/// Sharpness of each view against all placed views that overlap it, together. `spacing` is what the views resolve.
///
/// A point touches if another view has a point there or goes through there as a plane; beyond a rim it has no counterpart.
pub fn sharpness(views: &[View], result: &Outcome, spacing: f64) -> Vec<Option<f64>> {
    (0..views.len())
        .into_par_iter()
        .map(|i| {
            if !result.placed[i] {
                return None;
            }
            let mut others: Vec<usize> = (0..views.len()).filter(|&j| j != i && result.placed[j]).collect();
            others.retain(|&j| result.overlaps.directed(i, j) > 0.0);
            // the view that is most likely to have the nearest point is asked first, mostly the only one
            others.sort_by(|&a, &b| result.overlaps.directed(i, b).total_cmp(&result.overlaps.directed(i, a)));
            let others: Vec<(&View, nalgebra::Isometry3<f32>)> = others
                .iter()
                .map(|&j| (&views[j], result.local_poses[j].inv_mul(&result.local_poses[i]).cast()))
                .collect();
            let (mut near, mut touching) = (0usize, 0usize);
            let points = views[i].points();
            for sample in points.iter().step_by(points.len().div_ceil(MAX_SAMPLES)) {
                match encounter(&others, sample, spacing) {
                    Encounter::Touches => (near, touching) = (near + 1, touching + 1),
                    Encounter::Misses => near += 1,
                    Encounter::Alone => {}
                }
            }
            (near > 0).then(|| touching as f64 / near as f64)
        })
        .collect()
}

/// Whether a view of this sharpness lies on the others.
pub fn is_sharp(sharpness: Option<f64>) -> bool {
    sharpness.is_some_and(|sharpness| sharpness >= limits::SHARP)
}

/// What a point of a view meets.
enum Encounter {
    Touches,
    Misses,
    Alone,
}

fn encounter(others: &[(&View, nalgebra::Isometry3<f32>)], sample: &LocalPoint, spacing: f64) -> Encounter {
    let touching = (TOUCHING * spacing) as f32;
    let mut nearest2 = (NEAR * spacing).powi(2) as f32;
    let mut nearest: Option<(&View, LocalPoint, u32)> = None;
    for (view, motion) in others {
        let moved: LocalPoint = (motion * nalgebra::Point3::from(*sample)).coords.into();
        if let Some(found) = view.indexed.tree.nearest(&moved, nearest2) {
            (nearest2, nearest) = (found.distance2, Some((*view, moved, found.index)));
        }
        // one that touches is enough
        if nearest2 < touching * touching {
            return Encounter::Touches;
        }
    }
    let Some((view, moved, index)) = nearest else { return Encounter::Alone };
    let place = view.points()[index as usize];
    let mut found = Vec::new();
    view.indexed.tree.k_nearest(&place, normals::NEIGHBOURS, f32::INFINITY, &mut found);
    let normal = nalgebra::Vector3::from(normals::plane_through(view.points(), &found).normal);
    let offset = nalgebra::Vector3::from(moved) - nalgebra::Vector3::from(place);
    let height = normal.dot(&offset).abs();
    if offset.norm_squared() - height * height > ((BESIDE * spacing) as f32).powi(2) {
        Encounter::Alone
    } else if height < touching {
        Encounter::Touches
    } else {
        Encounter::Misses
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cloud, Motion, Point3};

    #[test]
    fn a_pair_without_a_point_that_touches_has_no_distance() {
        let sheet = || (0..400).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), 0.0));
        let views = [(); 2].map(|()| View::new(&Cloud::from_points(sheet().collect())).expect("a sound sheet"));
        let result = Outcome {
            placed: vec![true; 2],
            pairs: vec![PairOutcome::unmeasured(0, 1, Motion::identity())],
            ..Outcome::alone(2)
        };
        let verdict = judge(&views, &result, &["a.ply".into(), "b.ply".into()]);
        assert_eq!(verdict.quality, Quality::Doubtful);
        assert!(verdict.reasons.iter().any(|reason| reason.contains("hardly a point")), "{:?}", verdict.reasons);
        assert!(!verdict.reasons.iter().any(|reason| reason.contains("inf")), "{:?}", verdict.reasons);
    }

    #[test]
    fn what_moved_before_a_background_is_named() {
        let mut verdict = Verdict { quality: Quality::Good, reasons: Vec::new(), sharpness: Vec::new() };
        verdict.doubt_what_stands_still(&[0.02, 0.071], &["a.ply".into(), "b.ply".into()]);
        assert_eq!(verdict.quality, Quality::Doubtful);
        assert!(verdict.reasons[0].contains("8 % of b.ply"), "{}", verdict.reasons[0]);
    }
}
