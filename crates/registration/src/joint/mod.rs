//! `joint`, the default method: all poses refined together over the correspondences of all overlapping pairs, coarse to
//! fine.
//!
//! Each correspondence asks that two surface patches lie in one plane: its residual is the distance along the mean of
//! both normals (symmetric point-to-plane; Rusinkiewicz, "A symmetric objective function for ICP", SIGGRAPH 2019),
//! exact for surfaces of second order. Sparse Gauss-Newton over 6(N-1) unknowns with robust weights; correspondences
//! are renewed in every step, pairs are chosen anew before each pass. No averaging error is left. A coarse level of
//! pairwise ICP and averaging before it was tried and left out: a view that one pair alone holds at first goes wherever that
//! pair goes (one start of 45 was lost so), while here all its neighbours hold it at once.

mod coarse_scale;
pub mod colours;
pub(crate) mod refine;
mod scaled;
mod sides;
pub mod surfels;

use rayon::prelude::*;

use self::refine::{RefineOptions, refine};
pub use self::scaled::joint_scaled;
use self::surfels::{FineSurfels, Surfels};
use crate::least_squares::normal_equations::RIGID;
use crate::outcome::{MethodOptions, Outcome, PairOutcome, Round, first_of_each_piece, largest_turn};
use crate::overlap::overlaps;
use crate::pairwise::trimmed_icp::{IcpOptions, IcpResult, Trim, trimmed_icp};
use crate::view::{View, common_spacing};
use crate::view_graph::ViewGraph;
use visage_geometry::Motion;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::progress::{Canceled, Progress, Stage};

/// A pass of the refinement.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Pass {
    /// About how many surfels stand for a view: that fixes the edge of their voxels.
    pub surfels: f64,
    /// The largest edge in spacings, however many points a scan has. None for a pass that only has to bring poses near:
    /// how far it reaches is a share of the object, whatever the scanner resolves.
    pub coarsest_edge: Option<f64>,
    /// Tolerance of the overlap by which its pairs are chosen, in edges.
    pub tolerance: f64,
    /// Largest distance of a correspondence in the first step, in edges.
    pub first_distance: f64,
    /// Largest distance of a correspondence in the last step, in edges.
    pub last_distance: f64,
    /// A step that moves nothing farther (in spacings) ends the pass.
    pub settled: f64,
    /// Before its last steps only one in so many surfels is queried.
    pub query_stride: usize,
    /// Pairs that a view gets even if they overlap less.
    pub min_degree: usize,
}

/// The passes, coarse to fine. The first reaches as far as rough poses are wrong, some 0.4 of an object's radius; the
/// second settles what it left. A surfel is a mean, and the mean of a bent patch lies below the surface by a share of
/// its edge's square, not alike in views from different sides: so the last makes the edges small, and takes few steps.
/// What flat or thin faces leave loose is often held by small overlaps alone: the last takes more of them, since near the truth
/// they can be believed.
pub const PASSES: [Pass; 2] = [
    Pass {
        surfels: 500.0,
        coarsest_edge: None,
        tolerance: 1.15,
        first_distance: 2.9,
        last_distance: 1.0,
        settled: 0.5,
        query_stride: 1,
        min_degree: 2,
    },
    Pass {
        surfels: 4000.0,
        coarsest_edge: Some(4.9),
        tolerance: 1.03,
        first_distance: 2.45,
        last_distance: 1.03,
        settled: 0.05,
        query_stride: 3,
        min_degree: 4,
    },
];

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A voxel narrower than this (in spacings) holds too few points to average.
        finest_edge: f64 = 2.5,
        /// A view of n points has about `n (TUNING.edge_factor / edge)^2` voxels of an edge given in spacings.
        edge_factor: f64 = 1.7,
        /// Edge of the voxels of the surfels that results are judged by, in edges of the last pass: fewer are enough, and all
        /// pairs are searched anew with them.
        judged_edge: f64 = 1.63,
        /// The largest distance of their correspondences, in their edges.
        judged_reach: f64 = 0.63,
        /// Gauss-Newton steps of a pass, at most.
        max_steps: usize = 50,
        /// Pairs take part down to this share of xi_0: less overlap than ICP of one pair needs is still worth having when all
        /// pairs hold each other.
        overlap_share: f64 = 0.6,
        /// Surfels by which pairs are chosen and reported, at most: a share to about 2 %.
        overlap_samples: usize = 500,
        /// A point of another view nearer than this many spacings is a counterpart, in the report.
        touching: f64 = 2.0,
    }
}

