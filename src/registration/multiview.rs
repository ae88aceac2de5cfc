//! Multi-view registration: Algorithm 1 of the paper, coarse to fine.
//!
//! A round is: directed overlaps, pairs above xi_0, trimmed ICP of each pair from the current poses, motion averaging.
//! Rounds repeat until no view turns any more. The paper runs them on all points; here the *queries* are thinned to
//! voxels (targets keep all points), the first level is coarse, and searches are bounded: all of it is reported.

use rayon::prelude::*;

use super::motion_averaging::{self, AveragingOptions, RelativeMotion};
use super::overlap::{OverlapMatrix, overlaps};
use super::threshold::adaptive_threshold;
use super::trimmed_icp::{IcpEnd, IcpOptions, IcpResult, Trim, trimmed_icp};
use super::view::View;
use super::view_graph::ViewGraph;
use crate::geometry::neighbours::{IndexedPoints, LocalPoint};
use crate::geometry::{Motion, Vector3, se3};
use crate::progress::{Canceled, Progress, Stage};

/// What the caller may set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultiviewOptions {
    /// xi_0: pairs with a smaller mutual overlap are not registered, unless the views would fall into pieces.
    pub min_overlap: f64,
    /// R_e in the scans' unit; each view's own estimate when absent.
    pub range_accuracy: Option<f64>,
    /// Rounds at most, on each level.
    pub max_rounds: usize,
}

/// A step from coarse to fine. Lengths in spacings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Level {
    /// Edge of the voxels to which queries are thinned.
    pub query_edge: f64,
    /// Whether the targets are thinned like the queries.
    pub thin_targets: bool,
    /// Tolerance of the overlap in the first round; halved each round down to `least_tolerance`.
    pub tolerance: f64,
    /// The tolerance it ends with.
    pub least_tolerance: f64,
    /// Search distance of ICP, in tolerances of the overlap.
    pub reach: f64,
    /// ICP fits at most, per pair and round.
    pub max_iterations: usize,
    /// Rounds end when no view turns by more than moves its own points by this much.
    pub settled: f64,
    /// Pairs that a view gets even if none of them exceeds xi_0.
    pub partners: usize,
    /// Whether ICP finds the share to keep itself, since overlaps at rough poses say little.
    pub search_trim: bool,
}

/// The levels of `ma-aticp`.
pub const LEVELS: [Level; 2] = [
    Level {
        query_edge: 6.0,
        thin_targets: true,
        tolerance: 10.0,
        least_tolerance: 5.0,
        reach: 6.0,
        max_iterations: 40,
        settled: 0.5,
        partners: 0,
        search_trim: true,
    },
    Level {
        query_edge: 3.0,
        thin_targets: false,
        tolerance: 3.0,
        least_tolerance: 2.0,
        reach: 2.0,
        max_iterations: 20,
        settled: 0.03,
        partners: 0,
        search_trim: false,
    },
];

/// One registered pair of the last round.
#[derive(Debug, Clone, PartialEq)]
pub struct PairOutcome {
    /// The target view.
    pub i: usize,
    /// The view that ICP moved.
    pub j: usize,
    /// ICP's result, in local frames.
    pub icp: IcpResult,
    /// The adaptive threshold it ran with, a squared length.
    pub threshold: f64,
    /// How far the pair disagrees with the averaged poses, a length.
    pub disagreement: f64,
    /// Robust weight in averaging, in (0, 1].
    pub trust: f64,
}

impl PairOutcome {
    /// A pair of which only the relative motion is known (local frame of j to local frame of i).
    pub(super) fn unmeasured(i: usize, j: usize, motion_i_j: Motion) -> Self {
        let icp = IcpResult {
            motion: motion_i_j,
            correspondences: 0,
            share: 0.0,
            mean_distance2: f64::INFINITY,
            iterations: 0,
            end: IcpEnd::NoCorrespondences,
        };
        PairOutcome { i, j, icp, threshold: 0.0, disagreement: 0.0, trust: 1.0 }
    }
}

/// What one round did.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    /// Index into [`LEVELS`].
    pub level: usize,
    /// Overlap tolerance, a length.
    pub tolerance: f64,
    /// Pairs registered.
    pub pairs: usize,
    /// The overlap a pair had to exceed in the end.
    pub min_overlap: f64,
    /// ICP fits over all pairs.
    pub icp_iterations: usize,
    /// Linear solves of averaging.
    pub averaging_rounds: usize,
    /// e^k: the largest change of a view's rotation, radians.
    pub rotation_change: f64,
}

