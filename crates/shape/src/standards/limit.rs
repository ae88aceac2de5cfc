//! Which residual is still of the class: learned from examples that the user marks.

/// The limit of a class without examples, mm on the standard: that of the built-in face.
pub const DEFAULT_LIMIT_MM: f64 = crate::faces::judgement::RESIDUAL_AT_HALF_MM;
/// What stands for the residual of a model on which no place was worth a closer look, mm on the standard: more than any
/// fit can have.
pub const NOTHING_FOUND_MM: f64 = 20.0;
/// Learned limits stay within this range: below, noise decides; above, the surface is not there.
const LIMITS_MM: std::ops::RangeInclusive<f64> = 0.5..=8.0;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// With examples of one kind alone the limit keeps this factor from the nearest of them.
        margin: f64 = 1.2,
        /// How fast the score falls where the residual grows by the limit: the face's slope, free of scale.
        slope: f64 = 9.25,
    }
}

/// Where a class ends, and what that rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// Models with a lower residual are of the class, mm on the standard.
    pub limit_mm: f64,
    /// How many examples of the class it rests on.
    pub positives: usize,
    /// How many examples of other things.
    pub negatives: usize,
    /// How well the residual tells the two apart: the share of pairs in the right order; `None` without such pairs.
    pub auc: Option<f64>,
    /// Of so many examples, so many are judged rightly by the limit that the others give.
    pub leave_one_out: Option<LeaveOneOut>,
}

/// How the procedure does on examples it has not seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LeaveOneOut {
    /// Examples judged rightly.
    pub right: usize,
    /// Examples in all.
    pub of: usize,
}

/// Learns the limit from the residuals of examples (mm on the standard).
///
/// The limit is the middle, in the logarithm, of the gap between the worst positive and the best negative example. Where
/// they overlap it is the middle of the gap that leaves the fewest on the wrong side, by the sum of both error rates, and
/// of equals the widest. With examples of one kind alone it is the default, moved until it has 20 % to the nearest
/// example.
pub fn learn(positives: &[f64], negatives: &[f64]) -> Learned {
    Learned {
        limit_mm: limit(positives, negatives),
        positives: positives.len(),
        negatives: negatives.len(),
        auc: auc(positives, negatives),
        leave_one_out: leave_one_out(positives, negatives),
    }
}

impl Learned {
    /// How surely a model with this residual is of the class, in [0, 1]: 0.5 at the limit.
    pub fn score(&self, residual_mm: f64) -> f64 {
        1.0 / (1.0 + (TUNING.slope * (residual_mm / self.limit_mm - 1.0)).exp())
    }
}

fn limit(positives: &[f64], negatives: &[f64]) -> f64 {
    let worst = positives.iter().copied().reduce(f64::max);
    let best = negatives.iter().copied().reduce(f64::min);
    let limit = match (worst, best) {
        (None, None) => DEFAULT_LIMIT_MM,
        (Some(worst), None) => DEFAULT_LIMIT_MM.max(TUNING.margin * worst),
        (None, Some(best)) => DEFAULT_LIMIT_MM.min(best / TUNING.margin),
        (Some(worst), Some(best)) if worst < best => (worst * best).sqrt(),
        (Some(_), Some(_)) => least_errors(positives, negatives),
    };
    limit.clamp(*LIMITS_MM.start(), *LIMITS_MM.end())
}

