//! A pair of views and a way to lay them on each other.

use super::verification::PairVotes;
use visage_geometry::Motion;

/// A way to lay two views on each other, refined on the surface and asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairHypothesis {
    /// The view whose frame is the target.
    pub i: usize,
    /// The view that is mapped.
    pub j: usize,
    /// Maps the local frame of view j into that of view i.
    pub i_from_j: Motion,
    /// What the surfaces say.
    pub evidence: PairVotes,
}

visage_geometry::tuning! {
    /// What makes a hypothesis worth trying.
    pub(super) const TUNING: Tuning {
        /// This share of agreeing surfels,
        least_overlap: f64 = 0.08,
        /// and this share of agreement among all that was said.
        least_consistency: f64 = 0.6,
    }
}

impl PairHypothesis {
    /// How much speaks for it; see [`super::votes`].
    pub fn score(&self) -> f64 {
        self.evidence.both().score()
    }

    /// Whether it is worth trying.
    pub fn is_promising(&self) -> bool {
        self.evidence.overlap() >= TUNING.least_overlap
            && self.evidence.both().consistency() >= TUNING.least_consistency
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::votes::SurfelVotes;

    #[test]
    fn what_overlaps_and_is_consistent_is_worth_trying() {
        let hypothesis = |agree: f64, contradict: f64| {
            let votes = SurfelVotes { queried: 100.0, agree, contradict, ..SurfelVotes::default() };
            let evidence = PairVotes { j_in_i: votes, i_in_j: votes };
            PairHypothesis { i: 0, j: 1, i_from_j: Motion::identity(), evidence }
        };
        assert!(hypothesis(30.0, 5.0).is_promising());
        assert!(!hypothesis(5.0, 0.0).is_promising(), "hardly any overlap");
        assert!(!hypothesis(30.0, 30.0).is_promising(), "as much against it");
        assert!((hypothesis(30.0, 5.0).score() - 0.25).abs() < 1e-12);
    }
}
