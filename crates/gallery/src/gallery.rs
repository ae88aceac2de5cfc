//! The models that are kept, ranked and searchable; current as soon as a change returns.
//!
//! A gallery is a list of parts, each a segment that never changes and marks for those of its models that are gone.
//! A clone shares the segments, so a search works on the gallery as it was when it began while changes make the next.
//! What is added is searched like everything else: it goes into a small segment, and small ones become larger ones
//! ([`super::merge`]).

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::indexed_model::{self, IndexedModel};
use super::live_segment::LiveSegment;
use super::merged_ranking;
use super::probe::{Likeness, Probe};
use super::segment::{Kept, Segment};
use super::triangle_query::TriangleQuery;
use super::{Match, MatchMethod, ModelId, TopK};
use visage_geometry::{Point3, Vector3};
use visage_shape::faces::{Signature, Triangle, judgement, standard};

/// So many models make a full segment: a search visits few of them, and none takes long to build.
pub const FULL_SEGMENT: usize = 1 << 16;
/// Additions go into one segment, built anew each time, until it has so many.
pub(super) const YOUNG_SEGMENT: usize = 64;

/// The signatures of all stored models, searchable. A clone is cheap and stays as it is.
#[derive(Debug, Clone, Default)]
pub struct Gallery {
    pub(super) segments: Vec<LiveSegment>,
}

impl Gallery {
    /// An index over all `entries`; of entries with one id the last counts. Runs inside the caller's rayon pool.
    pub fn build(entries: Vec<(ModelId, Signature)>) -> Self {
        let distinct: BTreeMap<ModelId, Signature> = entries.into_iter().collect();
        let entries: Vec<IndexedModel> =
            distinct.into_par_iter().map(|(id, signature)| IndexedModel::new(id, signature)).collect();
        let mut gallery = Gallery::default();
        for chunk in entries.chunks(FULL_SEGMENT) {
            gallery.append(chunk);
        }
        gallery
    }

    /// Adds models that are not in it yet, as a segment of their own. Runs inside the caller's rayon pool.
    pub fn append(&mut self, entries: &[IndexedModel]) {
        if !entries.is_empty() {
            self.segments.push(LiveSegment::new(Segment::build(&[], entries)));
        }
    }

    /// Adds or replaces a model; seen by the next search.
    pub fn insert(&mut self, id: ModelId, signature: Signature) {
        self.put(&IndexedModel::new(id, signature));
    }

    /// [`Gallery::insert`] of a model that was made ready elsewhere.
    pub fn put(&mut self, entry: &IndexedModel) {
        self.remove(entry.id());
        let young = self.segments.pop_if(|live| live.is_young() && live.segment.ids.len() < 2 * YOUNG_SEGMENT);
        let kept: Vec<Kept> = young.iter().map(LiveSegment::kept).collect();
        let segment = Segment::build(&kept, std::slice::from_ref(entry));
        self.segments.push(LiveSegment::new(segment));
    }

    /// Forgets a model; true if it was there.
    pub fn remove(&mut self, id: ModelId) -> bool {
        let was_there = self.segments.iter_mut().any(|live| live.forget(id));
        self.segments.retain(|live| live.models > 0);
        was_there
    }

    /// The same without the models that `keeps` does not want; shares the segments. Looks at each model's id.
    #[must_use]
    pub fn only(&self, keeps: impl Fn(ModelId) -> bool) -> Gallery {
        let kept = self.segments.iter().map(|live| live.only(&keeps)).filter(|live| live.models > 0);
        Gallery { segments: kept.collect() }
    }

    /// Takes over another gallery, none of whose models is in this one.
    pub fn absorb(&mut self, other: Gallery) {
        // not at the end: the last is the one that additions go to
        self.segments.splice(0..0, other.segments);
    }

