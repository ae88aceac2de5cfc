//! A set of views as global registration sees it, and the noise by which its hypotheses are measured.

use super::coarse_view::CoarseView;
use super::pair_hypothesis::PairHypothesis;
use super::votes::SurfelVotes;
use crate::view::View;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Distances up to this many times the set's noise are nothing to wonder at.
        tolerated_noise: f64 = 1.6,
        /// Noise below this, in edges, is that of sampling.
        least_noise: f64 = 0.012,
        /// Surfaces that are the same lie within so many root mean squares of their distance.
        within: f64 = 2.0,
        /// A hypothesis says something of the noise from this score on.
        telling: f64 = 0.1,
    }
}

/// What the views of a set are, coarse and fine.
#[derive(Debug, Clone, Copy)]
pub struct CoarseSet<'a> {
    /// The views at full resolution,
    pub views: &'a [View],
    /// and their coarse views.
    pub coarse_views: &'a [CoarseView],
    /// What the set can resolve: lengths by which surfaces at full resolution are compared. See [`resolution`].
    pub resolution: f64,
    /// Edge of the surfels' voxels.
    pub edge: f64,
    /// Root mean square distance, in edges, of surfaces that are the same: the set's own level of noise.
    pub noise: f64,
}

impl CoarseSet<'_> {
    /// How much speaks for a hypothesis in this set: surfaces that are the same lie as near to each other as the noise lets
    /// them, like ones do not.
    pub fn score(&self, hypothesis: &PairHypothesis) -> f64 {
        let votes = hypothesis.evidence.both();
        SurfelVotes { agree: votes.agree / self.excess(&votes), ..votes }.score()
    }

    /// The mean square distance of surfels that agree, in what the set's noise explains; 1 if that explains it.
    pub fn excess(&self, votes: &SurfelVotes) -> f64 {
        let excess = votes.rms() / (self.edge * TUNING.tolerated_noise * self.noise);
        (excess * excess).max(1.0)
    }
}

/// What scans can resolve: the larger of their spacing and of how far apart surfaces lie that are the same. Depth cameras
/// sample far more finely than they measure.
pub fn resolution(spacing: f64, noise: f64, edge: f64) -> f64 {
    spacing.max(TUNING.within * noise * edge)
}

/// The noise of a set by its hypotheses, in edges: for most views one of its hypotheses is right, and a right one lies nearer than
/// wrong ones do.
pub fn noise_level(hypotheses: &[PairHypothesis], edge: f64) -> f64 {
    let mut nearest: std::collections::BTreeMap<usize, f64> = std::collections::BTreeMap::new();
    for hypothesis in hypotheses.iter().filter(|hypothesis| hypothesis.score() > TUNING.telling) {
        for view in [hypothesis.i, hypothesis.j] {
            let rms = nearest.entry(view).or_insert(f64::INFINITY);
            *rms = rms.min(hypothesis.evidence.both().rms() / edge);
        }
    }
    let mut levels: Vec<f64> = nearest.into_values().collect();
    levels.sort_by(f64::total_cmp);
    levels.get(levels.len() / 2).copied().unwrap_or(0.0).max(TUNING.least_noise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};
    use visage_geometry::Motion;

    #[test]
    fn noise_is_that_of_the_nearest_hypotheses() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let right = fixture.right(0, 1);
        let beside = fixture.hypothesis(0, 1, fixture.i_from_j_off(0, 1, [0.25 * EDGE, 0.0, 0.0], [0.0; 3]));
        let of_right = noise_level(&[right], EDGE);
        assert!(noise_level(&[beside], EDGE) > 2.0 * of_right);
        assert_eq!(noise_level(&[beside, right], EDGE), of_right);
        let wrong = fixture.hypothesis(0, 1, Motion::translation(0.0, 0.0, 500.0));
        assert_eq!(noise_level(&[wrong], EDGE), TUNING.least_noise, "what says nothing says nothing of noise");
    }

    #[test]
    fn surfaces_farther_apart_than_the_noise_count_less() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let beside = fixture.hypothesis(0, 1, fixture.i_from_j_off(0, 1, [0.2 * EDGE, 0.0, 0.0], [0.0; 3]));
        let calm = CoarseSet { noise: 0.01, ..fixture.coarse_set() };
        let noisy = CoarseSet { noise: 0.3, ..fixture.coarse_set() };
        assert_eq!(noisy.excess(&beside.evidence.both()), 1.0);
        assert!(calm.score(&beside) < noisy.score(&beside) && noisy.score(&beside) == beside.score());
    }

    #[test]
    fn a_set_resolves_no_more_than_its_spacing_and_its_noise() {
        assert_eq!(resolution(1.0, 0.01, 3.0), 1.0);
        assert!((resolution(1.0, 0.5, 3.0) - 3.0).abs() < 1e-12);
    }
}
