//! How well scores tell two classes apart, and how well a ranking brings one class to its front.
//!
//! Two classes: ROC, its area with a bootstrap interval, the equal error rate. Rankings: nearest neighbour, first and
//! second tier, discounted cumulative gain as in Shilane et al. 2004 (the Princeton Shape Benchmark), average precision.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A point of the ROC curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RocPoint {
    /// Scores from this on count as positive.
    pub threshold: f64,
    /// Share of the positives found.
    pub true_positive_rate: f64,
    /// Share of the negatives taken for positives.
    pub false_positive_rate: f64,
}

/// The area under the ROC curve: the chance that a positive scores higher than a negative, ties counting half
/// (Mann-Whitney). `None` if either class is empty.
pub fn auc(positives: &[f64], negatives: &[f64]) -> Option<f64> {
    if positives.is_empty() || negatives.is_empty() {
        return None;
    }
    let mut sorted = negatives.to_vec();
    sorted.sort_by(f64::total_cmp);
    let wins: f64 = positives
        .iter()
        .map(|p| {
            let below = sorted.partition_point(|n| n < p);
            let not_above = sorted.partition_point(|n| n <= p);
            0.5 * (below + not_above) as f64
        })
        .sum();
    Some(wins / (positives.len() as f64 * negatives.len() as f64))
}

/// The ROC curve, from the strictest threshold to the laxest: one point a distinct score.
pub fn roc(positives: &[f64], negatives: &[f64]) -> Vec<RocPoint> {
    let mut scores: Vec<(f64, bool)> =
        positives.iter().map(|&s| (s, true)).chain(negatives.iter().map(|&s| (s, false))).collect();
    scores.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut found, mut wrong) = (0usize, 0usize);
    let share = |count: usize, of: usize| if of == 0 { 0.0 } else { count as f64 / of as f64 };
    let mut curve = Vec::new();
    for group in scores.chunk_by(|a, b| a.0 == b.0) {
        found += group.iter().filter(|(_, positive)| *positive).count();
        wrong += group.iter().filter(|(_, positive)| !*positive).count();
        curve.push(RocPoint {
            threshold: group[0].0,
            true_positive_rate: share(found, positives.len()),
            false_positive_rate: share(wrong, negatives.len()),
        });
    }
    curve
}

/// The threshold with the highest accuracy and that accuracy; the strictest of equals. `None` without scores.
pub fn best_accuracy(positives: &[f64], negatives: &[f64]) -> Option<(f64, f64)> {
    let total = (positives.len() + negatives.len()) as f64;
    roc(positives, negatives)
        .into_iter()
        .map(|point| {
            let right = point.true_positive_rate * positives.len() as f64
                + (1.0 - point.false_positive_rate) * negatives.len() as f64;
            (point.threshold, right / total)
        })
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
}

/// The error rate at which as many positives are missed as negatives are taken for positives, by linear
/// interpolation on the ROC curve; `None` if either class is empty.
pub fn equal_error_rate(positives: &[f64], negatives: &[f64]) -> Option<f64> {
    if positives.is_empty() || negatives.is_empty() {
        return None;
    }
    let (mut wrong, mut missed) = (0.0, 1.0);
    for point in roc(positives, negatives) {
        let (next_wrong, next_missed) = (point.false_positive_rate, 1.0 - point.true_positive_rate);
        if next_wrong >= next_missed {
            // along the segment the two run towards each other
            let (gap, closed) = (missed - wrong, (missed - wrong) + (next_wrong - next_missed));
            let share = if closed > 0.0 { gap / closed } else { 0.0 };
            return Some(wrong + share * (next_wrong - wrong));
        }
        (wrong, missed) = (next_wrong, next_missed);
    }
    None
}