    /// The number of models.
    pub fn len(&self) -> usize {
        self.segments.iter().map(|live| live.models).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Models judged against the named built-in standard ("face"), best first, ties by id; `None` if there is no
    /// such standard. The threshold (default [`judgement::MATCH_SCORE`]) decides `is_match`.
    pub fn by_standard(&self, standard: &str, method: MatchMethod, top_k: &TopK) -> Option<Vec<Match>> {
        standard::by_name(standard)?;
        let threshold = top_k.threshold.unwrap_or(judgement::MATCH_SCORE);
        let ranked = merged_ranking::ranked(&self.segments, indexed_model::slot(method), top_k.after)
            .take_while(|(_, standing)| !top_k.only_matches || standing.score >= threshold)
            .filter(|(id, _)| (top_k.accepts)(*id));
        Some(ranked.take(top_k.limit).map(|(id, standing)| standing.answer(id, threshold)).collect())
    }

    /// Models that look like the probe, best first, ties by id; `exclude` is left out (the probe itself, when
    /// stored). How likeness is measured: [`super::probe`].
    pub fn by_probe(&self, probe: &Signature, exclude: Option<ModelId>, top_k: &TopK) -> Vec<Match> {
        let accepts = |id| Some(id) != exclude && (top_k.accepts)(id);
        Probe::new(probe).search(&self.segments, &TopK { accepts: &accepts, ..*top_k })
    }

    /// [`Gallery::by_probe`], or the same by another likeness.
    pub fn by_likeness(
        &self,
        probe: &Signature,
        likeness: Likeness,
        exclude: Option<ModelId>,
        top_k: &TopK,
    ) -> Vec<Match> {
        let accepts = |id| Some(id) != exclude && (top_k.accepts)(id);
        match likeness {
            Likeness::Shape => self.by_probe(probe, exclude, top_k),
            Likeness::SalientRegions => {
                Probe::new(probe).search_by_regions(&self.segments, &TopK { accepts: &accepts, ..*top_k })
            }
            Likeness::View => Probe::new(probe).search_by_view(&self.segments, &TopK { accepts: &accepts, ..*top_k }),
        }
    }

    /// The models with the least matching error to a bare triangle: exact, ties by id. The corners may come in any
    /// order. With `outward` the triangle is seen from that side; without it either side will do.
    ///
    /// `score` is 1 minus the chord between the shapes; errors are scaled as for a query by probe.
    pub fn by_triangle(&self, corners: [Point3; 3], outward: Option<Vector3>, top_k: &TopK) -> Vec<Match> {
        let triangle = Triangle::new(corners);
        if top_k.limit == 0 || !triangle.size().is_finite() || triangle.size() <= 0.0 {
            return Vec::new();
        }
        TriangleQuery::new(triangle, outward).search(&self.segments, top_k)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Rank;
    use super::super::outline::triangles_of;
    use super::*;
    use proptest::prelude::*;
    use visage_shape::faces::signature::example::example;

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
        assert!(gallery.segments.iter().any(|live| live.models < live.segment.ids.len()), "the test must meet gaps");
        let anew = Gallery::build(truth.iter().map(|(id, s)| (*id, s.clone())).collect());
        assert_eq!(gallery.len(), truth.len());
        for method in indexed_model::METHODS {
            let ranked = gallery.by_standard("face", method, &TopK::best(1000));
            assert_eq!(ranked, anew.by_standard("face", method, &TopK::best(1000)));
            assert_eq!(ranked.expect("the face is built in").len(), truth.len());
        }
        for k in [3, 170, 299] {
            let probe = signature(k);
            assert_eq!(gallery.by_probe(&probe, None, &TopK::best(50)), anew.by_probe(&probe, None, &TopK::best(50)));
            let corners = triangles_of(&probe)[4].corners;
            assert_eq!(
                gallery.by_triangle(corners, None, &TopK::best(20)),
                anew.by_triangle(corners, None, &TopK::best(20))
            );
        }
    }

    #[test]
    fn a_clone_stays_as_it_was() {
        let (mut gallery, truth) = eventful();
        let before = gallery.clone();
        assert!(gallery.remove(1));
        gallery.insert(999, signature(1));
        assert_eq!((before.len(), gallery.len()), (truth.len(), truth.len()));
        let best = before.by_probe(&signature(1), None, &TopK::best(1));
        assert_eq!(best[0].model_id, 1);
        assert_eq!(gallery.by_probe(&signature(1), None, &TopK::best(1))[0].model_id, 999);
    }

    #[test]
    fn a_standard_ranks_best_first_and_ties_by_id() {
        let mut gallery = Gallery::build([9, 4].map(|id| (id, signature(5))).into());
        gallery.insert(7, signature(5));
        let ranked = gallery.by_standard("face", MatchMethod::Literal, &TopK::best(2)).expect("the face is built in");
        assert_eq!(ranked.iter().map(|m| m.model_id).collect::<Vec<_>>(), [4, 7]);
        assert_eq!(gallery.by_standard("teapot", MatchMethod::Literal, &TopK::best(2)), None);
        let strict = gallery
            .by_standard("face", MatchMethod::Literal, &TopK { threshold: Some(1.1), ..TopK::best(1) })
            .expect("the face is built in");
        assert!(!strict[0].is_match);
        let odd = TopK { accepts: &|id| id % 2 == 1, ..TopK::best(2) };
        let odd = gallery.by_standard("face", MatchMethod::Literal, &odd).expect("the face is built in");
        assert_eq!(odd.iter().map(|m| m.model_id).collect::<Vec<_>>(), [7, 9]);
    }

    /// Every model's chord from its nearest triangle, least first, ties by id.
    fn brute_force(truth: &BTreeMap<ModelId, Signature>, query: &TriangleQuery) -> Vec<(f64, ModelId)> {
        let chord = |s: &Signature| triangles_of(s).iter().map(|t| query.chord(&t.shape)).fold(f64::INFINITY, f64::min);
        let mut brute: Vec<(f64, ModelId)> = truth.iter().map(|(id, s)| (chord(s), *id)).collect();
        brute.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        brute
    }

    #[test]
    fn a_triangle_is_met_in_every_labelling_and_from_the_right_sides() {
        let (gallery, truth) = eventful();
        for (k, outward) in [(12, None), (40, Some(Vector3::z())), (77, Some(-Vector3::z()))] {
            let corners = triangles_of(&signature(k))[7].corners;
            let query = TriangleQuery::new(Triangle::new(corners), outward);
            let mut brute: Vec<f64> = truth
                .values()
                .map(|s| {
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
                    chords.fold(f64::INFINITY, f64::min)
                })
                .collect();
            brute.sort_by(f64::total_cmp);
            let found = gallery.by_triangle(corners, outward, &TopK::best(25));
            assert_eq!(found.len(), 25);
            for (found, chord) in found.iter().zip(&brute) {
                assert!((1.0 - found.score - chord).abs() < 1e-9, "{} {chord}", 1.0 - found.score);
                assert!(found.sum_of_distances_mm <= 3f64.sqrt() * found.matching_error_mm + 1e-9);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]
        // changes: below 60 an addition or replacement, else a removal; of 20 different signatures, so that there are ties
        #[test]
        fn whatever_happened_a_triangle_finds_what_brute_force_finds(
            changes in prop::collection::vec((0u8..100, 0u128..60), 0..120), built in 0u128..40,
            queries in prop::collection::vec((0u128..25, 0usize..20, any::<bool>()), 1..4), limit in 1usize..30,
        ) {
            let mut truth: BTreeMap<ModelId, Signature> = (0..built).map(|k| (k, signature(k % 20))).collect();
            let mut gallery = Gallery::build(truth.clone().into_iter().collect());
            for (step, (kind, id)) in changes.into_iter().enumerate() {
                if kind < 60 {
                    gallery.insert(id, signature(u128::from(kind % 20)));
                    truth.insert(id, signature(u128::from(kind % 20)));
                } else {
                    prop_assert_eq!(gallery.remove(id), truth.remove(&id).is_some());
                }
                if step % 50 == 49 {
                    gallery.tidy();
                }
            }
            for (k, number, from_one_side) in queries {
                let corners = triangles_of(&signature(k))[number].corners;
                let outward = from_one_side.then(Vector3::z);
                let query = TriangleQuery::new(Triangle::new(corners), outward);
                let found = gallery.by_triangle(corners, outward, &TopK::best(limit));
                let found: Vec<(f64, ModelId)> = found.into_iter().map(|m| (1.0 - m.score, m.model_id)).collect();
                let brute: Vec<(f64, ModelId)> = brute_force(&truth, &query).into_iter().take(limit).collect();
                prop_assert_eq!(found.len(), brute.len());
                for (found, brute) in found.into_iter().zip(brute) {
                    prop_assert!(found.1 == brute.1 && (found.0 - brute.0).abs() < 1e-15);
                }
            }
        }
    }

    #[test]
    fn nonsense_for_a_triangle_finds_nothing() {
        let (gallery, _) = eventful();
        assert!(gallery.by_triangle([Point3::origin(); 3], None, &TopK::best(5)).is_empty());
        let corners = [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
        assert!(gallery.by_triangle(corners, None, &TopK::best(0)).is_empty());
        assert!(
            gallery
                .by_triangle([corners[0], corners[1], Point3::new(f64::NAN, 0.0, 0.0)], None, &TopK::best(5))
                .is_empty()
        );
    }

    /// All pages of a ranking, one after the other.
    fn paged(limit: usize, page: impl Fn(&TopK) -> Vec<Match>) -> Vec<Match> {
        let mut all: Vec<Match> = Vec::new();
        loop {
            let after = all.last().map(|last| Rank { score: last.score, model_id: last.model_id });
            let next = page(&TopK { after, ..TopK::best(limit) });
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
        let standard = |w: &TopK| gallery.by_standard("face", MatchMethod::Verified, w).expect("built in");
        let like = |w: &TopK| gallery.by_probe(&probe, None, w);
        let triangle = |w: &TopK| gallery.by_triangle(corners, None, w);
        type Ranking<'a> = &'a dyn Fn(&TopK) -> Vec<Match>;
        let rankings: [Ranking; 3] = [&standard, &like, &triangle];
        for ranking in rankings {
            let whole = ranking(&TopK::best(1000));
            assert!(whole.len() > truth.len() / 2);
            assert_eq!(paged(7, ranking), whole);
            let odd = |id: ModelId| id % 2 == 1;
            let some: Vec<Match> = whole.iter().filter(|m| odd(m.model_id)).take(11).cloned().collect();
            assert_eq!(ranking(&TopK { accepts: &odd, ..TopK::best(11) }), some);
            let threshold = Some(whole[20].score);
            let matches = ranking(&TopK { threshold, only_matches: true, ..TopK::best(1000) });
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
        let ranked = gallery.by_probe(probe, None, &TopK::best(3));
        assert_eq!(ranked[0].model_id, *id);
        assert!((ranked[0].score - 1.0).abs() < 1e-12 && ranked[0].matching_error_mm < 1e-9);
        assert!(gallery.by_probe(probe, Some(*id), &TopK::best(300)).iter().all(|m| m.model_id != *id));
    }

    #[test]
    fn an_empty_gallery_answers_with_nothing() {
        let mut gallery = Gallery::default();
        assert!(gallery.is_empty() && !gallery.remove(1));
        assert_eq!(gallery.by_standard("face", MatchMethod::Literal, &TopK::best(5)), Some(Vec::new()));
        assert!(gallery.by_probe(&signature(1), None, &TopK::best(5)).is_empty());
        let corners = triangles_of(&signature(1))[0].corners;
        assert!(gallery.by_triangle(corners, None, &TopK::best(5)).is_empty());
    }
}
