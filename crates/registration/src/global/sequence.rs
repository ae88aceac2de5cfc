//! What the order of the scans says: who carries a scanner through a building takes scans in an order in which
//! neighbours overlap. Whether these were is read off the set itself: views near each other in the order are linked
//! more often than others. Where that is beyond chance, pairs near each other come first.

use std::collections::HashMap;

use super::coarse_set::CoarseSet;
use super::consensus::alike;
use super::merge_evidence;
use super::pair_hypothesis::PairHypothesis;
use visage_geometry::Motion;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// By this factor the links of neighbours have to be likelier by their own rate than by that of all pairs: a
        /// dozen scans and fewer say too little.
        beyond_chance: f64 = 1e6,
        /// Views are near each other in the order as far as this share of pairs so many places apart is linked. What
        /// overlaps by chance, or only seems to, is not four in five.
        near: f64 = 0.8,
        /// A way over a third view leads to the same place within so many edges.
        same: f64 = 2.0,
    }
}

/// How far the order of a set's views tells which overlap.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sequence {
    /// Views at most so many places apart are near each other; 0 where the order says nothing.
    reach: usize,
}

impl Sequence {
    /// Of `count` views, by which pairs (i < j) of them are linked.
    pub fn of(count: usize, is_linked: impl Fn(usize, usize) -> bool) -> Self {
        let linked = |gap: usize| (gap..count).filter(|j| is_linked(j - gap, *j)).count() as f64;
        let all: f64 = (1..count).map(linked).sum();
        let rate_of_all = all / (count * count.saturating_sub(1) / 2).max(1) as f64;
        let neighbours = count.saturating_sub(1) as f64;
        let rate = linked(1) / neighbours.max(1.0);
        if rate <= rate_of_all || neighbours * divergence(rate, rate_of_all) < TUNING.beyond_chance.ln() {
            return Sequence::default();
        }
        let is_near = |gap: &usize| linked(*gap) >= TUNING.near * (count - gap) as f64;
        Sequence { reach: (1..count).take_while(is_near).count() }
    }

    /// Whether two views are near each other in an order that says something.
    pub fn is_near(&self, i: usize, j: usize) -> bool {
        i.abs_diff(j) <= self.reach
    }
}

/// A hypothesis, and what speaks for it before components are looked at.
#[derive(Debug, Clone, Copy)]
pub struct Candidate<'a> {
    /// The hypothesis.
    pub hypothesis: &'a PairHypothesis,
    /// Whether its views are near each other in an order that says something.
    pub is_near: bool,
    /// Its score, and of a near one also what ways over third views say that are near both and lead to the same
    /// place: of each the score of the weaker half.
    pub strength: f64,
}

/// The hypotheses in the order in which they are tried: those of near views first, the strongest of each first.
pub fn candidates<'a>(coarse_set: &CoarseSet, hypotheses: &[&'a PairHypothesis]) -> Vec<Candidate<'a>> {
    let mut by_pair: HashMap<(usize, usize), Vec<(Motion, f64)>> = HashMap::new();
    for hypothesis in hypotheses {
        let score = coarse_set.score(hypothesis);
        by_pair.entry((hypothesis.i, hypothesis.j)).or_default().push((hypothesis.i_from_j, score));
    }
    let is_strong = |of_pair: &Vec<(Motion, f64)>| of_pair.iter().any(|(_, score)| merge_evidence::is_strong(*score));
    let count = coarse_set.coarse_views.len();
    let sequence = Sequence::of(count, |i, j| by_pair.get(&(i, j)).is_some_and(is_strong));
    let of_pair = |i: usize, j: usize| -> Vec<(Motion, f64)> {
        let found = by_pair.get(&(i.min(j), i.max(j))).map_or(&[][..], Vec::as_slice);
        found.iter().map(|(motion, score)| (if i < j { *motion } else { motion.inverse() }, *score)).collect()
    };
    let over_third_views = |hypothesis: &PairHypothesis| -> f64 {
        let (i, j) = (hypothesis.i, hypothesis.j);
        let radius = coarse_set.coarse_views[j].radius;
        let leads_there = |motion: &Motion| alike(motion, &hypothesis.i_from_j, radius, TUNING.same * coarse_set.edge);
        let over = |k: usize| {
            let (there, back) = (of_pair(i, k), of_pair(k, j));
            let ways = there.iter().flat_map(|first| back.iter().map(move |second| (first, second)));
            let leading = ways.filter(|((i_from_k, _), (k_from_j, _))| leads_there(&(i_from_k * k_from_j)));
            leading.map(|((_, first), (_, second))| first.min(*second)).fold(0.0, f64::max)
        };
        (0..count).filter(|k| ![i, j].contains(k) && sequence.is_near(i, *k) && sequence.is_near(*k, j)).map(over).sum()
    };
    let candidate = |hypothesis: &&'a PairHypothesis| {
        let is_near = sequence.is_near(hypothesis.i, hypothesis.j);
        let others = if is_near { over_third_views(hypothesis) } else { 0.0 };
        Candidate { hypothesis, is_near, strength: coarse_set.score(hypothesis) + others }
    };
    let mut candidates: Vec<Candidate> = hypotheses.iter().map(candidate).collect();
    candidates.sort_by(|a, b| {
        let views = |candidate: &Candidate| (candidate.hypothesis.i, candidate.hypothesis.j);
        b.is_near.cmp(&a.is_near).then(b.strength.total_cmp(&a.strength)).then(views(a).cmp(&views(b)))
    });
    candidates
}

