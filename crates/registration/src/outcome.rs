//! What a registration leaves behind, whatever method made it: poses, the pairs that were registered, and what each round did.

use crate::joint::surfels::FineSurfels;
use crate::overlap::OverlapMatrix;
use crate::pairwise::trimmed_icp::{IcpEnd, IcpResult};
use visage_geometry::{Motion, se3};

/// What the caller may set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodOptions {
    /// xi_0: pairs with a smaller mutual overlap are not registered, unless the views would fall into pieces.
    pub min_overlap: f64,
    /// R_e in the scans' unit; each view's own estimate when absent.
    pub range_accuracy: Option<f64>,
    /// Rounds at most, on each level.
    pub max_rounds: usize,
}

impl Default for MethodOptions {
    fn default() -> Self {
        MethodOptions { min_overlap: 0.5, range_accuracy: None, max_rounds: 20 }
    }
}

/// One registered pair of the last round.
#[derive(Debug, Clone, PartialEq)]
pub struct PairOutcome {
    /// The target view.
    pub i: usize,
    /// The view that is mapped.
    pub j: usize,
    /// Maps the local frame of view j into that of view i.
    pub i_from_j: Motion,
    /// Points of view j that have a counterpart in view i.
    pub correspondences: usize,
    /// Their mean squared distance, a squared length; infinite without any.
    pub mean_distance2: f64,
    /// How ICP of this pair by itself went; `None` if it was refined together with all others.
    pub icp: Option<PairIcp>,
    /// How far the pair disagrees with the averaged poses, a length.
    pub disagreement: f64,
    /// Robust weight in averaging, in (0, 1].
    pub trust: f64,
}

/// How ICP of a pair went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairIcp {
    /// Fits made.
    pub iterations: usize,
    /// How it ended.
    pub end: IcpEnd,
    /// The threshold it ran with, a squared length; `None` if no threshold was to end it.
    pub threshold: Option<f64>,
}

impl PairOutcome {
    /// A pair of which only the relative motion is known (local frame of j to local frame of i).
    pub(crate) fn unmeasured(i: usize, j: usize, i_from_j: Motion) -> Self {
        PairOutcome {
            i,
            j,
            i_from_j,
            correspondences: 0,
            mean_distance2: f64::INFINITY,
            icp: None,
            disagreement: 0.0,
            trust: 1.0,
        }
    }

    /// A pair that ICP registered by itself.
    pub(crate) fn by_icp(i: usize, j: usize, found: &IcpResult, threshold: Option<f64>) -> Self {
        PairOutcome {
            icp: Some(PairIcp { iterations: found.iterations, end: found.end, threshold }),
            ..PairOutcome::unmeasured(i, j, found.motion).measured(found)
        }
    }

    /// The pair with the correspondences that were found for it.
    pub(crate) fn measured(self, found: &IcpResult) -> Self {
        PairOutcome { correspondences: found.correspondences, mean_distance2: found.mean_distance2, ..self }
    }
}

/// What one round did.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Round {
    /// Index into the method's levels.
    pub level: usize,
    /// Overlap tolerance, a length.
    pub tolerance: f64,
    /// Pairs registered.
    pub pairs: usize,
    /// The overlap a pair had to exceed in the end.
    pub min_overlap: f64,
    /// ICP fits over all pairs.
    pub icp_iterations: usize,
    /// Linear solves of averaging, steps of the decomposition, or Gauss-Newton steps of `joint`; 0 if the motions could
    /// not be made to agree, and the poses stayed as they were.
    pub averaging_rounds: usize,
    /// e^k: the largest change of a view's rotation, radians.
    pub rotation_change: f64,
}

/// Registered views.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Local frame to world.
    pub local_poses: Vec<Motion>,
    /// The poses that refinement began with, in the same frames.
    pub initial: Vec<Motion>,
    /// For each view whether it hangs together with view 0.
    pub placed: Vec<bool>,
    /// Overlaps at the last round's start.
    pub overlaps: OverlapMatrix,
    /// The pairs of the last round.
    pub pairs: Vec<PairOutcome>,
    /// All rounds.
    pub rounds: Vec<Round>,
    /// The finest surfels, if the method made any: the evidence for the poses is read off them.
    pub surfels: Option<FineSurfels>,
}

impl Outcome {
    /// `n` views of which none hangs together with another; the first is where it is.
    pub(crate) fn alone(n: usize) -> Self {
        Outcome { placed: (0..n).map(|view| view == 0).collect(), ..Outcome::at(&vec![Motion::identity(); n]) }
    }

    /// Nothing done yet.
    pub(crate) fn at(initial: &[Motion]) -> Self {
        Outcome {
            local_poses: initial.to_vec(),
            initial: initial.to_vec(),
            placed: vec![true; initial.len()],
            overlaps: OverlapMatrix::identity(initial.len()),
            pairs: Vec::new(),
            rounds: Vec::new(),
            surfels: None,
        }
    }

    /// The motion in the world that takes a view from its pose back to where refinement began with it.
    pub fn initial_from_final(&self, view: usize) -> Motion {
        self.initial[view] * self.local_poses[view].inverse()
    }
}

/// The view that keeps its pose in each connected piece: the first.
pub(crate) fn first_of_each_piece(pieces: &[usize]) -> Vec<usize> {
    (0..pieces.len()).filter(|&view| !pieces[..view].contains(&pieces[view])).collect()
}

/// e^k of Algorithm 1: the largest angle between a view's rotation before and after, radians.
pub(crate) fn largest_turn(before: &[Motion], after: &[Motion]) -> f64 {
    let angles = before.iter().zip(after).map(|(a, b)| se3::rotation_angle(&a.rotation.rotation_to(&b.rotation)));
    angles.fold(0.0, f64::max)
}
