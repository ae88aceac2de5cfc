//! The loop of Algorithm 1, the same for every member of the family.

use rayon::prelude::*;

use super::agreement::agree;
use super::recipe::{Agreement, Level, Reach, Recipe, StopRule, TrimRule};
use crate::outcome::{MethodOptions, Outcome, PairOutcome, Round, largest_turn};
use crate::overlap::overlaps;
use crate::pairwise::convergence_threshold::{adaptive_threshold, array_threshold};
use crate::pairwise::trimmed_icp::{IcpOptions, Trim, trimmed_icp};
use crate::view::View;
use crate::view::{common_spacing, largest_radius};
use crate::view_graph::ViewGraph;
use visage_geometry::Motion;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::progress::{Canceled, Progress, Stage};

/// Registers `views` from `initial` poses (local frame to world). View 0 keeps its pose.
pub fn register(
    recipe: &Recipe,
    views: &[View],
    initial: &[Motion],
    options: &MethodOptions,
    progress: &Progress,
) -> Result<Outcome, Canceled> {
    let mut state = Outcome::at(initial);
    for (index, level) in recipe.levels.iter().enumerate() {
        let queries: Vec<Vec<LocalPoint>> = views.par_iter().map(|view| queries(view, level, views)).collect();
        let thinned: Option<Vec<IndexedPoints>> =
            level.thin_targets.then(|| queries.par_iter().cloned().map(IndexedPoints::new).collect());
        let run = LevelRun {
            views,
            spacing: common_spacing(views),
            level,
            options,
            queries: queries.iter().map(Vec::as_slice).collect(),
            targets: match &thinned {
                Some(thinned) => thinned.iter().collect(),
                None => views.iter().map(|view| &view.indexed).collect(),
            },
        };
        let share = |round| expected_share(index, recipe.levels.len(), round);
        run.rounds(index, recipe.agreement, share, &mut state, progress)?;
    }
    Ok(state)
}

/// The points of a view that ask for their nearest in others.
fn queries(view: &View, level: &Level, views: &[View]) -> Vec<LocalPoint> {
    if level.query_edge > 0.0 { view.sampled(level.query_edge * common_spacing(views)) } else { view.points().to_vec() }
}

/// A guess for the progress bar: levels cost alike, and each round of a level half of what is left.
fn expected_share(level: usize, levels: usize, round: usize) -> f64 {
    let within = 1.0 - 0.6f64.powi(round as i32);
    (level as f64 + within) / levels as f64
}

/// What stays the same over the rounds of a level.
struct LevelRun<'a> {
    views: &'a [View],
    /// The unit of the level's lengths.
    spacing: f64,
    level: &'a Level,
    options: &'a MethodOptions,
    /// For each view the points that look for counterparts.
    queries: Vec<&'a [LocalPoint]>,
    /// For each view the points among which counterparts are looked for.
    targets: Vec<&'a IndexedPoints>,
}

impl LevelRun<'_> {
    fn rounds(
        &self,
        index: usize,
        agreement: Agreement,
        share: impl Fn(usize) -> f64,
        state: &mut Outcome,
        progress: &Progress,
    ) -> Result<(), Canceled> {
        let settled_angle = self.level.settled * self.spacing / largest_radius(self.views);
        let samples: Vec<Vec<LocalPoint>> = self.queries.iter().map(|queries| self.sampled(queries)).collect();
        let samples: Vec<&[LocalPoint]> = samples.iter().map(Vec::as_slice).collect();
        let mut tolerance = self.level.tolerance;
        for round in 0..self.options.max_rounds {
            progress.report(Stage::Registering, share(round));
            let length = tolerance * self.spacing;
            state.overlaps = overlaps(&self.targets, &samples, &state.local_poses, length, progress)?;
            let graph = ViewGraph::choose(&state.overlaps, self.options.min_overlap, self.level.min_degree);
            state.pairs = self.register_pairs(&graph, length, state, progress)?;
            let before = state.local_poses.clone();
            let averaging_rounds = agree(agreement, self.views, self.spacing, state);
            let change = largest_turn(&before, &state.local_poses);
            state.rounds.push(Round {
                level: index,
                tolerance: length,
                pairs: graph.pairs.len(),
                min_overlap: graph.min_overlap,
                icp_iterations: state.pairs.iter().map(|pair| pair.icp.map_or(0, |icp| icp.iterations)).sum(),
                averaging_rounds,
                rotation_change: change,
            });
            if change < settled_angle && tolerance <= self.level.least_tolerance {
                break;
            }
            tolerance = (tolerance / 2.0).max(self.level.least_tolerance);
        }
        Ok(())
    }

    /// The queries by which overlaps are measured.
    fn sampled(&self, queries: &[LocalPoint]) -> Vec<LocalPoint> {
        let most = self.level.overlap_samples.unwrap_or(usize::MAX).max(1);
        queries.iter().step_by(queries.len().div_ceil(most).max(1)).copied().collect()
    }

    /// ICP of every chosen pair from the current poses, in parallel; results in the order of the pairs.
    fn register_pairs(
        &self,
        graph: &ViewGraph,
        tolerance: f64,
        state: &Outcome,
        progress: &Progress,
    ) -> Result<Vec<PairOutcome>, Canceled> {
        graph
            .pairs
            .par_iter()
            .with_max_len(1)
            .map(|&(i, j)| {
                let options = self.icp_options((i, j), state.overlaps.directed(j, i), tolerance);
                let start = state.local_poses[i].inv_mul(&state.local_poses[j]);
                let icp = trimmed_icp(self.targets[i], self.queries[j], &start, &options, progress)?;
                Ok(PairOutcome::by_icp(i, j, &icp, Some(options.threshold)))
            })
            .collect()
    }

    /// ICP moves view j, so its overlap xi_ji trims and is N_p/N_t of the threshold.
    fn icp_options(&self, (i, j): (usize, usize), overlap_j_i: f64, tolerance: f64) -> IcpOptions {
        let estimated = self.views[i].range_accuracy.max(self.views[j].range_accuracy);
        let range_accuracy = self.options.range_accuracy.unwrap_or(estimated);
        IcpOptions {
            trim: match self.level.trim {
                TrimRule::Overlap => Trim::Share(overlap_j_i),
                TrimRule::Search => Trim::Search { least: 0.5 },
                TrimRule::Nothing => Trim::Share(1.0),
            },
            max_distance: match self.level.reach {
                Reach::Tolerances(count) => count * tolerance,
                Reach::Spacings(count) => count * self.spacing,
            },
            threshold: match self.level.stop {
                StopRule::Adaptive => match (self.views[i].resolution, self.views[j].resolution) {
                    (Some(resolution), Some(_)) => array_threshold(overlap_j_i, resolution, range_accuracy),
                    _ => adaptive_threshold(overlap_j_i, self.spacing, range_accuracy),
                },
                StopRule::Fixed(squared_spacings) => squared_spacings * self.spacing * self.spacing,
            },
            max_iterations: self.level.max_iterations,
            min_step: 0.1 * self.level.settled * self.spacing,
        }
    }
}
