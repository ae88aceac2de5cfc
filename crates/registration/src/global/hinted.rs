//! What a person said of the views, in global registration: it proposes, and it joins where the surfaces let it.
//!
//! Picked points propose a motion of their pair. Where the surfaces don't contradict it, the pair is laid so before
//! anything is grown, whatever else would fit as well. Pairs that are said to overlap are searched as exhaustively as open
//! ones are, and may be joined on half the evidence.

use super::agglomerative::{Agglomeration, agglomerate, implied, measure_all, touching};
use super::coarse_set::CoarseSet;
use super::coarse_view::CoarseView;
use super::component::Component;
use super::consensus::{self, Support, alike};
use super::contact::contact;
use super::hypothesis_score::HypothesisScorer;
use super::matching::Match;
use super::merge_evidence::MergeEvidence;
use super::pair_hypothesis::PairHypothesis;
use super::rotation_search::rotation_search;
use super::slippage::can_slip;
use super::surfel_icp::align;
use super::verification::verify;
use crate::hinted::{Hinted, PickedPair};
use crate::sensor::turning::Turning;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels of a view that are queried of picked points.
        samples: usize = 400,
        /// Refined on the surface, picked places may come apart by this many edges more.
        refined: f64 = 3.0,
        /// Picked points are followed if this share of the surfels agrees,
        least_overlap: f64 = 0.02,
        /// this share of what was said: more speaks for them than against,
        consistent: f64 = 0.5,
        /// this share of the points near each other touches at full resolution,
        touching: f64 = 0.5,
        /// and no other motion of the pair, at least as consistent, is stronger by this factor
        overruled: f64 = 2.0,
        /// (unless so much agrees that nothing speaks against them: a like part elsewhere may be larger).
        clear: f64 = 0.8,
        /// Poses that differ by less than this, in edges, are the same.
        same: f64 = 4.0,
        /// Components that are said to overlap are joined on half the score that others need,
        joined_score: f64 = 0.08,
        /// and of contact.
        joined_touching: f64 = 0.6,
        /// Another way to lay them on each other is a rival from this share of the score on.
        rival: f64 = 0.85,
        /// Motions of a pair that is said to overlap, proposed by single matches.
        proposals: usize = 12,
    }
}

/// What is known before anything was searched.
#[derive(Debug, Clone, Copy)]
pub struct Prior<'a> {
    /// Poses that are thought to be known, local frame to world.
    pub given: &'a [Option<Motion>],
    /// What a person said.
    pub hinted: &'a Hinted,
    /// How the views stood before a scanner that stood still, if they are of what moved.
    pub turning: Option<&'a Turning>,
}

impl Prior<'_> {
    /// The motions of a pair that poses and picked points give.
    pub fn proposed(&self, i: usize, j: usize) -> impl Iterator<Item = Motion> {
        let given = self.given[i].zip(self.given[j]).map(|(pose_i, pose_j)| pose_i.inv_mul(&pose_j));
        self.hinted.motion(i, j).into_iter().chain(given)
    }

    /// Further motions of a pair that is said to overlap.
    pub fn exhaustively_proposed(
        &self,
        coarse_views: &[CoarseView],
        (i, j): (usize, usize),
        matches: &[Match],
        edge: f64,
    ) -> Vec<Motion> {
        if !self.hinted.is_overlapping(i, j) {
            return Vec::new();
        }
        let (i, j) = (HypothesisScorer::new(&coarse_views[i], edge), HypothesisScorer::new(&coarse_views[j], edge));
        rotation_search(&i, &j, matches, edge, TUNING.proposals)
    }
}

/// Assembles components from those `begun`, pairs with picked points first.
pub fn agglomerate_hinted(
    coarse_set: &CoarseSet,
    hypotheses: &[PairHypothesis],
    begun: Vec<Component>,
    hinted: &Hinted,
    progress: &Progress,
) -> Result<Agglomeration, Canceled> {
    if *hinted == Hinted::default() {
        return agglomerate(coarse_set, hypotheses, begun, progress);
    }
    let followed: Vec<PairHypothesis> =
        hinted.picked.iter().filter_map(|pair| followed(coarse_set, hypotheses, pair)).collect();
    let begun = with_begun(coarse_set, laid_out(coarse_set, followed), begun);
    let agglomeration = agglomerate(coarse_set, hypotheses, begun, progress)?;
    Ok(join_overlapping(coarse_set, hypotheses, agglomeration, hinted))
}

