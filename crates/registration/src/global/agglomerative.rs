//! From pairs to a whole: components of views grow by the best pair that all their views bear out.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::coarse_set::CoarseSet;
use super::coarse_view::CoarseView;
use super::component::Component;
use super::consensus::alike;
use super::contact::contact;
use super::merge_evidence::MergeEvidence;
use super::pair_hypothesis::{self, PairHypothesis};
use super::sequence::{Candidate, candidates};
use super::slippage::can_slip;
use super::surfel_icp::align;
use super::verification::verify;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress};

/// All components, and views that could be laid on others in several ways.
#[derive(Debug, Clone, Default)]
pub struct Agglomeration {
    /// The largest first, those of equal size in the order of views.
    pub components: Vec<Component>,
    /// For each view whether it, or its component, fits the rest in several ways.
    pub ambiguous: Vec<bool>,
}

visage_geometry::tuning! {
    /// What joins need.
    pub(super) const TUNING: Tuning {
        /// A pair within a join is refined on the surface; it may move by this many edges.
        drift: f64 = 4.0,
        /// Surfels of a view that are queried when components are joined.
        samples: usize = 200,
        /// Another way to lay two components on each other is a rival from this share of the strength on.
        rival: f64 = 0.85,
        /// Components are joined if of the points of their strongest pairs that come near each other this share touches,
        touching: f64 = 0.75,
        /// looking at this many pairs.
        witnesses: usize = 3,
        /// What this many times its own score speaks for is held by ways over third views: if it slipped, they would
        /// not lead to the same place.
        held: f64 = 2.0,
    }
}

/// What came of trying a hypothesis.
enum Attempt {
    Joined(Component),
    Ambiguous,
    Refused,
}

/// Joins components until no hypothesis joins two of them: those `begun`, and each other view as one of its own.
pub fn agglomerate(
    coarse_set: &CoarseSet,
    hypotheses: &[PairHypothesis],
    begun: Vec<Component>,
    progress: &Progress,
) -> Result<Agglomeration, Canceled> {
    let coarse_views = coarse_set.coarse_views;
    let mut components: Vec<Option<Component>> =
        (0..coarse_views.len()).map(|view| Some(Component::of(view))).collect();
    let mut home: Vec<usize> = (0..coarse_views.len()).collect();
    for component in begun {
        let Some(&first) = component.views.first() else { continue };
        component.views.iter().for_each(|view| (components[*view], home[*view]) = (None, first));
        components[first] = Some(component);
    }
    let promising: Vec<&PairHypothesis> = hypotheses.iter().filter(|hypothesis| hypothesis.is_promising()).collect();
    let waiting = candidates(coarse_set, &promising);
    let mut ambiguous = vec![false; coarse_views.len()];
    // a hypothesis that was refused is tried again when its components have grown by views that lie near each other
    let mut refused_at = vec![usize::MAX; waiting.len()];
    let mut joined = true;
    while joined {
        joined = false;
        for (candidate, refused_at) in waiting.iter().zip(&mut refused_at) {
            progress.check()?;
            let hypothesis = candidate.hypothesis;
            let (a, b) = (home[hypothesis.i], home[hypothesis.j]);
            let (Some(left), Some(right)) = (&components[a], &components[b]) else { continue };
            if a == b {
                continue;
            }
            let near = count_near(coarse_views, left, right, hypothesis);
            if *refused_at == near {
                continue;
            }
            *refused_at = near;
            match try_join(coarse_set, left, right, candidate, &waiting) {
                Attempt::Joined(union) => {
                    union.views.iter().for_each(|view| (home[*view], ambiguous[*view]) = (a, false));
                    components[a] = Some(union);
                    components[b] = None;
                    joined = true;
                }
                Attempt::Ambiguous => {
                    let smaller = if left.views.len() < right.views.len() { left } else { right };
                    smaller.views.iter().for_each(|view| ambiguous[*view] = true);
                }
                Attempt::Refused => {}
            }
        }
    }
    let mut components: Vec<Component> = components.into_iter().flatten().collect();
    sort_by_size(&mut components);
    Ok(Agglomeration { components, ambiguous })
}

