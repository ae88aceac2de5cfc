//! ICP of one pair of scans: [`trimmed_icp`], the adaptive threshold that ends it ([`convergence_threshold`], [P1], [P2]), the
//! closed-form fit ([`rigid_fit`]). `averaging` runs it on all pairs; alone, of exactly two scans, it is the methods `icp` and
//! `tricp`.

pub mod convergence_threshold;
pub mod rigid_fit;
pub mod trimmed_icp;

use rayon::prelude::*;

use crate::outcome::{Outcome, PairOutcome, Round, largest_turn};
use crate::overlap::overlaps;
use crate::pairwise::trimmed_icp::{IcpEnd, IcpOptions, Trim, trimmed_icp};
use crate::view::View;
use crate::view::common_spacing;
use visage_geometry::Motion;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::progress::{Canceled, Progress, Stage};

/// What ICP of two scans keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// The nearest point of every point, however far: ICP as Besl and McKay (1992) have it.
    All,
    /// The share that minimises TrICP's objective, found in each iteration.
    Search,
}

/// What the pair is run with, for reports. Lengths in spacings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Pairwise {
    /// Which correspondences are kept.
    pub keep: Keep,
    /// The least share that may be kept.
    pub least_share: f64,
    /// Edge of the voxels to which the moved scan is thinned.
    pub query_edge: f64,
    /// Fits at most.
    pub max_iterations: usize,
    /// A step that moves no point farther ends it.
    pub min_step: f64,
    /// A point with another nearer than this has a counterpart, in the overlaps of the report.
    pub tolerance: f64,
}

/// The number of scans that these methods take.
pub const SCANS: usize = 2;

impl Pairwise {
    /// Plain ICP.
    pub const ICP: Pairwise = Pairwise {
        keep: Keep::All,
        least_share: 1.0,
        query_edge: 1.5,
        max_iterations: 200,
        min_step: 0.001,
        tolerance: 2.0,
    };
    /// Trimmed ICP.
    pub const TRICP: Pairwise = Pairwise { keep: Keep::Search, least_share: 0.4, ..Pairwise::ICP };

    /// Moves the second of two views onto the first. With other numbers of views the others keep their initial pose and
    /// are not placed; callers refuse them before.
    pub fn register(&self, views: &[View], initial: &[Motion], progress: &Progress) -> Result<Outcome, Canceled> {
        let mut state = Outcome::at(initial);
        state.placed.fill(false);
        let [target, source, ..] = views else { return Ok(state) };
        let spacing = common_spacing(views);
        progress.report(Stage::Registering, 0.0);
        let options = IcpOptions {
            trim: match self.keep {
                Keep::All => Trim::Share(1.0),
                Keep::Search => Trim::Search { least: self.least_share },
            },
            max_distance: f64::INFINITY,
            threshold: 0.0,
            max_iterations: self.max_iterations,
            min_step: self.min_step * spacing,
        };
        let queries = source.sampled(self.query_edge * spacing);
        let start = initial[0].inv_mul(&initial[1]);
        let icp = trimmed_icp(&target.indexed, &queries, &start, &options, progress)?;
        state.local_poses[1] = initial[0] * icp.motion;
        let joined = icp.end != IcpEnd::NoCorrespondences;
        (state.placed[0], state.placed[1]) = (true, joined);
        state.rounds.push(Round {
            level: 0,
            tolerance: self.tolerance * spacing,
            pairs: 1,
            min_overlap: 0.0,
            icp_iterations: icp.iterations,
            averaging_rounds: 0,
            rotation_change: largest_turn(initial, &state.local_poses),
        });
        state.pairs = vec![PairOutcome::by_icp(0, 1, &icp, None)];
        let targets: Vec<&IndexedPoints> = views.iter().map(|view| &view.indexed).collect();
        let samples: Vec<Vec<LocalPoint>> = views.par_iter().map(|v| v.sampled(self.query_edge * spacing)).collect();
        let samples: Vec<&[LocalPoint]> = samples.iter().map(Vec::as_slice).collect();
        state.overlaps = overlaps(&targets, &samples, &state.local_poses, self.tolerance * spacing, progress)?;
        Ok(state)
    }
}