/// The hypothesis that picked points make, if the surfaces don't contradict it.
fn followed(coarse_set: &CoarseSet, hypotheses: &[PairHypothesis], pair: &PickedPair) -> Option<PairHypothesis> {
    let (i, j) = (pair.i, pair.j);
    let (a, b) = (&coarse_set.coarse_views[i], &coarse_set.coarse_views[j]);
    let picked = pair.fit.a_from_b;
    let refined = align(a, b, &picked, coarse_set.edge);
    let stays = pair.distances(&refined).0 <= pair.tolerance.max(pair.fit.rms + TUNING.refined * coarse_set.edge);
    let i_from_j = if stays { refined } else { picked };
    let hypothesis =
        PairHypothesis { i, j, i_from_j, evidence: verify(a, b, &i_from_j, coarse_set.edge, TUNING.samples) };
    let touches =
        || contact(&coarse_set.views[i], &coarse_set.views[j], &i_from_j, coarse_set.resolution).map(|c| c.touching);
    let consistency = hypothesis.evidence.both().consistency();
    let is_overruled = |other: &PairHypothesis| {
        (other.i, other.j) == (i, j)
            && !alike(&other.i_from_j, &i_from_j, b.radius, TUNING.same * coarse_set.edge)
            && other.evidence.both().consistency() >= consistency
            && coarse_set.score(other) > TUNING.overruled * coarse_set.score(&hypothesis)
    };
    let holds = hypothesis.evidence.overlap() >= TUNING.least_overlap
        && consistency >= TUNING.consistent
        && (consistency >= TUNING.clear || !hypotheses.iter().any(is_overruled))
        && touches().is_some_and(|touching| touching >= TUNING.touching);
    holds.then_some(hypothesis)
}

