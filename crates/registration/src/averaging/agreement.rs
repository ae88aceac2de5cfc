//! From the relative motions of a round to poses that agree with them.

use super::recipe::Agreement;
use crate::averaging::low_rank;
use crate::averaging::motion_averaging::{self, AveragingOptions, RelativeMotion, disagreements};
use crate::outcome::{Outcome, PairOutcome, first_of_each_piece};
use crate::pairwise::trimmed_icp::IcpEnd;
use crate::view::View;
use crate::view::largest_radius;
use visage_geometry::{Motion, UnionFind, Vector3};

/// Makes the pairs' motions agree and moves the poses there; pairs without correspondences don't take part, and views
/// that are joined to none of the others keep their pose and are not placed. Returns the solves that it took, 0 if it failed:
/// then all poses stay.
pub(super) fn agree(agreement: Agreement, views: &[View], spacing: f64, state: &mut Outcome) -> usize {
    let usable: Vec<usize> =
        (0..state.pairs.len()).filter(|&pair| !lacks_correspondences(&state.pairs[pair])).collect();
    let relative: Vec<RelativeMotion> = usable.iter().map(|&pair| relative_motion(state, pair)).collect();
    let mut groups = UnionFind::new(views.len());
    for pair in &relative {
        groups.join(pair.i, pair.j);
    }
    let pieces = groups.numbered();
    state.placed = pieces.iter().map(|piece| *piece == 0).collect();
    let anchors = first_of_each_piece(&pieces);

    // twists are taken about the middle of the object, where turning and shifting are least entangled
    let middle = nalgebra::Translation3::from(weighted_middle(views, &state.local_poses));
    let centered: Vec<Motion> = state.local_poses.iter().map(|pose| middle.inverse() * pose).collect();
    let radius = largest_radius(views);
    let trusted = || vec![1.0; relative.len()];
    let found = match agreement {
        Agreement::MotionAveraging => {
            let options = AveragingOptions { radius, noise: spacing, robust: true };
            let averaged = motion_averaging::average(&centered, &relative, &anchors, &options).ok();
            averaged.map(|found| (found.poses, found.trusts, found.rounds))
        }
        Agreement::LowRankSparse => {
            let decomposed = low_rank::decompose(&centered, &relative, &anchors, radius).ok();
            decomposed.map(|found| (found.poses, trusted(), found.steps))
        }
    };
    let (poses, trusts, steps) = found.unwrap_or_else(|| (centered, trusted(), 0));
    let disagreements = disagreements(&poses, &relative, radius);
    for view in (0..views.len()).filter(|view| !anchors.contains(view)) {
        state.local_poses[view] = middle * poses[view];
    }
    for (pair, (disagreement, trust)) in usable.into_iter().zip(disagreements.into_iter().zip(trusts)) {
        (state.pairs[pair].disagreement, state.pairs[pair].trust) = (disagreement, trust);
    }
    steps
}

fn lacks_correspondences(pair: &PairOutcome) -> bool {
    pair.icp.is_some_and(|icp| icp.end == IcpEnd::NoCorrespondences)
}

fn relative_motion(state: &Outcome, pair: usize) -> RelativeMotion {
    let pair = &state.pairs[pair];
    let weight = state.overlaps.mutual(pair.i, pair.j).max(0.01);
    RelativeMotion { i: pair.i, j: pair.j, i_from_j: pair.i_from_j, weight }
}

fn weighted_middle(views: &[View], local_poses: &[Motion]) -> Vector3 {
    let total: f64 = views.iter().map(|view| view.points().len() as f64).sum();
    views
        .iter()
        .zip(local_poses)
        .map(|(view, pose)| pose.translation.vector * (view.points().len() as f64 / total))
        .sum()
}
