//! How each view of a refined component stands among the others: what all of them say of its place, and whether it could as
//! well stand elsewhere.
//!
//! A pair may be wrong and look right. A wrong view hardly ever is let stand by the pictures of all other scanners.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::coarse_view::CoarseView;
use super::consensus::alike;
use super::pair_hypothesis::PairHypothesis;
use super::slippage::Slippage;
use super::verification::{self, PairVotes, verify};
use super::votes::SurfelVotes;
use crate::view_graph::all_pairs;
use visage_geometry::{Motion, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels of a view that are queried of its place,
        samples: usize = 400,
        /// and of another place.
        rival_samples: usize = 120,
        /// Other places that are tried for a view.
        rivals: usize = 6,
        /// A place farther off than this, in edges, is another one.
        elsewhere: f64 = 4.0,
        /// A surfel is held by another view's within this distance, in edges.
        held: f64 = 0.6,
    }
}

/// What speaks for and against a view's place.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PoseSupport {
    /// The largest overlap with another view, smaller share of both.
    pub overlap: f64,
    /// Of all votes that say something, the share of surfels where a scanner saw nothing, or looked through.
    pub unseen: f64,
    /// The share of surfels that cross a surface, but for those that may be the other side of a thin wall.
    pub contradict: f64,
    /// The same share, of the whole component.
    pub component_contradict: f64,
    /// Root mean square distance of surfels that agree, in the noise of the set.
    pub rms: f64,
    /// How well the best other place of the view does, in what its own does: 0 (there is none) to 2.
    pub rival: f64,
    /// The mean of that over the component.
    pub component_rival: f64,
    /// Of the pairs of this view whose best hypothesis says something, the share that says what the component does.
    pub agreeing: f64,
    /// How well the surface holds the view in the direction that holds it least: 0 (it slides) to about 0.3.
    pub held: f64,
    /// Of the points near others the share that touches them at full resolution; see [`crate::quality`].
    pub sharpness: f64,
}

/// What all pairs of a component's views say of `local_poses`, in lexicographic order.
pub fn pairs_said(coarse_views: &[&CoarseView], local_poses: &[Motion], edge: f64) -> Vec<PairVotes> {
    let pairs: Vec<(usize, usize)> = all_pairs(coarse_views.len()).collect();
    let say = |&(i, j): &(usize, usize)| {
        verify(coarse_views[i], coarse_views[j], &local_poses[i].inv_mul(&local_poses[j]), edge, TUNING.samples)
    };
    pairs.par_iter().map(say).collect()
}

/// How a component's views stand at `local_poses`, of which their pairs have `said` so much; `hypotheses` are their candidates,
/// named by place in the component, and `noise` the set's level of noise, in edges.
pub fn pose_supports(
    coarse_views: &[&CoarseView],
    local_poses: &[Motion],
    hypotheses: &[PairHypothesis],
    said: &[PairVotes],
    edge: f64,
    noise: f64,
) -> Vec<PoseSupport> {
    let n = coarse_views.len();
    let mut whole = SurfelVotes::default();
    let mut own = vec![SurfelVotes::default(); n];
    let mut overlap = vec![0.0f64; n];
    for ((i, j), evidence) in all_pairs(n).zip(said) {
        let votes = evidence.both();
        whole = whole + votes;
        for view in [i, j] {
            own[view] = own[view] + votes;
            overlap[view] = overlap[view].max(evidence.overlap());
        }
    }
    let views = (0..n).into_par_iter().with_max_len(1);
    let rivals: Vec<f64> = views.map(|view| rival(coarse_views, local_poses, hypotheses, view, edge)).collect();
    let component_rival = rivals.iter().sum::<f64>() / n.max(1) as f64;
    let agreeing = agreeing(coarse_views, local_poses, hypotheses, edge);
    (0..n)
        .into_par_iter()
        .with_max_len(1)
        .map(|view| PoseSupport {
            agreeing: agreeing[view],
            overlap: overlap[view],
            unseen: share(&own[view], own[view].unseen()),
            contradict: share(&own[view], own[view].contradict),
            component_contradict: share(&whole, whole.contradict),
            rms: rms(&own[view], edge) / (edge * noise),
            rival: rivals[view],
            component_rival,
            held: Slippage::of(&held_surfels(coarse_views, local_poses, view, edge))
                .map_or(0.0, |slippage| slippage.hold()),
            sharpness: 1.0,
        })
        .collect()
}

