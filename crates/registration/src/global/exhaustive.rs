//! What is done where the quick way leaves views open, or a component that contradicts itself: more proposals for each pair.

use rayon::prelude::*;

use super::agglomerative::{Agglomeration, measure};
use super::coarse_set::CoarseSet;
use super::component::Component;
use super::consensus::{Support, alike, proposals};
use super::hinted::agglomerate_hinted;
use super::hypothesis_score::HypothesisScorer;
use super::pair_hypothesis::PairHypothesis;
use super::rotation_search::rotation_search;
use super::verification::verify;
use super::votes::SurfelVotes;
use super::{hypotheses_of, matching};
use crate::hinted::Hinted;
use crate::view_graph::all_pairs;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Motions of a pair that are proposed by single matches, and by matches that are not on one plane.
        proposals: usize = 12,
        /// Surfels of a view that are queried of a component.
        samples: usize = 100,
        /// Components of fewer views say too little to be clear.
        least_views: usize = 3,
        /// Of what all pairs of a clear component say, at most this share is that a scanner looked through a surface or missed it
        /// (the dragon's say 0.011),
        not_seen: f64 = 0.02,
        /// and at least this share agrees (the happy buddha's say 0.865).
        agree: f64 = 0.83,
        /// A hypothesis within a component that says something else, is as strong as this and stronger than what the component says instead,
        /// contradicts it: on right registrations of real scans of things such hypotheses have 0.025 at most, and smooth pebbles laid on
        /// each other the wrong way have left right ones of 0.1 to 0.4 unused.
        contradicting: f64 = 0.2,
        /// A component of which more than this share of views is contradicted is not clear at all: half of it may lie wrong.
        contradicted: f64 = 0.125,
        /// Another place is as good as a view's own from this share of what speaks for that on.
        rival: f64 = 0.8,
        /// More open views than this are not looked at exhaustively: it takes seconds for each.
        most_open: usize = 24,
        /// Motions nearer to each other than this, in edges, say the same.
        same: f64 = 4.0,
    }
}

/// What is clear of an agglomeration: of each component the views that hardly anything speaks against, if they agree with each other.
#[derive(Debug, Clone)]
pub struct Cores {
    components: Vec<Component>,
    /// For each view which of `components` holds it.
    home: Vec<Option<usize>>,
}

impl Cores {
    /// Asks the components of an agglomeration.
    pub fn of(coarse_set: &CoarseSet, hypotheses: &[PairHypothesis], agglomeration: &Agglomeration) -> Self {
        let mut cores = Cores { components: Vec::new(), home: vec![None; coarse_set.coarse_views.len()] };
        for component in agglomeration.components.iter().filter(|component| component.views.len() >= TUNING.least_views)
        {
            let core = without_contradicted(coarse_set, hypotheses, component);
            if is_coherent(coarse_set, &core) {
                core.views.iter().for_each(|view| cores.home[*view] = Some(cores.components.len()));
                cores.components.push(core);
            }
        }
        cores
    }

    /// Whether one core holds all views.
    pub fn hold_all(&self) -> bool {
        self.components.len() == 1 && self.home.iter().all(Option::is_some)
    }

    /// How many views are of none.
    fn open(&self) -> usize {
        self.home.iter().filter(|home| home.is_none()).count()
    }

    /// Whether two views are of one core.
    fn hold(&self, i: usize, j: usize) -> bool {
        self.home[i].is_some() && self.home[i] == self.home[j]
    }
}

/// Assembles components anew, with more hypotheses, which are added; what is clear of the `quick` agglomeration stays. `pairs` are those
/// that are matched.
pub fn search_exhaustively(
    coarse_set: &CoarseSet,
    hypotheses: &mut Vec<PairHypothesis>,
    pairs: &[(usize, usize)],
    (quick, cores): (&Agglomeration, Cores),
    hinted: &Hinted,
    progress: &Progress,
) -> Result<Agglomeration, Canceled> {
    if cores.open() > TUNING.most_open {
        return Ok(quick.clone());
    }
    hypotheses.extend(more_hypotheses(coarse_set, hypotheses, pairs, &cores, progress)?);
    agglomerate_hinted(coarse_set, hypotheses, cores.components, hinted, progress)
}