impl Pass {
    /// The edge of the voxels, in the unit of the scans.
    fn edge(&self, views: &[View], spacing: f64) -> f64 {
        let points = views.iter().map(|view| view.points().len() as f64).sum::<f64>() / views.len() as f64;
        let edge = TUNING.edge_factor * (points / self.surfels).sqrt();
        spacing * edge.min(self.coarsest_edge.unwrap_or(edge)).max(TUNING.finest_edge)
    }
}

/// The surfels that results are judged by, whatever the method was.
pub fn judged_surfels(views: &[View]) -> FineSurfels {
    let edge = PASSES[1].edge(views, common_spacing(views));
    let fine: Vec<Surfels> = views.par_iter().map(|view| Surfels::new(view, edge)).collect();
    FineSurfels { share: 1.0, ..judged(&fine, edge) }
}

/// Of the last pass's surfels those that results are judged by.
fn judged(fine: &[Surfels], fine_edge: f64) -> FineSurfels {
    let edge = TUNING.judged_edge * fine_edge;
    let views = thinned(fine, edge);
    let count = |views: &[Surfels]| views.iter().map(|surfels| surfels.inner.len()).sum::<usize>();
    let share = count(&views) as f64 / count(fine).max(1) as f64;
    FineSurfels { views, edge, reach: TUNING.judged_reach * edge, share }
}

fn thinned(surfels: &[Surfels], edge: f64) -> Vec<Surfels> {
    surfels.par_iter().map(|surfels| surfels.thinned(edge)).collect()
}

/// Registers `views` from `initial` poses (local frame to world). View 0 keeps its pose.
pub fn joint(
    views: &[View],
    initial: &[Motion],
    options: &MethodOptions,
    progress: &Progress,
) -> Result<Outcome, Canceled> {
    joint_onto(views, initial, &[0], options, progress)
}

/// Registers `views` from `initial` poses (local frame to world) onto those that are `fixed`: they keep their poses as
/// one rigid body, and pairs among them take no part. Views that overlap none of them are unplaced.
pub fn joint_onto(
    views: &[View],
    initial: &[Motion],
    fixed: &[usize],
    options: &MethodOptions,
    progress: &Progress,
) -> Result<Outcome, Canceled> {
    let run = Run { options, fixed, spacing: common_spacing(views), max_steps: TUNING.max_steps, progress };
    run.from(views, initial)
}

/// The outcome of `views` that stay at `poses` (local frame to world), with the overlaps and distances of their pairs there:
/// for poses that were refined already, under a constraint that `joint` does not know.
pub fn joint_at(views: &[View], poses: &[Motion], progress: &Progress) -> Result<Outcome, Canceled> {
    let options = MethodOptions::default();
    let run = Run { options: &options, fixed: &[0], spacing: common_spacing(views), max_steps: 0, progress };
    run.from(views, poses)
}

/// What all passes of one registration share.
struct Run<'a> {
    options: &'a MethodOptions,
    /// Views that keep their poses: at least one.
    fixed: &'a [usize],
    spacing: f64,
    /// Gauss-Newton steps of a pass, at most.
    max_steps: usize,
    progress: &'a Progress,
}

/// Surfels spread evenly over a view (they are stored along a space-filling curve).
fn sampled(surfels: &Surfels) -> Vec<LocalPoint> {
    let points = &surfels.indexed.points;
    points.iter().step_by(points.len().div_ceil(TUNING.overlap_samples).max(1)).copied().collect()
}