/// The largest first, those of equal size in the order of views.
pub fn sort_by_size(components: &mut [Component]) {
    components.sort_by(|a, b| b.views.len().cmp(&a.views.len()).then(a.views.cmp(&b.views)));
}

/// Lays both components together as `hypothesis` says, if all their views bear it out and nothing else fits as well.
fn try_join(
    coarse_set: &CoarseSet,
    left: &Component,
    right: &Component,
    candidate: &Candidate,
    waiting: &[Candidate],
) -> Attempt {
    let hypothesis = candidate.hypothesis;
    let (coarse_views, edge) = (coarse_set.coarse_views, coarse_set.edge);
    let Some(motion) = implied(left, right, hypothesis) else { return Attempt::Refused };
    let outvoted = if candidate.is_near { votes_against(coarse_set, left, right, &motion, waiting) } else { 0.0 };
    if outvoted > 1.0 {
        return Attempt::Refused;
    }
    let measured = measure_all(coarse_views, left, right, &motion, edge);
    let mut evidence = MergeEvidence::of(coarse_set, &measured);
    if !evidence.suffice() {
        return Attempt::Refused;
    }
    evidence.rival = outvoted;
    evidence.touching = touching(coarse_set, &measured);
    if evidence.touching < TUNING.touching {
        return Attempt::Refused;
    }
    let radius = right.views.iter().map(|view| coarse_views[*view].radius).fold(0.0, f64::max);
    let rivals = waiting.iter().filter(|rival| {
        let other = rival.hypothesis;
        let same_pair = (other.i, other.j) == (hypothesis.i, hypothesis.j);
        let is_other = !alike(&other.i_from_j, &hypothesis.i_from_j, radius, TUNING.drift * edge);
        same_pair && is_other && rival.strength > TUNING.rival * candidate.strength
    });
    for rival in rivals {
        let Some(motion) = implied(left, right, rival.hypothesis) else { continue };
        let other = MergeEvidence::of(coarse_set, &measure_all(coarse_views, left, right, &motion, edge));
        evidence.rival = evidence.rival.max(other.score / evidence.score);
    }
    let is_held = candidate.strength >= TUNING.held * coarse_set.score(hypothesis);
    if evidence.rival < TUNING.rival && !is_held && can_slip(coarse_views, &measured, edge, TUNING.samples) {
        evidence.rival = 1.0;
    }
    if evidence.rival > TUNING.rival {
        return Attempt::Ambiguous;
    }
    let mut union = left.united(right, &motion);
    union.hypotheses.extend(measured.into_iter().filter(PairHypothesis::is_promising));
    union.average(coarse_views, edge);
    Attempt::Joined(union)
}

/// What the near pairs between two components say, by their scores, for another motion between them than this one,
/// in what they say for this one.
fn votes_against(
    coarse_set: &CoarseSet,
    left: &Component,
    right: &Component,
    motion: &Motion,
    waiting: &[Candidate],
) -> f64 {
    let radius = right.views.iter().map(|view| coarse_set.coarse_views[*view].radius).fold(0.0, f64::max);
    let is_same = |a: &Motion, b: &Motion| alike(a, b, radius, TUNING.drift * coarse_set.edge);
    let between: Vec<(&PairHypothesis, Motion)> = waiting
        .iter()
        .take_while(|candidate| candidate.is_near)
        .filter_map(|candidate| Some((candidate.hypothesis, implied(left, right, candidate.hypothesis)?)))
        .collect();
    let votes = |motion: &Motion| -> f64 {
        let mut of_pairs: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for (hypothesis, other) in &between {
            if is_same(motion, other) {
                let most = of_pairs.entry((hypothesis.i, hypothesis.j)).or_default();
                *most = most.max(coarse_set.score(hypothesis));
            }
        }
        of_pairs.values().sum()
    };
    let others = between.iter().filter(|(_, other)| !is_same(motion, other)).map(|(_, other)| votes(other));
    others.fold(0.0, f64::max) / votes(motion)
}