/// A component without the views that a hypothesis contradicts; if these are many, nothing of it is clear.
fn without_contradicted(coarse_set: &CoarseSet, hypotheses: &[PairHypothesis], component: &Component) -> Component {
    let mut place = vec![None; coarse_set.coarse_views.len()];
    component.views.iter().enumerate().for_each(|(k, view)| place[*view] = Some(k));
    let contradicting: Vec<(&PairHypothesis, usize, usize)> = hypotheses
        .par_iter()
        .filter_map(|hypothesis| Some((hypothesis, place[hypothesis.i]?, place[hypothesis.j]?)))
        .filter(|(hypothesis, k, l)| {
            contradicts(coarse_set, hypothesis, &component.local_poses[*k].inv_mul(&component.local_poses[*l]))
        })
        .collect();
    let is_cropped = |view: usize| coarse_set.coarse_views[view].depth_image.is_cropped();
    let mut contradicted = vec![false; component.views.len()];
    let mut elsewhere: Vec<Vec<Motion>> = vec![Vec::new(); component.views.len()];
    for (hypothesis, k, l) in contradicting {
        // what a frame does not show can't speak against a hypothesis: its pair alone says too little
        if is_cropped(hypothesis.i) && is_cropped(hypothesis.j) {
            elsewhere[l].push(component.local_poses[k] * hypothesis.i_from_j);
            elsewhere[k].push(component.local_poses[l] * hypothesis.i_from_j.inverse());
        } else {
            (contradicted[k], contradicted[l]) = (true, true);
        }
    }
    let most = TUNING.contradicted * component.views.len() as f64;
    let is_too_many = |contradicted: &[bool]| contradicted.iter().filter(|is| **is).count() as f64 > most;
    let asked: Vec<usize> =
        (0..component.views.len()).filter(|k| !contradicted[*k] && !elsewhere[*k].is_empty()).collect();
    // to ask all others of a place is dear: it ends as soon as these are too many
    for some in asked.chunks(AT_ONCE) {
        if is_too_many(&contradicted) {
            break;
        }
        let fit_elsewhere: Vec<bool> =
            some.par_iter().map(|k| is_as_well_elsewhere(coarse_set, component, *k, &elsewhere[*k])).collect();
        some.iter().zip(fit_elsewhere).for_each(|(k, is)| contradicted[*k] = is);
    }
    if is_too_many(&contradicted) {
        return component.among(&[]);
    }
    let clear: Vec<usize> = (0..component.views.len()).filter(|k| !contradicted[*k]).collect();
    component.among(&clear)
}

/// Views that are asked at once, whatever the number of threads.
const AT_ONCE: usize = 8;

/// Whether a strong hypothesis says something else than the motion by which a component lays its pair, and more clearly.
fn contradicts(coarse_set: &CoarseSet, hypothesis: &PairHypothesis, implied: &Motion) -> bool {
    let score = coarse_set.score(hypothesis);
    score >= TUNING.contradicting
        && !alike(
            implied,
            &hypothesis.i_from_j,
            coarse_set.coarse_views[hypothesis.j].radius,
            TUNING.same * coarse_set.edge,
        )
        && measure(coarse_set.coarse_views, hypothesis.i, hypothesis.j, implied, coarse_set.edge)
            .is_none_or(|own| score > coarse_set.score(&own))
}

/// Whether as much speaks for one of some other poses of a component's view as for its own, by all others of the component.
fn is_as_well_elsewhere(coarse_set: &CoarseSet, component: &Component, place: usize, poses: &[Motion]) -> bool {
    let coarse_view = |k: usize| &coarse_set.coarse_views[component.views[k]];
    let balance = |pose: &Motion| -> f64 {
        let others = (0..component.views.len()).filter(|other| *other != place);
        let motions = others.map(|other| (other, component.local_poses[other].inv_mul(pose)));
        let near = motions.filter(|(other, motion)| {
            motion.translation.vector.norm() < coarse_view(*other).radius + coarse_view(place).radius
        });
        near.map(|(other, motion)| {
            verify(coarse_view(other), coarse_view(place), &motion, coarse_set.edge, TUNING.samples).both().balance()
        })
        .sum()
    };
    let own = balance(&component.local_poses[place]);
    poses.iter().any(|pose| balance(pose) > TUNING.rival * own)
}

