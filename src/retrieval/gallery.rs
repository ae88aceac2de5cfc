//! The models that are kept, ranked and searchable; current as soon as a change returns.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZero;
use std::ops::Bound;

use super::probe::Similarities;
use super::triangle_index::{Hit, TriangleIndex};
use super::triangle_query::{TriangleQuery, score};
use super::triangles::{IndexedTriangle, triangles_of};
use super::{Match, MatchMethod, ModelId, Rank, Wanted};
use crate::faces::{self, DenseSignature, Signature, Triangle, Verdict, judgement, standard};
use crate::geometry::{Point3, Vector3};

/// What is kept of a model in memory.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub triangles: Vec<IndexedTriangle>,
    /// What tells its face from others, if it has one.
    pub dense: Option<DenseSignature>,
    descriptors: Verdict,
    verified: Verdict,
    literal: Verdict,
}

impl Entry {
    pub(super) fn new(signature: &Signature) -> Entry {
        let face = standard::face();
        Entry {
            triangles: triangles_of(signature),
            dense: signature.dense().cloned(),
            descriptors: faces::judge(signature, &face, MatchMethod::Descriptors),
            verified: faces::judge(signature, &face, MatchMethod::Verified),
            literal: faces::judge(signature, &face, MatchMethod::Literal),
        }
    }

    fn verdict(&self, method: MatchMethod) -> &Verdict {
        match method {
            MatchMethod::Descriptors => &self.descriptors,
            MatchMethod::Verified => &self.verified,
            MatchMethod::Literal => &self.literal,
        }
    }

    /// How surely it is a face, in [0, 1].
    pub(super) fn face_score(&self) -> f64 {
        self.verified.score
    }
}

/// Best score first, then the lower id. Scores are never negative, so their bits order as they do.
type Ranked = (Reverse<u64>, ModelId);

/// The signatures of all stored models, searchable.
///
/// Most models are in one immutable index. Those that came later are searched one by one, those that went are
/// marked, and when either become many the index is built anew.
#[derive(Debug, Default)]
pub struct Gallery {
    entries: BTreeMap<ModelId, Entry>,
    by_descriptors: BTreeSet<Ranked>,
    by_fit: BTreeSet<Ranked>,
    by_literal: BTreeSet<Ranked>,
    index: TriangleIndex,
    /// The models of the index by place, ascending.
    indexed: Vec<ModelId>,
    /// For each place, whether its model is still as it was indexed.
    valid: Vec<bool>,
    /// Models that are not in the index yet.
    fresh: BTreeSet<ModelId>,
    /// How many places are not valid.
    gone: usize,
}

impl Gallery {
    /// An index over all `entries`; of entries with one id the last counts.
    pub fn build(entries: Vec<(ModelId, Signature)>) -> Self {
        use rayon::prelude::*;
        let entries: Vec<(ModelId, Entry)> =
            entries.into_par_iter().map(|(id, signature)| (id, Entry::new(&signature))).collect();
        let mut gallery = Gallery::default();
        for (id, entry) in entries {
            gallery.forget(id);
            gallery.rank(id, &entry);
            gallery.entries.insert(id, entry);
        }
        gallery.reindex();
        gallery
    }

    /// Adds or replaces a model; seen by the next query.
    pub fn insert(&mut self, id: ModelId, signature: Signature) {
        self.forget(id);
        let entry = Entry::new(&signature);
        self.rank(id, &entry);
        self.entries.insert(id, entry);
        self.fresh.insert(id);
        self.reindex_if_due();
    }

    /// Forgets a model; true if it was there.
    pub fn remove(&mut self, id: ModelId) -> bool {
        let was_there = self.forget(id);
        self.reindex_if_due();
        was_there
    }