/// An interval that holds the area under the ROC curve with the given confidence: percentiles of the areas of
/// `resamples` bootstrap samples, drawn from each class by itself. The same seed gives the same bits.
pub fn auc_interval(
    positives: &[f64],
    negatives: &[f64],
    confidence: f64,
    resamples: usize,
    seed: u64,
) -> Option<[f64; 2]> {
    if positives.is_empty() || negatives.is_empty() || resamples == 0 {
        return None;
    }
    // scores as ranks among all: a resample is then two lists of counts, and needs no sorting
    let mut all: Vec<f64> = positives.iter().chain(negatives).copied().collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    let ranks = |scores: &[f64]| scores.iter().map(|s| all.partition_point(|x| x < s)).collect::<Vec<_>>();
    let (positives, negatives) = (ranks(positives), ranks(negatives));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut drawn = |of: &[usize]| {
        let mut counts = vec![0u32; all.len()];
        for _ in 0..of.len() {
            counts[of[rng.random_range(0..of.len())]] += 1;
        }
        counts
    };
    let pairs = (positives.len() * negatives.len()) as f64;
    let mut areas: Vec<f64> = (0..resamples)
        .map(|_| {
            let (found, wrong) = (drawn(&positives), drawn(&negatives));
            let mut below = 0.0;
            let wins = found.iter().zip(&wrong).map(|(&p, &n)| {
                let won = f64::from(p) * (below + 0.5 * f64::from(n));
                below += f64::from(n);
                won
            });
            wins.sum::<f64>() / pairs
        })
        .collect();
    areas.sort_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - confidence.clamp(0.0, 1.0));
    let at = |share: f64| areas[(share * (resamples - 1) as f64).round() as usize];
    Some([at(tail), at(1.0 - tail)])
}

/// How well one probe's ranking brings its class to the front; each figure in [0, 1], high is good.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RankingMeasures {
    /// Whether the first is of the class.
    pub nearest_neighbour: f64,
    /// Of the class's C others, the share among the first C.
    pub first_tier: f64,
    /// The same among the first 2 C.
    pub second_tier: f64,
    /// Members count 1 / log2 of their place (1 for the first two), relative to the best ranking there is.
    pub discounted_cumulative_gain: f64,
    /// The mean precision at the members' places.
    pub average_precision: f64,
}

impl RankingMeasures {
    /// Of a ranking of all but the probe: for each place whether its model is of the probe's class. `None` if no
    /// other model is.
    pub fn of(ranking: &[bool]) -> Option<RankingMeasures> {
        let members = ranking.iter().filter(|is_member| **is_member).count();
        if members == 0 {
            return None;
        }
        let among = |first: usize| ranking.iter().take(first).filter(|m| **m).count() as f64 / members as f64;
        let gain = |place: usize| 1.0 / (place.max(2) as f64).log2();
        let (mut found, mut precisions, mut gains) = (0.0, 0.0, 0.0);
        for (index, _) in ranking.iter().enumerate().filter(|(_, is_member)| **is_member) {
            found += 1.0;
            precisions += found / (index + 1) as f64;
            gains += gain(index + 1);
        }
        Some(RankingMeasures {
            nearest_neighbour: f64::from(u8::from(ranking[0])),
            first_tier: among(members),
            second_tier: among(2 * members),
            discounted_cumulative_gain: gains / (1..=members).map(gain).sum::<f64>(),
            average_precision: precisions / members as f64,
        })
    }