impl Run<'_> {
    /// All passes from `initial` poses.
    fn from(&self, views: &[View], initial: &[Motion]) -> Result<Outcome, Canceled> {
        let mut state = Outcome::at(initial);
        let [coarse, fine] = PASSES.map(|pass| pass.edge(views, self.spacing));
        let mut surfels: Vec<Surfels> = views.par_iter().map(|view| Surfels::new(view, fine)).collect();
        let mut judged = judged(&surfels, fine);
        let mut few = thinned(&judged.views, coarse);
        let seen = few.clone();
        sides::find_sides(&seen, coarse, initial, &mut [&mut few, &mut judged.views, &mut surfels]);
        for (index, (surfels, edge)) in [(&few, coarse), (&surfels, fine)].into_iter().enumerate() {
            self.progress.report(Stage::Registering, index as f64 / PASSES.len() as f64);
            self.pass::<RIGID>(surfels, index, &PASSES[index], edge, &mut state)?;
        }
        self.measure_pairs(views, &judged.views, &mut state)?;
        state.surfels = Some(judged);
        Ok(state)
    }

    /// Chooses pairs and refines the poses in `state` over them; answers with the change of each view's scale.
    fn pass<const D: usize>(
        &self,
        surfels: &[Surfels],
        index: usize,
        pass: &Pass,
        edge: f64,
        state: &mut Outcome,
    ) -> Result<Vec<f64>, Canceled> {
        let targets: Vec<&IndexedPoints> = surfels.iter().map(|s| &s.indexed).collect();
        let samples: Vec<Vec<LocalPoint>> = surfels.iter().map(sampled).collect();
        let samples: Vec<&[LocalPoint]> = samples.iter().map(Vec::as_slice).collect();
        state.overlaps = overlaps(&targets, &samples, &state.local_poses, pass.tolerance * edge, self.progress)?;
        let mut graph =
            ViewGraph::choose(&state.overlaps, TUNING.overlap_share * self.options.min_overlap, pass.min_degree);
        graph.pairs.retain(|(i, j)| !(self.fixed.contains(i) && self.fixed.contains(j)));
        let refine_options = RefineOptions {
            first_distance: pass.first_distance * edge,
            last_distance: pass.last_distance * edge,
            max_steps: self.max_steps,
            settled: pass.settled * self.spacing,
            query_stride: pass.query_stride,
        };
        let anchors = self.anchors(&graph);
        let refined = refine::<D>(surfels, &state.local_poses, &graph.pairs, &anchors, &refine_options, self.progress)?;
        state.rounds.push(Round {
            level: index,
            tolerance: pass.tolerance * edge,
            pairs: graph.pairs.len(),
            min_overlap: graph.min_overlap,
            icp_iterations: 0,
            averaging_rounds: refined.steps,
            rotation_change: largest_turn(&state.local_poses, &refined.local_poses),
        });
        state.placed = graph.pieces.iter().map(|piece| self.holds(&graph, *piece)).collect();
        state.pairs = graph
            .pairs
            .iter()
            .map(|&(i, j)| PairOutcome::unmeasured(i, j, state.local_poses[i].inv_mul(&refined.local_poses[j])))
            .collect();
        state.local_poses = refined.local_poses;
        Ok(refined.scales)
    }

    /// Whether a piece of the graph holds a fixed view.
    fn holds(&self, graph: &ViewGraph, piece: usize) -> bool {
        self.fixed.iter().any(|&view| graph.pieces[view] == piece)
    }

    /// The fixed views, and the first of each piece that holds none.
    fn anchors(&self, graph: &ViewGraph) -> Vec<usize> {
        let mut anchors = first_of_each_piece(&graph.pieces);
        anchors.retain(|&view| !self.holds(graph, graph.pieces[view]));
        anchors.extend(self.fixed);
        anchors
    }

    /// What ICP would say of each pair at the final poses: overlaps, correspondences and their distance, measured from
    /// some surfels to all points of the other view.
    fn measure_pairs(&self, views: &[View], surfels: &[Surfels], state: &mut Outcome) -> Result<(), Canceled> {
        let options = IcpOptions {
            trim: Trim::Share(1.0),
            max_distance: TUNING.touching * self.spacing,
            threshold: 0.0,
            max_iterations: 0,
            min_step: 0.0,
        };
        let poses = &state.local_poses;
        let samples: Vec<Vec<LocalPoint>> = surfels.iter().map(sampled).collect();
        let measure = |target: usize, source: usize| {
            let motion = poses[target].inv_mul(&poses[source]);
            trimmed_icp(&views[target].indexed, &samples[source], &motion, &options, self.progress)
        };
        let measured: Vec<(IcpResult, IcpResult)> = state
            .pairs
            .par_iter()
            .map(|pair| Ok((measure(pair.i, pair.j)?, measure(pair.j, pair.i)?)))
            .collect::<Result<_, Canceled>>()?;
        for (pair, (icp_i_j, icp_j_i)) in state.pairs.iter_mut().zip(measured) {
            state.overlaps.set(pair.j, pair.i, icp_i_j.share);
            state.overlaps.set(pair.i, pair.j, icp_j_i.share);
            *pair = pair.clone().measured(&icp_i_j);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    /// A ball of radius 100, points spread evenly (a Fibonacci lattice).
    fn ball(points: usize) -> View {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let point = |k: usize| {
            let height = 1.0 - 2.0 * (k as f64 + 0.5) / points as f64;
            let (radius, angle) = ((1.0 - height * height).sqrt(), golden * k as f64);
            Point3::new(radius * angle.cos(), height, radius * angle.sin()) * 100.0
        };
        View::new(&Cloud::from_points((0..points).map(point).collect())).expect("a view")
    }

    #[test]
    fn the_first_pass_reaches_as_far_in_dense_scans_as_in_sparse_ones() {
        let reach = |points: usize| {
            let views = [ball(points)];
            PASSES[0].first_distance * PASSES[0].edge(&views, views[0].spacing)
        };
        let (sparse, dense) = (reach(4_000), reach(160_000));
        assert!(sparse > 40.0 && (dense / sparse - 1.0).abs() < 0.1, "{sparse} {dense}");
    }
}