    /// The number of models.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Models judged against the named built-in standard ("face"), best first, ties by id; `None` if there is no
    /// such standard. The threshold (default [`judgement::MATCH_SCORE`]) decides `is_match`.
    pub fn by_standard(&self, standard: &str, method: MatchMethod, wanted: &Wanted) -> Option<Vec<Match>> {
        standard::by_name(standard)?;
        let threshold = wanted.threshold.unwrap_or(judgement::MATCH_SCORE);
        let ranking = match method {
            MatchMethod::Descriptors => &self.by_descriptors,
            MatchMethod::Verified => &self.by_fit,
            MatchMethod::Literal => &self.by_literal,
        };
        let begin = wanted.after.map_or(Bound::Unbounded, |rank| Bound::Excluded(rank.key()));
        let answers = ranking
            .range((begin, Bound::Unbounded))
            .take_while(|(score, _)| !wanted.only_matches || f64::from_bits(score.0) >= threshold)
            .filter(|(_, id)| (wanted.accepts)(*id))
            .filter_map(|(_, id)| Some(Match::of(*id, self.entries.get(id)?.verdict(method), threshold)));
        Some(answers.take(wanted.limit).collect())
    }

    /// Models that look like the probe, best first, ties by id; `exclude` is left out (the probe itself, when
    /// stored). How likeness is measured: [`super::probe`].
    pub fn by_probe(&self, probe: &Signature, exclude: Option<ModelId>, wanted: &Wanted) -> Vec<Match> {
        let probe = Entry::new(probe);
        let mut similarities = Similarities::new(&probe);
        similarities.add_indexed(&self.index, |place| {
            let id = self.indexed_id(place).filter(|id| Some(*id) != exclude)?;
            Some((id, self.entries.get(&id)?))
        });
        for id in self.fresh.iter().filter(|id| Some(**id) != exclude) {
            similarities.add_one(*id, &self.entries[id]);
        }
        let others = self.entries.iter().filter(|(id, _)| Some(**id) != exclude);
        similarities.ranked(others, wanted)
    }

    /// The models with the least matching error to a bare triangle: exact, ties by id. The corners may come in any
    /// order. With `outward` the triangle is seen from that side; without it either side will do.
    ///
    /// `score` is 1 minus the chord between the shapes; errors are scaled as for a query by probe.
    pub fn by_triangle(&self, corners: [Point3; 3], outward: Option<Vector3>, wanted: &Wanted) -> Vec<Match> {
        let triangle = Triangle::new(corners);
        if wanted.limit == 0 || triangle.size().is_nan() || triangle.size() <= 0.0 {
            return Vec::new();
        }
        let query = TriangleQuery::new(triangle, outward);
        let threshold = wanted.threshold.unwrap_or_else(TriangleQuery::match_score);
        let mut best: BTreeMap<ModelId, (f64, u32)> = BTreeMap::new();
        for hit in self.nearest_models(&query, wanted, threshold) {
            if let Some(id) = self.indexed_id(hit.model) {
                keep_nearest(&mut best, id, hit.chord, hit.triangle);
            }
        }
        for id in &self.fresh {
            for (place, triangle) in self.entries[id].triangles.iter().enumerate() {
                keep_nearest(&mut best, *id, query.chord(&triangle.shape), place as u32);
            }
        }
        let scored = best.into_iter().map(|(id, (chord, place))| (Rank { score: score(chord), model_id: id }, place));
        let mut ranked: Vec<(Rank, u32)> =
            scored.filter(|(rank, _)| wanted.takes(rank.score, rank.model_id, threshold)).collect();
        ranked.sort_by_key(|(rank, _)| rank.key());
        ranked.truncate(wanted.limit);
        let triangle = |rank: &Rank, place: u32| &self.entries[&rank.model_id].triangles[place as usize];
        ranked.iter().map(|(rank, place)| query.answer(rank.model_id, triangle(rank, *place), threshold)).collect()
    }

