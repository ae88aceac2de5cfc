//! What a join of two components has to rest on.

use super::coarse_set::CoarseSet;
use super::pair_hypothesis::PairHypothesis;

/// What a join rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeEvidence {
    /// Scores of all pairs between the components, added.
    pub score: f64,
    /// The best pair's.
    pub best: f64,
    /// Score of the best other way to lay the components on each other, in that of this one.
    pub rival: f64,
    /// Of the points of the best pairs that come near each other, the share that touches at full resolution.
    pub touching: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Components are joined if the best pair scores this,
        strong: f64 = 0.16,
        /// or all together score this, with one that is not weak.
        strong_together: f64 = 0.32,
        /// A pair is not weak from this score on.
        not_weak: f64 = 0.1,
    }
}

impl MergeEvidence {
    /// Adds up what all pairs say.
    pub fn of(coarse_set: &CoarseSet, measured: &[PairHypothesis]) -> Self {
        let scores = measured.iter().map(|hypothesis| coarse_set.score(hypothesis));
        MergeEvidence { score: scores.clone().sum(), best: scores.fold(0.0, f64::max), rival: 0.0, touching: 0.0 }
    }

    /// Whether they are enough to join two components.
    pub fn suffice(&self) -> bool {
        is_strong(self.best) || (self.score >= TUNING.strong_together && self.best >= TUNING.not_weak)
    }
}

/// Whether a pair of this score is enough by itself.
pub fn is_strong(score: f64) -> bool {
    score >= TUNING.strong
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_strong_pair_or_several_that_are_not_weak_are_enough() {
        let evidence = |score, best| MergeEvidence { score, best, rival: 0.0, touching: 1.0 };
        assert!(evidence(0.2, 0.2).suffice());
        assert!(!evidence(0.12, 0.12).suffice(), "one that is not strong");
        assert!(evidence(0.4, 0.12).suffice());
        assert!(!evidence(0.4, 0.05).suffice(), "many weak ones");
    }
}