    /// The means of many; `None` of none.
    pub fn mean(all: &[RankingMeasures]) -> Option<RankingMeasures> {
        let mean = |figure: fn(&RankingMeasures) -> f64| all.iter().map(figure).sum::<f64>() / all.len() as f64;
        (!all.is_empty()).then(|| RankingMeasures {
            nearest_neighbour: mean(|m| m.nearest_neighbour),
            first_tier: mean(|m| m.first_tier),
            second_tier: mean(|m| m.second_tier),
            discounted_cumulative_gain: mean(|m| m.discounted_cumulative_gain),
            average_precision: mean(|m| m.average_precision),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_perfect_and_a_useless_ranking() {
        assert_eq!(auc(&[0.9, 0.8], &[0.1, 0.2]), Some(1.0));
        assert_eq!(auc(&[0.1], &[0.9]), Some(0.0));
        assert_eq!(auc(&[0.5, 0.5], &[0.5]), Some(0.5));
        assert_eq!(auc(&[], &[0.5]), None);
    }

    proptest! {
        #[test]
        fn the_area_under_the_curve_is_the_chance_to_win(
            positives in prop::collection::vec(0..20i32, 1..30), negatives in prop::collection::vec(0..20i32, 1..30),
        ) {
            let [positives, negatives] = [positives, negatives].map(|v| v.into_iter().map(f64::from).collect::<Vec<_>>());
            let (mut area, mut last) = (0.0, (0.0, 0.0));
            for point in roc(&positives, &negatives) {
                let next = (point.false_positive_rate, point.true_positive_rate);
                area += (next.0 - last.0) * 0.5 * (next.1 + last.1);
                last = next;
            }
            prop_assert_eq!(last, (1.0, 1.0));
            let expected = auc(&positives, &negatives).expect("both classes have members");
            prop_assert!((area - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn the_best_threshold_splits_most() {
        assert_eq!(best_accuracy(&[0.9, 0.7, 0.2], &[0.1, 0.3]), Some((0.7, 0.8)));
    }

    #[test]
    fn the_equal_error_rate_is_where_both_errors_meet() {
        assert_eq!(equal_error_rate(&[0.9, 0.8], &[0.1, 0.2]), Some(0.0));
        assert_eq!(equal_error_rate(&[0.1], &[0.9]), Some(1.0));
        assert_eq!(equal_error_rate(&[0.5], &[0.5]), Some(0.5));
        assert_eq!(equal_error_rate(&[0.9, 0.8, 0.7, 0.2], &[0.6, 0.3, 0.1, 0.05]), Some(0.25));
        assert_eq!(equal_error_rate(&[], &[0.9]), None);
        // from (0, 2/3) to (1/2, 1/3) the two errors meet at 4/5 of the way
        let rate = equal_error_rate(&[0.9, 0.5, 0.1], &[0.5, 0.05]).expect("both classes have members");
        assert!((rate - 0.4).abs() < 1e-12, "{rate}");
    }

    /// The area of one resample by comparing all pairs.
    fn pairs_won(positives: &[f64], negatives: &[f64]) -> f64 {
        let won = |p: f64, n: f64| if p > n { 1.0 } else { 0.5 * f64::from(u8::from(p == n)) };
        let wins: f64 = positives.iter().flat_map(|p| negatives.iter().map(move |n| won(*p, *n))).sum();
        wins / (positives.len() * negatives.len()) as f64
    }

    #[test]
    fn the_interval_is_that_of_brute_force_with_the_same_draws() {
        let positives: Vec<f64> = (0..23).map(|k| f64::from(k * k % 17) / 10.0 + 0.3).collect();
        let negatives: Vec<f64> = (0..31).map(|k| f64::from(k * 7 % 19) / 12.0).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut drawn = |of: &[f64]| (0..of.len()).map(|_| of[rng.random_range(0..of.len())]).collect::<Vec<_>>();
        let mut areas: Vec<f64> = (0..201)
            .map(|_| {
                let (p, n) = (drawn(&positives), drawn(&negatives));
                pairs_won(&p, &n)
            })
            .collect();
        areas.sort_by(f64::total_cmp);
        let [low, high] = auc_interval(&positives, &negatives, 0.95, 201, 5).expect("both classes have members");
        assert!((low - areas[5]).abs() < 1e-12 && (high - areas[195]).abs() < 1e-12);
        let area = auc(&positives, &negatives).expect("both classes have members");
        assert!(low < area && area < high && (area - pairs_won(&positives, &negatives)).abs() < 1e-12);
        assert_eq!(auc_interval(&[1.0; 5], &[0.0; 5], 0.95, 50, 1), Some([1.0, 1.0]));
        assert_eq!(auc_interval(&[], &negatives, 0.95, 50, 1), None);
    }

    #[test]
    fn a_ranking_is_measured_as_the_benchmark_says() {
        // members at places 1, 4 and 5 of 7: C = 3
        let measures = RankingMeasures::of(&[true, false, false, true, true, false, false]).expect("it has members");
        assert_eq!(measures.nearest_neighbour, 1.0);
        assert!((measures.first_tier - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(measures.second_tier, 1.0);
        let best = 1.0 + 1.0 + 1.0 / 3f64.log2();
        let gain = (1.0 + 1.0 / 4f64.log2() + 1.0 / 5f64.log2()) / best;
        assert!((measures.discounted_cumulative_gain - gain).abs() < 1e-12);
        assert!((measures.average_precision - (1.0 + 2.0 / 4.0 + 3.0 / 5.0) / 3.0).abs() < 1e-12);
        assert_eq!(RankingMeasures::of(&[false; 4]), None);
    }

    #[test]
    fn the_best_ranking_scores_one_everywhere() {
        let best = RankingMeasures::of(&[true, true, true, false, false]).expect("it has members");
        let worst = RankingMeasures::of(&[false, false, false, false, true]).expect("it has members");
        let mean = RankingMeasures::mean(&[best, worst]).expect("there are two");
        for figure in [best.nearest_neighbour, best.first_tier, best.second_tier, best.average_precision] {
            assert_eq!(figure, 1.0);
        }
        assert_eq!((best.discounted_cumulative_gain, mean.nearest_neighbour), (1.0, 0.5));
        assert!((mean.average_precision - 0.6).abs() < 1e-12);
        assert_eq!(RankingMeasures::mean(&[]), None);
    }
}