    /// Every indexed triangle that can belong to one of the wanted models: the search is widened until that many
    /// models lie inside its bound, then everything within the farthest of them is taken.
    fn nearest_models(&self, query: &TriangleQuery, wanted_models: &Wanted, threshold: f64) -> Vec<Hit> {
        let limit = wanted_models.limit;
        let mut count = limit.saturating_mul(4).max(16);
        loop {
            let wanted = NonZero::new(count.min(self.index.len())).unwrap_or(NonZero::<usize>::MIN);
            let lists: Vec<Vec<Hit>> = query.shapes.iter().map(|s| self.index.nearest(s, wanted)).collect();
            let exhausted = wanted.get() >= self.index.len();
            // up to this chord every list is complete
            let bound = lists.iter().filter_map(|l| l.last()).map(|hit| hit.chord).fold(f64::INFINITY, f64::min);
            let mut best: BTreeMap<u32, f64> = BTreeMap::new();
            for hit in lists.iter().flatten().filter(|hit| self.valid[hit.model as usize]) {
                let chord = best.entry(hit.model).or_insert(f64::INFINITY);
                *chord = chord.min(hit.chord);
            }
            let complete = best.into_iter().filter(|(_, chord)| exhausted || *chord < bound);
            let mut chords: Vec<f64> = complete
                .filter(|(place, chord)| wanted_models.takes(score(*chord), self.indexed[*place as usize], threshold))
                .map(|(_, chord)| chord)
                .collect();
            chords.sort_by(f64::total_cmp);
            // scores only fall from here on
            let no_more_matches = wanted_models.only_matches && score(bound) < threshold;
            if chords.len() >= limit || exhausted || no_more_matches {
                let farthest = chords.get(limit - 1).or(chords.last()).copied().unwrap_or(0.0);
                // a hair more, so that rounding in the tree loses no tie
                return query.shapes.iter().flat_map(|s| self.index.within(s, farthest + 1e-9)).collect();
            }
            count = count.saturating_mul(4);
        }
    }

    /// The model at a place of the index, unless it was removed or replaced since.
    fn indexed_id(&self, place: u32) -> Option<ModelId> {
        self.valid[place as usize].then(|| self.indexed[place as usize])
    }

    fn rank(&mut self, id: ModelId, entry: &Entry) {
        self.by_descriptors.insert((Reverse(entry.descriptors.score.to_bits()), id));
        self.by_fit.insert((Reverse(entry.verified.score.to_bits()), id));
        self.by_literal.insert((Reverse(entry.literal.score.to_bits()), id));
    }

    /// Takes a model out of everything but the index, where its place is marked.
    fn forget(&mut self, id: ModelId) -> bool {
        let Some(entry) = self.entries.remove(&id) else { return false };
        self.by_descriptors.remove(&(Reverse(entry.descriptors.score.to_bits()), id));
        self.by_fit.remove(&(Reverse(entry.verified.score.to_bits()), id));
        self.by_literal.remove(&(Reverse(entry.literal.score.to_bits()), id));
        if !self.fresh.remove(&id)
            && let Ok(place) = self.indexed.binary_search(&id)
        {
            self.valid[place] = false;
            self.gone += 1;
        }
        true
    }

    fn reindex_if_due(&mut self) {
        if self.fresh.len() + self.gone > 64 + self.indexed.len() / 8 {
            self.reindex();
        }
    }

    fn reindex(&mut self) {
        self.index = TriangleIndex::build(self.entries.values().map(|entry| entry.triangles.as_slice()));
        self.indexed = self.entries.keys().copied().collect();
        self.valid = vec![true; self.indexed.len()];
        self.fresh.clear();
        self.gone = 0;
    }
}