/// The components that hypotheses make by themselves.
fn laid_out(coarse_set: &CoarseSet, mut hypotheses: Vec<PairHypothesis>) -> Vec<Component> {
    hypotheses.sort_by(|a, b| coarse_set.score(b).total_cmp(&coarse_set.score(a)).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut components: Vec<Component> = Vec::new();
    let take =
        |components: &mut Vec<Component>, view: usize| match components.iter().position(|g| g.views.contains(&view)) {
            Some(index) => components.swap_remove(index),
            None => Component::of(view),
        };
    for hypothesis in hypotheses {
        let mut left = take(&mut components, hypothesis.i);
        if !left.views.contains(&hypothesis.j) {
            let right = take(&mut components, hypothesis.j);
            let Some(motion) = implied(&left, &right, &hypothesis) else { continue };
            left = left.united(&right, &motion);
        }
        left.hypotheses.push(hypothesis);
        components.push(left);
    }
    components.iter_mut().for_each(|component| component.average(coarse_set.coarse_views, coarse_set.edge));
    components.sort_by_key(|component| component.views[0]);
    components
}

/// Components that were grown, with those that a person laid out: united where they say the same; where they don't, the grown
/// ones lose the views in question.
fn with_begun(coarse_set: &CoarseSet, laid_out: Vec<Component>, grown: Vec<Component>) -> Vec<Component> {
    let mut kept = laid_out;
    for mut component in grown {
        let (sharing, apart): (Vec<Component>, Vec<Component>) =
            kept.into_iter().partition(|other| other.views.iter().any(|view| component.views.contains(view)));
        kept = apart;
        for other in sharing {
            match agreement(coarse_set, &component, &other) {
                Some(motion) => component = component.united(&without(&other, &component.views), &motion),
                None => {
                    component = without(&component, &other.views);
                    kept.push(other);
                }
            }
        }
        if component.views.len() > 1 {
            kept.push(component);
        }
    }
    kept.sort_by_key(|component| component.views[0]);
    kept
}

/// The motion from the other component's world into this one's, if they agree on all views of both.
fn agreement(coarse_set: &CoarseSet, component: &Component, other: &Component) -> Option<Motion> {
    let shared: Vec<usize> = component.views.iter().copied().filter(|view| other.views.contains(view)).collect();
    let pose = |component: &Component, view: usize| component.pose_of(view).unwrap_or_default();
    let first = *shared.first()?;
    let motion = pose(component, first) * pose(other, first).inverse();
    let is_same = |view: &usize| {
        let radius = coarse_set.coarse_views[*view].radius;
        alike(&(motion * pose(other, *view)), &pose(component, *view), radius, TUNING.same * coarse_set.edge)
    };
    shared.iter().all(is_same).then_some(motion)
}

/// A component without some of its views.
fn without(component: &Component, views: &[usize]) -> Component {
    let kept = |view: &usize| !views.contains(view);
    let rows =
        component.views.iter().copied().zip(component.local_poses.iter().copied()).filter(|(view, _)| kept(view));
    let (left, local_poses) = rows.unzip();
    let hypotheses =
        component.hypotheses.iter().filter(|hypothesis| kept(&hypothesis.i) && kept(&hypothesis.j)).copied().collect();
    Component { views: left, local_poses, hypotheses, search: component.search }
}

/// Joins components whose views are said to overlap on less evidence than others need.
fn join_overlapping(
    coarse_set: &CoarseSet,
    hypotheses: &[PairHypothesis],
    mut agglomeration: Agglomeration,
    hinted: &Hinted,
) -> Agglomeration {
    for &(i, j) in &hinted.overlapping {
        let home = |view: usize| agglomeration.components.iter().position(|component| component.views.contains(&view));
        let Some((a, b)) = home(i).zip(home(j)).filter(|(a, b)| a != b) else { continue };
        let (left, right) = (&agglomeration.components[a], &agglomeration.components[b]);
        let Some(union) = joined(coarse_set, hypotheses, left, right, (i, j)) else { continue };
        union.views.iter().for_each(|view| agglomeration.ambiguous[*view] = false);
        agglomeration.components[a] = union;
        agglomeration.components.remove(b);
    }
    super::agglomerative::sort_by_size(&mut agglomeration.components);
    agglomeration
}

fn joined(
    coarse_set: &CoarseSet,
    hypotheses: &[PairHypothesis],
    left: &Component,
    right: &Component,
    (i, j): (usize, usize),
) -> Option<Component> {
    let mut found: Vec<(MergeEvidence, Vec<PairHypothesis>, Motion)> = hypotheses
        .iter()
        .filter(|hypothesis| (hypothesis.i, hypothesis.j) == (i, j))
        .filter_map(|hypothesis| implied(left, right, hypothesis))
        .map(|motion| {
            let measured = measure_all(coarse_set.coarse_views, left, right, &motion, coarse_set.edge);
            (MergeEvidence::of(coarse_set, &measured), measured, motion)
        })
        .filter(|(evidence, ..)| evidence.best >= TUNING.joined_score && evidence.score >= TUNING.joined_score)
        .collect();
    found.sort_by(|a, b| b.0.score.total_cmp(&a.0.score));
    found.retain(|(_, measured, _)| touching(coarse_set, measured) >= TUNING.joined_touching);
    let (best, measured, motion) = found.first()?;
    let radius = right.views.iter().map(|view| coarse_set.coarse_views[*view].radius).fold(0.0, f64::max);
    let is_rival = |(evidence, _, other): &(MergeEvidence, Vec<PairHypothesis>, Motion)| {
        !alike(other, motion, radius, TUNING.same * coarse_set.edge) && evidence.score > TUNING.rival * best.score
    };
    if found.iter().any(is_rival) || can_slip(coarse_set.coarse_views, measured, coarse_set.edge, TUNING.samples) {
        return None;
    }
    let mut union = left.united(right, motion);
    union.hypotheses.extend(measured.iter().filter(|hypothesis| hypothesis.is_promising()));
    union.average(coarse_set.coarse_views, coarse_set.edge);
    Some(union)
}

/// The proposals of a pair: those that are known, then those of many matches, then, where it is said to overlap, those of
/// single ones.
pub fn proposed(
    coarse_views: &[CoarseView],
    (i, j): (usize, usize),
    prior: &Prior,
    edge: f64,
    count: usize,
) -> Vec<Motion> {
    let matches = super::matching::matches(&coarse_views[i], &coarse_views[j], edge);
    let proposals = consensus::proposals(&coarse_views[i], &coarse_views[j], &matches, Support::Any, edge, count);
    prior
        .proposed(i, j)
        .chain(proposals.into_iter().map(|proposal| proposal.i_from_j))
        .chain(prior.exhaustively_proposed(coarse_views, (i, j), &matches, edge))
        .collect()
}