/// Whether the pairs of a component agree, and no scanner looked through what another saw.
fn is_coherent(coarse_set: &CoarseSet, component: &Component) -> bool {
    let n = component.views.len();
    let pairs: Vec<(usize, usize)> = all_pairs(n).collect();
    let votes: Vec<SurfelVotes> = pairs
        .par_iter()
        .map(|&(k, l)| {
            let (i, j) = (&coarse_set.coarse_views[component.views[k]], &coarse_set.coarse_views[component.views[l]]);
            let i_from_j = component.local_poses[k].inv_mul(&component.local_poses[l]);
            verify(i, j, &i_from_j, coarse_set.edge, TUNING.samples).both()
        })
        .collect();
    let votes: SurfelVotes = votes.into_iter().sum();
    n >= TUNING.least_views
        && votes.unseen() <= TUNING.not_seen * votes.said()
        && votes.agree >= TUNING.agree * votes.said()
}

/// Further hypotheses of the pairs that are matched, but for those within one core.
fn more_hypotheses(
    coarse_set: &CoarseSet,
    known: &[PairHypothesis],
    pairs: &[(usize, usize)],
    cores: &Cores,
    progress: &Progress,
) -> Result<Vec<PairHypothesis>, Canceled> {
    let pairs: Vec<(usize, usize)> = pairs.iter().copied().filter(|&(i, j)| !cores.hold(i, j)).collect();
    let scorers: Vec<HypothesisScorer> = coarse_set
        .coarse_views
        .par_iter()
        .map(|coarse_view| HypothesisScorer::new(coarse_view, coarse_set.edge))
        .collect();
    let found: Vec<Vec<PairHypothesis>> = pairs
        .par_iter()
        .with_max_len(1)
        .map(|&(i, j)| {
            progress.check()?;
            let matches = matching::matches(&coarse_set.coarse_views[i], &coarse_set.coarse_views[j], coarse_set.edge);
            let (a, b) = (&coarse_set.coarse_views[i], &coarse_set.coarse_views[j]);
            let agreed = proposals(a, b, &matches, Support::AcrossPlanes, coarse_set.edge, TUNING.proposals);
            let turned = rotation_search(&scorers[i], &scorers[j], &matches, coarse_set.edge, TUNING.proposals);
            let proposed = agreed.into_iter().map(|proposal| proposal.i_from_j).chain(turned);
            let known: Vec<PairHypothesis> =
                known.iter().filter(|hypothesis| (hypothesis.i, hypothesis.j) == (i, j)).copied().collect();
            Ok(hypotheses_of(coarse_set.coarse_views, (i, j), proposed, &known, coarse_set.edge))
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(found.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::agglomerative::agglomerate;
    use crate::global::fixture::Fixture;

    #[test]
    fn a_component_is_clear_until_a_strong_hypothesis_says_something_else() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let coarse_set = fixture.coarse_set();
        let right = vec![fixture.right(0, 1), fixture.right(1, 2)];
        let agglomeration = agglomerate(&coarse_set, &right, Vec::new(), &Progress::silent()).expect("not canceled");
        let cores = Cores::of(&coarse_set, &right, &agglomeration);
        assert!(cores.hold_all() && cores.hold(0, 2) && cores.open() == 0);
        let elsewhere = fixture.i_from_j_off(0, 1, [0.0; 3], [0.0, 0.0, 0.9]);
        // what claims to overlap more than the true place does
        let mut strong = PairHypothesis { i_from_j: elsewhere, ..right[0] };
        strong.evidence.j_in_i.agree *= 1.3;
        strong.evidence.i_in_j.agree *= 1.3;
        let said = [right, vec![strong]].concat();
        let cores = Cores::of(&coarse_set, &said, &agglomeration);
        assert!(!cores.hold_all() && cores.open() == 3, "two of three are contradicted: nothing is clear");
    }
}