/// Keeps a model's nearest triangle, of equals the first.
fn keep_nearest(best: &mut BTreeMap<ModelId, (f64, u32)>, id: ModelId, chord: f64, triangle: u32) {
    let kept = best.entry(id).or_insert((f64::INFINITY, u32::MAX));
    if (chord, triangle) < *kept {
        *kept = (chord, triangle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::signature::tests::example;

    fn signature(k: u128) -> Signature {
        example(0.37 * k as f64, 6 + (k % 4) as usize)
    }

    /// 300 models, some of them added late, some replaced, some removed.
    fn eventful() -> (Gallery, BTreeMap<ModelId, Signature>) {
        let mut truth: BTreeMap<ModelId, Signature> = (0..200).map(|k| (k, signature(k))).collect();
        let mut gallery = Gallery::build(truth.clone().into_iter().collect());
        for k in (0..200).step_by(9) {
            assert!(gallery.remove(k) && !gallery.remove(k));
            truth.remove(&k);
        }
        for k in (150..300).step_by(3) {
            gallery.insert(k, signature(k + 1000));
            truth.insert(k, signature(k + 1000));
        }
        (gallery, truth)
    }

    #[test]
    fn changes_are_seen_at_once_by_every_query() {
        let (gallery, truth) = eventful();
        assert!(!gallery.fresh.is_empty() && gallery.gone > 0, "the test must meet a delta and tombstones");
        let anew = Gallery::build(truth.iter().map(|(id, s)| (*id, s.clone())).collect());
        assert_eq!(gallery.len(), truth.len());
        for method in [MatchMethod::Descriptors, MatchMethod::Verified, MatchMethod::Literal] {
            let ranked = gallery.by_standard("face", method, &Wanted::best(1000));
            assert_eq!(ranked, anew.by_standard("face", method, &Wanted::best(1000)));
            assert_eq!(ranked.expect("the face is built in").len(), truth.len());
        }
        for k in [3, 170, 299] {
            let probe = signature(k);
            assert_eq!(
                gallery.by_probe(&probe, None, &Wanted::best(50)),
                anew.by_probe(&probe, None, &Wanted::best(50))
            );
            let corners = triangles_of(&probe)[4].corners;
            assert_eq!(
                gallery.by_triangle(corners, None, &Wanted::best(20)),
                anew.by_triangle(corners, None, &Wanted::best(20))
            );
        }
    }

    #[test]
    fn a_standard_ranks_best_first_and_ties_by_id() {
        let gallery = Gallery::build([9, 4, 7].map(|id| (id, signature(5))).into());
        let ranked = gallery.by_standard("face", MatchMethod::Literal, &Wanted::best(2)).expect("the face is built in");
        assert_eq!(ranked.iter().map(|m| m.model_id).collect::<Vec<_>>(), [4, 7]);
        assert_eq!(gallery.by_standard("teapot", MatchMethod::Literal, &Wanted::best(2)), None);
        let strict = gallery
            .by_standard("face", MatchMethod::Literal, &Wanted { threshold: Some(1.1), ..Wanted::best(1) })
            .expect("the face is built in");
        assert!(!strict[0].is_match);
    }

    #[test]
    fn a_triangle_finds_the_models_that_brute_force_finds() {
        let (gallery, truth) = eventful();
        for (k, outward) in [(12, None), (40, Some(Vector3::z())), (77, Some(-Vector3::z()))] {
            let corners = triangles_of(&signature(k))[7].corners;
            let query = TriangleQuery::new(Triangle::new(corners), outward);
            let mut brute: Vec<(f64, ModelId)> = truth
                .iter()
                .map(|(id, s)| {
                    let chords = triangles_of(s).into_iter().flat_map(|t| t.labelings()).map(|t| {
                        let sides: &[Vector3] = &[t.outward, -t.outward];
                        sides[..if outward.is_none() { 2 } else { 1 }]
                            .iter()
                            .map(|side| {
                                let [a, b, c] = t.corners;
                                let turned = [[a, b, c], [b, a, c]].map(|p| Triangle::new(p).shape(side));
                                let query = query.triangle.shape(&query.outward);
                                turned.iter().map(|s| s.chord(&query)).fold(f64::INFINITY, f64::min)
                            })
                            .fold(f64::INFINITY, f64::min)
                    });
                    (chords.fold(f64::INFINITY, f64::min), *id)
                })
                .collect();
            brute.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let found = gallery.by_triangle(corners, outward, &Wanted::best(25));
            assert_eq!(found.len(), 25);
            for (found, (chord, _)) in found.iter().zip(&brute) {
                assert!((1.0 - found.score - chord).abs() < 1e-9, "{} {chord}", 1.0 - found.score);
                assert!(found.sum_of_distances_mm <= 3f64.sqrt() * found.matching_error_mm + 1e-9);
            }
        }
        assert!(gallery.by_triangle([Point3::origin(); 3], None, &Wanted::best(5)).is_empty());
        assert!(
            gallery
                .by_triangle(
                    [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)],
                    None,
                    &Wanted::best(0)
                )
                .is_empty()
        );
    }

    /// All pages of a ranking, one after the other.
    fn paged(limit: usize, page: impl Fn(&Wanted) -> Vec<Match>) -> Vec<Match> {
        let mut all: Vec<Match> = Vec::new();
        loop {
            let after = all.last().map(|last| Rank { score: last.score, model_id: last.model_id });
            let next = page(&Wanted { after, ..Wanted::best(limit) });
            let ends = next.len() < limit;
            all.extend(next);
            if ends {
                return all;
            }
        }
    }

    #[test]
    fn pages_and_filters_give_what_the_whole_ranking_gives() {
        let (gallery, truth) = eventful();
        let probe = signature(3);
        let corners = triangles_of(&probe)[4].corners;
        let standard = |w: &Wanted| gallery.by_standard("face", MatchMethod::Verified, w).expect("built in");
        let like = |w: &Wanted| gallery.by_probe(&probe, None, w);
        let triangle = |w: &Wanted| gallery.by_triangle(corners, None, w);
        let rankings: [&dyn Fn(&Wanted) -> Vec<Match>; 3] = [&standard, &like, &triangle];
        for ranking in rankings {
            let whole = ranking(&Wanted::best(1000));
            assert!(whole.len() > truth.len() / 2);
            assert_eq!(paged(7, ranking), whole);
            let odd = |id: ModelId| id % 2 == 1;
            let some: Vec<Match> = whole.iter().filter(|m| odd(m.model_id)).take(11).cloned().collect();
            assert_eq!(ranking(&Wanted { accepts: &odd, ..Wanted::best(11) }), some);
            let threshold = Some(whole[20].score);
            let matches = ranking(&Wanted { threshold, only_matches: true, ..Wanted::best(1000) });
            assert!(matches.len() >= 21 && matches.iter().all(|m| m.is_match));
            let ids = |list: &[Match]| list.iter().map(|m| m.model_id).collect::<Vec<_>>();
            assert_eq!(ids(&matches), ids(&whole[..matches.len()]));
            assert!(whole.get(matches.len()).is_none_or(|next| next.score < whole[20].score));
        }
    }

    #[test]
    fn a_stored_model_is_most_like_itself_and_can_be_left_out() {
        let (gallery, truth) = eventful();
        let (id, probe) = truth.iter().nth(20).expect("200 models");
        let ranked = gallery.by_probe(probe, None, &Wanted::best(3));
        assert_eq!(ranked[0].model_id, *id);
        assert!((ranked[0].score - 1.0).abs() < 1e-12 && ranked[0].matching_error_mm < 1e-9);
        assert!(gallery.by_probe(probe, Some(*id), &Wanted::best(300)).iter().all(|m| m.model_id != *id));
    }

    #[test]
    fn an_empty_gallery_answers_with_nothing() {
        let mut gallery = Gallery::default();
        assert!(gallery.is_empty() && !gallery.remove(1));
        assert_eq!(gallery.by_standard("face", MatchMethod::Literal, &Wanted::best(5)), Some(Vec::new()));
        assert!(gallery.by_probe(&signature(1), None, &Wanted::best(5)).is_empty());
        let corners = triangles_of(&signature(1))[0].corners;
        assert!(gallery.by_triangle(corners, None, &Wanted::best(5)).is_empty());
    }
}