/// Root mean square distance of what agrees, a length; where nothing does, that at which it just would.
fn rms(votes: &SurfelVotes, edge: f64) -> f64 {
    if votes.agree > 0.0 { votes.rms() } else { f64::from(verification::TUNING.on) * edge }
}

/// A count of votes as a share of all votes that say something.
fn share(votes: &SurfelVotes, count: f64) -> f64 {
    count / votes.said().max(1.0)
}

/// For each view of how many of its pairs the best hypothesis is that of the component, as a share of those whose best is that or
/// a promising other one; with half a pair for each side, since few pairs say little.
fn agreeing(
    coarse_views: &[&CoarseView],
    local_poses: &[Motion],
    hypotheses: &[PairHypothesis],
    edge: f64,
) -> Vec<f64> {
    let mut best: BTreeMap<(usize, usize), &PairHypothesis> = BTreeMap::new();
    for hypothesis in hypotheses {
        let pair = (hypothesis.i.min(hypothesis.j), hypothesis.i.max(hypothesis.j));
        let held = best.entry(pair).or_insert(hypothesis);
        if hypothesis.score() > held.score() {
            *held = hypothesis;
        }
    }
    let mut counts = vec![[0.5, 0.5]; coarse_views.len()];
    for hypothesis in best.into_values() {
        let found = local_poses[hypothesis.i].inv_mul(&local_poses[hypothesis.j]);
        let radius = coarse_views[hypothesis.i].radius.max(coarse_views[hypothesis.j].radius);
        let is_of_component = alike(&found, &hypothesis.i_from_j, radius, TUNING.elsewhere * edge);
        for view in [hypothesis.i, hypothesis.j].into_iter().filter(|_| is_of_component || hypothesis.is_promising()) {
            counts[view][usize::from(is_of_component)] += 1.0;
        }
    }
    counts.into_iter().map(|[against, with]| with / (with + against)).collect()
}