/// Registered views.
#[derive(Debug, Clone, PartialEq)]
pub struct Multiview {
    /// Local frame to world.
    pub local_poses: Vec<Motion>,
    /// For each view whether it hangs together with view 0.
    pub placed: Vec<bool>,
    /// Overlaps at the last round's start.
    pub overlaps: OverlapMatrix,
    /// The pairs of the last round.
    pub pairs: Vec<PairOutcome>,
    /// All rounds.
    pub rounds: Vec<Round>,
}

impl Multiview {
    /// Nothing done yet.
    pub(super) fn at(initial: &[Motion]) -> Self {
        Multiview {
            local_poses: initial.to_vec(),
            placed: vec![true; initial.len()],
            overlaps: OverlapMatrix::identity(initial.len()),
            pairs: Vec::new(),
            rounds: Vec::new(),
        }
    }
}

/// Registers `views` from `initial` poses (local frame to world). View 0 keeps its pose.
pub fn ma_aticp(
    views: &[View],
    initial: &[Motion],
    levels: &[Level],
    options: &MultiviewOptions,
    progress: &Progress,
) -> Result<Multiview, Canceled> {
    let mut state = Multiview::at(initial);
    for (index, level) in levels.iter().enumerate() {
        run_level(views, index, level, options, &mut state, progress)?;
    }
    Ok(state)
}

fn run_level(
    views: &[View],
    index: usize,
    level: &Level,
    options: &MultiviewOptions,
    state: &mut Multiview,
    progress: &Progress,
) -> Result<(), Canceled> {
    let spacing = common_spacing(views);
    let queries: Vec<IndexedPoints> =
        views.par_iter().map(|view| IndexedPoints::new(view.sampled(level.query_edge * spacing))).collect();
    let samples: Vec<&[LocalPoint]> = queries.iter().map(|query| query.points.as_slice()).collect();
    let targets: Vec<&IndexedPoints> =
        if level.thin_targets { queries.iter().collect() } else { views.iter().map(|view| &view.indexed).collect() };
    let mut tolerance = level.tolerance;
    for round in 0..options.max_rounds {
        progress.report(Stage::Registering, expected_share(index, round));
        state.overlaps = overlaps(&targets, &samples, &state.local_poses, tolerance * spacing, progress)?;
        let graph = ViewGraph::choose(&state.overlaps, options.min_overlap, level.partners);
        let registered =
            register_pairs(views, &targets, &samples, &graph, level, tolerance * spacing, options, state, progress)?;
        let before = state.local_poses.clone();
        let averaging_rounds = average_pairs(views, &graph, registered, spacing, state);
        let change = largest_turn(&before, &state.local_poses);
        state.placed = graph.pieces.iter().map(|piece| *piece == 0).collect();
        state.rounds.push(Round {
            level: index,
            tolerance: tolerance * spacing,
            pairs: graph.pairs.len(),
            min_overlap: graph.min_overlap,
            icp_iterations: state.pairs.iter().map(|pair| pair.icp.iterations).sum(),
            averaging_rounds,
            rotation_change: change,
        });
        let settled_angle = level.settled * spacing / largest_radius(views);
        let tolerance_settled = tolerance <= level.least_tolerance;
        if change < settled_angle && tolerance_settled {
            break;
        }
        tolerance = (tolerance / 2.0).max(level.least_tolerance);
    }
    Ok(())
}

/// ICP of every chosen pair, in parallel, the largest first; results in the order of the pairs.
#[allow(clippy::too_many_arguments)]
fn register_pairs(
    views: &[View],
    targets: &[&IndexedPoints],
    queries: &[&[LocalPoint]],
    graph: &ViewGraph,
    level: &Level,
    tolerance: f64,
    options: &MultiviewOptions,
    state: &Multiview,
    progress: &Progress,
) -> Result<Vec<PairOutcome>, Canceled> {
    let spacing = common_spacing(views);
    graph
        .pairs
        .par_iter()
        .with_max_len(1)
        .map(|&(i, j)| {
            let overlap_j_i = state.overlaps.directed(j, i);
            let range_accuracy = options.range_accuracy.unwrap_or(views[i].range_accuracy.max(views[j].range_accuracy));
            let threshold = adaptive_threshold(overlap_j_i, spacing, range_accuracy);
            let icp_options = IcpOptions {
                trim: if level.search_trim { Trim::Search { least: 0.5 } } else { Trim::Share(overlap_j_i) },
                max_distance: level.reach * tolerance,
                threshold,
                max_iterations: level.max_iterations,
                min_step: 0.1 * level.settled * spacing,
            };
            let start = state.local_poses[i].inv_mul(&state.local_poses[j]);
            let icp = trimmed_icp(targets[i], queries[j], &start, &icp_options, progress)?;
            Ok(PairOutcome { i, j, icp, threshold, disagreement: 0.0, trust: 1.0 })
        })
        .collect()
}