/// How many pairs of a left and a right view lie near each other as a hypothesis has it.
fn count_near(coarse_views: &[CoarseView], left: &Component, right: &Component, hypothesis: &PairHypothesis) -> usize {
    let Some(motion) = implied(left, right, hypothesis) else { return 0 };
    let of_right: Vec<(f64, Motion)> =
        right.views.iter().zip(&right.local_poses).map(|(j, pose)| (coarse_views[*j].radius, motion * pose)).collect();
    let near = |(i, pose_i): (&usize, &Motion)| {
        let is_near = |(radius, pose_j): &&(f64, Motion)| {
            (pose_j.translation.vector - pose_i.translation.vector).norm() <= coarse_views[*i].radius + radius
        };
        of_right.iter().filter(is_near).count()
    };
    left.views.iter().zip(&left.local_poses).map(near).sum()
}

/// How well the strongest pairs of a join touch at full resolution.
pub(super) fn touching(coarse_set: &CoarseSet, measured: &[PairHypothesis]) -> f64 {
    let mut strongest: Vec<&PairHypothesis> = measured.iter().collect();
    strongest.sort_by(|a, b| coarse_set.score(b).total_cmp(&coarse_set.score(a)).then((a.i, a.j).cmp(&(b.i, b.j))));
    let shares: Vec<f64> = strongest
        .iter()
        .take(TUNING.witnesses)
        .filter(|hypothesis| hypothesis.is_promising())
        .filter_map(|hypothesis| {
            contact(
                &coarse_set.views[hypothesis.i],
                &coarse_set.views[hypothesis.j],
                &hypothesis.i_from_j,
                coarse_set.resolution,
            )
        })
        .map(|contact| contact.touching)
        .collect();
    shares.iter().sum::<f64>() / shares.len().max(1) as f64
}

/// The motion from the right component's world into the left one's that a hypothesis stands for, whichever way round it is.
pub(super) fn implied(left: &Component, right: &Component, hypothesis: &PairHypothesis) -> Option<Motion> {
    match (left.pose_of(hypothesis.i), right.pose_of(hypothesis.j)) {
        (Some(pose_i), Some(pose_j)) => Some(pose_i * hypothesis.i_from_j * pose_j.inverse()),
        _ => {
            let (pose_j, pose_i) = (left.pose_of(hypothesis.j)?, right.pose_of(hypothesis.i)?);
            Some(pose_j * hypothesis.i_from_j.inverse() * pose_i.inverse())
        }
    }
}

/// What all pairs of a left and a right view say when the components are laid on each other.
pub(super) fn measure_all(
    coarse_views: &[CoarseView],
    left: &Component,
    right: &Component,
    motion: &Motion,
    edge: f64,
) -> Vec<PairHypothesis> {
    let pairs: Vec<(usize, usize)> =
        left.views.iter().flat_map(|&i| right.views.iter().map(move |&j| (i, j))).collect();
    pairs
        .par_iter()
        .with_max_len(1)
        .filter_map(|&(i, j)| {
            let i_from_j = left.pose_of(i)?.inv_mul(&(motion * right.pose_of(j)?));
            measure(coarse_views, i, j, &i_from_j, edge)
        })
        .collect()
}