/// How much likelier, as a logarithm, each event is by its own rate than by another (Kullback and Leibler, 1951).
fn divergence(own: f64, other: f64) -> f64 {
    let term = |own: f64, other: f64| if own > 0.0 { own * (own / other).ln() } else { 0.0 };
    term(own, other) + term(1.0 - own, 1.0 - other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::Fixture;

    /// Views of a walk overlap up to three places apart; `at` says where in the walk each was taken.
    fn of_walk(count: usize, at: impl Fn(usize) -> usize) -> Sequence {
        Sequence::of(count, |i, j| at(i).abs_diff(at(j)) <= 3)
    }

    #[test]
    fn scans_of_a_walk_in_their_order_are_near_as_far_as_they_overlap() {
        let sequence = of_walk(40, |k| k);
        assert!(sequence.is_near(4, 7) && sequence.is_near(7, 4) && !sequence.is_near(4, 8));
    }

    #[test]
    fn shuffled_scans_and_those_that_all_overlap_are_in_no_order() {
        assert_eq!(of_walk(40, |k| k * 7 % 40), Sequence::default());
        assert_eq!(Sequence::of(40, |_, _| true), Sequence::default());
        assert_eq!(Sequence::of(40, |_, _| false), Sequence::default());
    }

    /// Every ten degrees around the ball; pairs up to three places apart, and one at the far side as strong as any.
    fn around() -> (Fixture, Vec<PairHypothesis>) {
        let directions: Vec<f64> = (0..24).map(|k| 10.0 * f64::from(k)).collect();
        let fixture = Fixture::from_around(&directions);
        let pairs = (0..24).flat_map(|i| (i + 1..24.min(i + 4)).map(move |j| (i, j)));
        let mut hypotheses: Vec<PairHypothesis> = pairs.map(|(i, j)| fixture.right(i, j)).collect();
        let strongest = hypotheses.iter().max_by(|a, b| a.score().total_cmp(&b.score())).expect("there are pairs");
        hypotheses.push(PairHypothesis { i: 2, j: 20, ..*strongest });
        (fixture, hypotheses)
    }

    #[test]
    fn near_views_come_first_and_what_third_views_bear_out_first_of_them() {
        let (fixture, mut hypotheses) = around();
        // as strong as the right one by itself
        let elsewhere = fixture.i_from_j_off(10, 11, [0.0; 3], [0.0, 0.0, 0.9]);
        hypotheses.push(PairHypothesis { i_from_j: elsewhere, ..fixture.right(10, 11) });
        let all: Vec<&PairHypothesis> = hypotheses.iter().collect();
        let candidates = candidates(&fixture.coarse_set(), &all);
        let last = candidates.last().expect("there are some");
        assert_eq!((last.hypothesis.i, last.hypothesis.j, last.is_near), (2, 20, false));
        let of_pair: Vec<&Candidate> = candidates
            .iter()
            .filter(|candidate| (candidate.hypothesis.i, candidate.hypothesis.j) == (10, 11))
            .collect();
        assert_eq!(of_pair.len(), 2);
        assert!(fixture.off(10, 11, &of_pair[0].hypothesis.i_from_j) < 1e-9, "the right one first");
        assert!(of_pair[0].strength > 2.0 * of_pair[1].strength, "{of_pair:?}");
    }

    #[test]
    fn a_few_scans_may_overlap_in_their_order_by_chance() {
        assert_eq!(of_walk(5, |k| k), Sequence::default());
        assert_eq!(Sequence::of(8, |i, j| j == i + 1), Sequence::default());
        assert_eq!(of_walk(0, |k| k), Sequence::default());
        assert_eq!(of_walk(1, |k| k), Sequence::default());
    }
}