/// How well the best other place of a view does that its candidates propose, in what its own place does.
fn rival(
    coarse_views: &[&CoarseView],
    local_poses: &[Motion],
    hypotheses: &[PairHypothesis],
    view: usize,
    edge: f64,
) -> f64 {
    let mut proposing: Vec<&PairHypothesis> =
        hypotheses.iter().filter(|hypothesis| hypothesis.i == view || hypothesis.j == view).collect();
    proposing.sort_by(|a, b| b.score().total_cmp(&a.score()).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut places = vec![local_poses[view]];
    for hypothesis in proposing {
        let place = match hypothesis.j == view {
            true => local_poses[hypothesis.i] * hypothesis.i_from_j,
            false => local_poses[hypothesis.j] * hypothesis.i_from_j.inverse(),
        };
        if places.iter().all(|other| !alike(other, &place, coarse_views[view].radius, TUNING.elsewhere * edge)) {
            places.push(place);
        }
        if places.len() > TUNING.rivals {
            break;
        }
    }
    let others: Vec<usize> = (0..coarse_views.len()).filter(|other| *other != view).collect();
    let balance = |place: &Motion| -> f64 {
        let say = |other: &usize| {
            let motion = local_poses[*other].inv_mul(place);
            let reach = coarse_views[*other].radius + coarse_views[view].radius;
            let is_near = motion.translation.vector.norm() <= reach;
            is_near.then(|| {
                verify(coarse_views[*other], coarse_views[view], &motion, edge, TUNING.rival_samples).both().balance()
            })
        };
        others.iter().filter_map(say).sum()
    };
    let own = balance(&places[0]);
    let best = places[1..].iter().map(balance).fold(0.0, f64::max);
    if own > 0.0 { (best / own).min(2.0) } else { 2.0 }
}

/// The surfels of a view that others hold: position and normal.
fn held_surfels(
    coarse_views: &[&CoarseView],
    local_poses: &[Motion],
    view: usize,
    edge: f64,
) -> Vec<(Vector3, Vector3)> {
    let coarse_view = coarse_views[view];
    let motions: Vec<nalgebra::Isometry3<f32>> =
        local_poses.iter().map(|pose| pose.inv_mul(&local_poses[view]).cast()).collect();
    let reach2 = (TUNING.held * edge).powi(2) as f32;
    let is_held = |place: nalgebra::Vector3<f32>| {
        let near = |other: usize| {
            let moved = motions[other] * nalgebra::Point3::from(place);
            coarse_views[other].indexed.tree.nearest(&moved.coords.into(), reach2).is_some()
        };
        (0..coarse_views.len()).any(|other| other != view && near(other))
    };
    coarse_view
        .inner
        .iter()
        .map(|index| *index as usize)
        .filter(|index| is_held(coarse_view.position(*index)))
        .map(|index| (coarse_view.position(index).cast(), coarse_view.normals[index].cast()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Sensor;
    use crate::view::View;
    use visage_geometry::{Cloud, Point3};

    const EDGE: f64 = 3.0;

    /// A sheet of side 60 with a height for each place, seen from far above.
    fn coarse_view(height: fn(f64, f64) -> f64) -> (CoarseView, Motion) {
        let places = (0..3600).map(|k| (f64::from(k % 60) - 29.5, f64::from(k / 60) - 29.5));
        let points: Vec<Point3> = places.map(|(x, y)| Point3::new(x, y, height(x, y))).collect();
        let view = View::new(&Cloud::from_points(points)).expect("a sheet can be used");
        (CoarseView::new(&view, EDGE, Some(Sensor::Toward(Vector3::z()))), view.local_pose(&Motion::identity()))
    }

    fn support(height: fn(f64, f64) -> f64, moved: &Motion) -> PoseSupport {
        let (coarse_view, pose) = coarse_view(height);
        let (coarse_views, poses) = ([&coarse_view, &coarse_view], [pose, moved * pose]);
        pose_supports(&coarse_views, &poses, &[], &pairs_said(&coarse_views, &poses, EDGE), EDGE, 0.02)[1]
    }

    #[test]
    fn what_the_other_scanner_did_not_see_speaks_against_a_place() {
        let bumpy = |x: f64, y: f64| 6.0 * (x / 7.0).sin() * (y / 9.0).cos();
        let right = support(bumpy, &Motion::identity());
        assert_eq!((right.unseen, right.component_rival), (0.0, 0.0));
        assert!(right.overlap > 0.9 && right.held > 0.05, "{right:?}");
        let beside = support(bumpy, &Motion::translation(30.0, 0.0, 0.0));
        assert!(beside.unseen > 0.1, "{beside:?}");
    }

    #[test]
    fn a_view_that_agrees_with_nothing_does_not_lie_well() {
        let bumpy = |x: f64, y: f64| 6.0 * (x / 7.0).sin() * (y / 9.0).cos();
        let right = support(bumpy, &Motion::identity());
        let apart = support(bumpy, &Motion::translation(0.0, 0.0, 500.0));
        assert!(apart.rms > 10.0 && apart.rms > right.rms, "{apart:?}");
    }

    #[test]
    fn nothing_holds_a_plane_on_a_plane() {
        assert!(support(|_, _| 0.0, &Motion::identity()).held < 0.01);
    }
}