/// What a pair says of an implied motion, refined on the surface first if that stays near; `None` if the views are
/// apart.
pub(super) fn measure(
    coarse_views: &[CoarseView],
    i: usize,
    j: usize,
    implied: &Motion,
    edge: f64,
) -> Option<PairHypothesis> {
    if implied.translation.vector.norm() > coarse_views[i].radius + coarse_views[j].radius {
        return None;
    }
    let (a, b) = (&coarse_views[i], &coarse_views[j]);
    let at =
        |i_from_j: Motion| PairHypothesis { i, j, i_from_j, evidence: verify(a, b, &i_from_j, edge, TUNING.samples) };
    let raw = at(*implied);
    if raw.evidence.overlap() < 0.5 * pair_hypothesis::TUNING.least_overlap {
        return Some(raw);
    }
    let refined = align(a, b, implied, edge);
    if !alike(&refined, implied, b.radius, TUNING.drift * edge) {
        return Some(raw);
    }
    let refined = at(refined);
    Some(if refined.score() > raw.score() { refined } else { raw })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};

    fn agglomerated(fixture: &Fixture, hypotheses: &[PairHypothesis]) -> Agglomeration {
        agglomerate(&fixture.coarse_set(), hypotheses, Vec::new(), &Progress::silent()).expect("not canceled")
    }

    #[test]
    fn right_hypotheses_make_one_component_and_none_leave_each_alone() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let Agglomeration { components, ambiguous } =
            agglomerated(&fixture, &[fixture.right(0, 1), fixture.right(1, 2)]);
        assert_eq!(components.len(), 1);
        assert_eq!((components[0].views.as_slice(), ambiguous), ([0, 1, 2].as_slice(), vec![false; 3]));
        let found = components[0].local_poses[0].inv_mul(&components[0].local_poses[2]);
        assert!(fixture.off(0, 2, &found) < 0.2 * EDGE, "{found}");
        assert_eq!(components[0].hypotheses.len(), 3, "the pair that nobody proposed was measured too");
        assert_eq!(agglomerated(&fixture, &[]).components.len(), 3);
    }

    #[test]
    fn a_motion_that_the_surfaces_contradict_joins_nothing() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let wrong = fixture.hypothesis(0, 1, fixture.i_from_j_off(0, 1, [0.0; 3], [0.0, 0.0, 0.9]));
        assert_eq!(agglomerated(&fixture, &[wrong]).components.len(), 2);
    }

    #[test]
    fn a_pair_that_fits_in_two_ways_is_ambiguous() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let right = fixture.right(0, 1);
        // as strong as the right one, wherever it lies
        let elsewhere = fixture.i_from_j_off(0, 1, [0.0; 3], [0.0, 0.0, 0.9]);
        let rival = PairHypothesis { i_from_j: elsewhere, ..right };
        let Agglomeration { components, ambiguous } = agglomerated(&fixture, &[right, rival]);
        // looked at again in the join, the surfaces don't bear the rival out
        assert_eq!((components.len(), ambiguous), (1, vec![false; 2]));
    }

    #[test]
    fn of_near_views_what_most_pairs_say_is_taken() {
        let fixture = Fixture::from_around(&[0.0, 20.0, 40.0, 60.0]);
        let left = Component::of(0).united(&Component::of(1), &fixture.i_from_j(0, 1));
        let right = Component::of(2).united(&Component::of(3), &fixture.i_from_j(2, 3));
        let wrong =
            PairHypothesis { i_from_j: fixture.i_from_j_off(1, 2, [0.0; 3], [0.0, 0.0, 0.9]), ..fixture.right(1, 2) };
        let hypotheses = [wrong, fixture.right(0, 2), fixture.right(1, 3)];
        let near = |hypothesis| Candidate { hypothesis, is_near: true, strength: 1.0 };
        let waiting: Vec<Candidate> = hypotheses.iter().map(near).collect();
        let against = |hypothesis: &PairHypothesis| {
            let motion = implied(&left, &right, hypothesis).expect("it is between them");
            votes_against(&fixture.coarse_set(), &left, &right, &motion, &waiting)
        };
        assert!(against(&hypotheses[0]) > 1.0 && against(&hypotheses[1]) < 1.0);
        assert!((against(&hypotheses[1]) - against(&hypotheses[2])).abs() < 1e-9, "they say the same");
    }

    #[test]
    fn hypotheses_are_implied_whichever_way_round_they_are() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let (left, right) = (Component::of(0), Component::of(1));
        let hypothesis = fixture.right(0, 1);
        let there = implied(&left, &right, &hypothesis).expect("it is between them");
        let back = implied(&right, &left, &hypothesis).expect("it is between them");
        assert!((there * back).translation.vector.norm() < 1e-9);
        assert_eq!(implied(&left, &Component::of(5), &hypothesis), None);
    }

    #[test]
    fn views_that_lie_far_from_the_others_are_no_reason_to_try_again() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0, 120.0]);
        let near = |left: &Component| count_near(&fixture.coarse_views, left, &Component::of(1), &fixture.right(0, 1));
        let alone = Component::of(0);
        let with = |motion: Motion| alone.united(&Component::of(2), &motion);
        assert_eq!(near(&alone), 1);
        assert_eq!(near(&with(fixture.i_from_j(0, 2))), 2);
        assert_eq!(near(&with(Motion::translation(0.0, 900.0, 0.0))), 1);
    }
}