/// The middle of the gap between neighbouring residuals that leaves the fewest on the wrong side.
fn least_errors(positives: &[f64], negatives: &[f64]) -> f64 {
    let mut all: Vec<f64> = positives.iter().chain(negatives).map(|r| r.max(1e-6)).collect();
    all.sort_by(f64::total_cmp);
    let share = |list: &[f64], wrong: &dyn Fn(f64) -> bool| {
        list.iter().filter(|r| wrong(**r)).count() as f64 / list.len().max(1) as f64
    };
    let gaps = all.windows(2).map(|pair| {
        let limit = (pair[0] * pair[1]).sqrt();
        let errors = share(positives, &|r| r >= limit) + share(negatives, &|r| r < limit);
        (errors, -(pair[1] / pair[0]).ln(), limit)
    });
    let order = |a: &(f64, f64, f64), b: &(f64, f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
    gaps.min_by(order).map_or(DEFAULT_LIMIT_MM, |(_, _, limit)| limit)
}

/// The share of pairs of a positive and a negative example in the right order; a tie counts half.
pub fn auc(positives: &[f64], negatives: &[f64]) -> Option<f64> {
    let pairs = (positives.len() * negatives.len()) as f64;
    let order = |p: f64, n: f64| if p < n { 1.0 } else { 0.5 * f64::from(u8::from(p == n)) };
    let right: f64 = positives.iter().flat_map(|p| negatives.iter().map(move |n| order(*p, *n))).sum();
    (pairs > 0.0).then(|| right / pairs)
}

fn leave_one_out(positives: &[f64], negatives: &[f64]) -> Option<LeaveOneOut> {
    if positives.is_empty() || negatives.is_empty() {
        return None;
    }
    let without = |list: &[f64], left_out: usize| -> Vec<f64> {
        list.iter().enumerate().filter(|(k, _)| *k != left_out).map(|(_, r)| *r).collect()
    };
    let found = (0..positives.len()).filter(|&k| positives[k] < limit(&without(positives, k), negatives)).count();
    let refused = (0..negatives.len()).filter(|&k| negatives[k] >= limit(positives, &without(negatives, k))).count();
    Some(LeaveOneOut { right: found + refused, of: positives.len() + negatives.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_examples_it_is_the_default() {
        let learned = learn(&[], &[]);
        assert_eq!((learned.limit_mm, learned.auc, learned.leave_one_out), (DEFAULT_LIMIT_MM, None, None));
        assert_eq!(learned.score(DEFAULT_LIMIT_MM), 0.5);
        assert!(learned.score(0.8) > 0.99 && learned.score(NOTHING_FOUND_MM) < 1e-9);
    }

    #[test]
    fn one_kind_alone_moves_it_only_as_far_as_needed() {
        assert_eq!(learn(&[1.0], &[]).limit_mm, DEFAULT_LIMIT_MM);
        assert!((learn(&[4.0], &[]).limit_mm - 4.8).abs() < 1e-12);
        assert_eq!(learn(&[], &[9.0]).limit_mm, DEFAULT_LIMIT_MM);
        assert!((learn(&[], &[1.2]).limit_mm - 1.0).abs() < 1e-12);
    }

    #[test]
    fn both_kinds_part_in_the_middle_of_the_logarithms() {
        let learned = learn(&[1.0, 2.0], &[8.0, NOTHING_FOUND_MM]);
        assert!((learned.limit_mm - 4.0).abs() < 1e-12);
        assert_eq!(learned.auc, Some(1.0));
        assert_eq!(learned.leave_one_out, Some(LeaveOneOut { right: 4, of: 4 }));
    }

    #[test]
    fn where_they_overlap_the_fewest_are_wrong() {
        let learned = learn(&[1.0, 1.1, 1.2, 6.0], &[3.0, 3.1, 3.2, 3.3]);
        assert!((1.2..3.0).contains(&learned.limit_mm), "{learned:?}");
        assert_eq!(learned.auc, Some(0.75));
        assert_eq!(learned.leave_one_out, Some(LeaveOneOut { right: 7, of: 8 }));
        assert_eq!(auc(&[1.0], &[1.0]), Some(0.5));
    }

    #[test]
    fn a_limit_stays_in_its_range() {
        assert_eq!(learn(&[0.0], &[0.1]).limit_mm, *LIMITS_MM.start());
        assert_eq!(learn(&[15.0], &[19.0]).limit_mm, *LIMITS_MM.end());
    }
}