/// Averages the pairs' motions into `state.local_poses`; pairs without correspondences don't take part.
fn average_pairs(
    views: &[View],
    graph: &ViewGraph,
    registered: Vec<PairOutcome>,
    spacing: f64,
    state: &mut Multiview,
) -> usize {
    let usable: Vec<&PairOutcome> =
        registered.iter().filter(|pair| pair.icp.end != IcpEnd::NoCorrespondences).collect();
    let relative: Vec<RelativeMotion> = usable
        .iter()
        .map(|pair| RelativeMotion {
            i: pair.i,
            j: pair.j,
            motion_i_j: pair.icp.motion,
            weight: state.overlaps.mutual(pair.i, pair.j).max(0.01),
        })
        .collect();
    // twists are taken about the middle of the object, where turning and shifting are least entangled
    let middle = nalgebra::Translation3::from(weighted_middle(views, &state.local_poses));
    let centered: Vec<Motion> = state.local_poses.iter().map(|pose| middle.inverse() * pose).collect();
    let anchors = first_of_each_piece(&graph.pieces);
    let averaging = motion_averaging::average(
        &centered,
        &relative,
        &anchors,
        &AveragingOptions { radius: largest_radius(views), noise: spacing, robust: true },
    );
    let mut pairs = registered.clone();
    let mut rounds = 0;
    if let Ok(averaged) = averaging {
        rounds = averaged.rounds;
        for (view, pose) in averaged.poses.iter().enumerate() {
            if !anchors.contains(&view) {
                state.local_poses[view] = middle * pose;
            }
        }
        let mut outcomes = averaged.disagreements.iter().zip(&averaged.trusts);
        for pair in pairs.iter_mut().filter(|pair| pair.icp.end != IcpEnd::NoCorrespondences) {
            if let Some((disagreement, trust)) = outcomes.next() {
                (pair.disagreement, pair.trust) = (*disagreement, *trust);
            }
        }
    }
    state.pairs = pairs;
    rounds
}

/// The view that keeps its pose in each connected piece: the first.
pub(super) fn first_of_each_piece(pieces: &[usize]) -> Vec<usize> {
    (0..pieces.len()).filter(|&view| !pieces[..view].contains(&pieces[view])).collect()
}

/// The median spacing of the views: the length to which tolerances are tied.
pub fn common_spacing(views: &[View]) -> f64 {
    let mut spacings: Vec<f64> = views.iter().map(|view| view.spacing).collect();
    spacings.sort_by(f64::total_cmp);
    spacings.get(spacings.len() / 2).copied().unwrap_or(0.0)
}

fn largest_radius(views: &[View]) -> f64 {
    views.iter().map(|view| view.radius).fold(0.0, f64::max)
}

fn weighted_middle(views: &[View], local_poses: &[Motion]) -> Vector3 {
    let total: f64 = views.iter().map(|view| view.points().len() as f64).sum();
    views
        .iter()
        .zip(local_poses)
        .map(|(view, pose)| pose.translation.vector * (view.points().len() as f64 / total))
        .sum()
}

/// e^k of Algorithm 1: the largest angle between a view's rotation before and after, radians.
pub(super) fn largest_turn(before: &[Motion], after: &[Motion]) -> f64 {
    let angles = before.iter().zip(after).map(|(a, b)| se3::rotation_angle(&a.rotation.rotation_to(&b.rotation)));
    angles.fold(0.0, f64::max)
}

/// A guess for the progress bar: levels cost alike, and each round of a level half of what is left.
fn expected_share(level: usize, round: usize) -> f64 {
    let within = 1.0 - 0.6f64.powi(round as i32);
    (level as f64 + within) / LEVELS.len() as f64
}
