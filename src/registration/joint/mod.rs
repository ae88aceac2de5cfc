//! `joint`, the default method: ma-aticp on a coarse level to get near, then all poses refined together over the
//! correspondences of all overlapping pairs.
//!
//! Each correspondence asks that two surface patches lie in one plane: its residual is the distance along the mean of
//! both normals (symmetric point-to-plane; Rusinkiewicz, "A symmetric objective function for ICP", SIGGRAPH 2019),
//! exact for surfaces of second order. Sparse Gauss-Newton over 6(N-1) unknowns with robust weights; correspondences
//! are renewed in every step, pairs are chosen anew before each pass. No averaging error is left.

mod normal_equations;
mod refine;
mod surfels;

use rayon::prelude::*;

use self::refine::{RefineOptions, refine};
use self::surfels::Surfels;
use super::multiview::{self, Level, Multiview, MultiviewOptions, PairOutcome, Round};
use super::overlap::overlaps;
use super::trimmed_icp::{IcpEnd, IcpOptions, IcpResult, Trim, trimmed_icp};
use super::view::View;
use super::view_graph::ViewGraph;
use crate::geometry::Motion;
use crate::geometry::neighbours::{IndexedPoints, LocalPoint};
use crate::progress::{Canceled, Progress, Stage};

/// The level on which ma-aticp gets near. Lengths in spacings.
pub const NEAR: Level = Level {
    query_edge: 10.0,
    thin_targets: true,
    tolerance: 10.0,
    least_tolerance: 7.0,
    reach: 6.0,
    max_iterations: 30,
    settled: 1.0,
    search_trim: true,
};

/// A pass of the refinement. Lengths in spacings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Pass {
    /// Edge of the voxels that surfels stand for.
    pub edge: f64,
    /// Tolerance of the overlap by which its pairs are chosen.
    pub tolerance: f64,
    /// Largest distance of a correspondence in the first step.
    pub first_distance: f64,
    /// Largest distance of a correspondence in the last step.
    pub last_distance: f64,
    /// A step that moves nothing farther ends the pass.
    pub settled: f64,
}

/// The passes, coarse to fine.
pub const PASSES: [Pass; 2] = [
    Pass { edge: 8.0, tolerance: 8.0, first_distance: 16.0, last_distance: 6.0, settled: 0.05 },
    Pass { edge: 6.0, tolerance: 6.0, first_distance: 6.0, last_distance: 4.0, settled: 0.002 },
];

const MAX_STEPS: usize = 50;
/// Pairs take part down to this share of xi_0: less overlap than ICP of one pair needs is still worth having when all
/// pairs hold each other.
const OVERLAP_SHARE: f64 = 0.6;

/// Registers `views` from `initial` poses (local frame to world). View 0 keeps its pose.
pub fn joint(
    views: &[View],
    initial: &[Motion],
    options: &MultiviewOptions,
    progress: &Progress,
) -> Result<Multiview, Canceled> {
    let spacing = multiview::common_spacing(views);
    let mut state = multiview::ma_aticp(views, initial, &[NEAR], options, progress)?;
    for (index, pass) in PASSES.iter().enumerate() {
        progress.report(Stage::Registering, 0.5 + 0.25 * index as f64);
        let surfels: Vec<Surfels> = views.par_iter().map(|view| Surfels::new(view, pass.edge * spacing)).collect();
        run_pass(&surfels, index, pass, spacing, options, &mut state, progress)?;
        if index + 1 == PASSES.len() {
            measure_pairs(views, &surfels, spacing, &mut state, progress)?;
        }
    }
    Ok(state)
}

fn run_pass(
    surfels: &[Surfels],
    index: usize,
    pass: &Pass,
    spacing: f64,
    options: &MultiviewOptions,
    state: &mut Multiview,
    progress: &Progress,
) -> Result<(), Canceled> {
    let targets: Vec<&IndexedPoints> = surfels.iter().map(|s| &s.indexed).collect();
    let samples: Vec<&[LocalPoint]> = surfels.iter().map(|s| s.indexed.points.as_slice()).collect();
    state.overlaps = overlaps(&targets, &samples, &state.local_poses, pass.tolerance * spacing, progress)?;
    let graph = ViewGraph::choose(&state.overlaps, OVERLAP_SHARE * options.min_overlap);
    let anchors = multiview::first_of_each_piece(&graph.pieces);
    let refine_options = RefineOptions {
        first_distance: pass.first_distance * spacing,
        last_distance: pass.last_distance * spacing,
        max_steps: MAX_STEPS,
        settled: pass.settled * spacing,
    };
    let refined = refine(surfels, &state.local_poses, &graph.pairs, &anchors, &refine_options, progress)?;
    state.rounds.push(Round {
        level: 1 + index,
        tolerance: pass.tolerance * spacing,
        pairs: graph.pairs.len(),
        min_overlap: graph.min_overlap,
        icp_iterations: 0,
        averaging_rounds: refined.steps,
        rotation_change: multiview::largest_turn(&state.local_poses, &refined.local_poses),
    });
    state.placed = graph.pieces.iter().map(|piece| *piece == 0).collect();
    state.pairs = graph
        .pairs
        .iter()
        .map(|&(i, j)| PairOutcome::unmeasured(i, j, state.local_poses[i].inv_mul(&refined.local_poses[j])))
        .collect();
    state.local_poses = refined.local_poses;
    Ok(())
}

/// A point of another view nearer than this many spacings is a counterpart, in the report.
const TOUCHING: f64 = 2.0;

/// What ICP would say of each pair at the final poses: overlaps, correspondences and their distance, measured from
/// the surfels to all points of the other view.
fn measure_pairs(
    views: &[View],
    surfels: &[Surfels],
    spacing: f64,
    state: &mut Multiview,
    progress: &Progress,
) -> Result<(), Canceled> {
    let options = IcpOptions {
        trim: Trim::Share(1.0),
        max_distance: TOUCHING * spacing,
        threshold: 0.0,
        max_iterations: 0,
        min_step: 0.0,
    };
    let poses = &state.local_poses;
    let measure = |target: usize, source: usize| {
        let motion = poses[target].inv_mul(&poses[source]);
        trimmed_icp(&views[target].indexed, &surfels[source].indexed.points, &motion, &options, progress)
    };
    let measured: Vec<(IcpResult, IcpResult)> = state
        .pairs
        .par_iter()
        .map(|pair| Ok((measure(pair.i, pair.j)?, measure(pair.j, pair.i)?)))
        .collect::<Result<_, Canceled>>()?;
    for (pair, (icp_i_j, icp_j_i)) in state.pairs.iter_mut().zip(measured) {
        state.overlaps.set(pair.j, pair.i, icp_i_j.share);
        state.overlaps.set(pair.i, pair.j, icp_j_i.share);
        pair.icp = IcpResult { end: IcpEnd::Joint, ..icp_i_j };
    }
    Ok(())
}
