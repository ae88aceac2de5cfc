//! How well a ranking tells two classes apart.

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
}
