//! The search for the stored models that look like a probe most; what that means is told in [`super::likeness`].
//!
//! Cheap lower bounds rule out most models, and only the rest are measured ([`super::probe_pass`]). For models that dense signatures
//! alone do not decide, codes of their shapes give an upper bound of the score; these models are visited in falling order of that
//! bound, and their shapes are compared until no bound is high enough. The answer is the same as if all were measured.

use rayon::prelude::*;

use super::best::Best;
use super::dense_rows::DenseProbe;
use super::likeness::{Weights, as_things};
use super::live_segment::LiveSegment;
use super::outline::Outlines;
use super::region_likeness::{ProbeRegions, RegionLikeness};
use super::{Match, MatchMethod, ModelId, TopK};
use visage_shape::descriptor::ShapeDescriptor;
use visage_shape::faces::standard::FaceStandard;
use visage_shape::faces::{self, Signature, standard};

/// Scores from this on count as a match.
pub const PROBE_MATCH_SCORE: f64 = 0.5;
/// Models whose shapes are looked at together, by all threads.
const BATCH: usize = 256;
/// Models that are put in order together: few have to be looked at.
const LOOKED_AT: usize = 16 * BATCH;

/// What makes models alike.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Likeness {
    /// Their faces if both have one, else their shapes as wholes.
    #[default]
    Shape,
    /// The paper's: triangles of salient regions.
    SalientRegions,
    /// That the probe is a single scan of the model.
    View,
}

/// A probe made ready.
pub(super) struct Probe {
    regions: ProbeRegions,
    pub shape: Option<ShapeDescriptor>,
    pub dense: Option<DenseProbe>,
    /// How surely it is a face, in [0, 1].
    pub face_score: f64,
}

/// A stored model: part and place.
pub(super) type Address = (usize, u32);

/// A model whose score depends on its shape, and the highest that it can be.
pub(super) struct Unsure {
    pub most: f64,
    pub id: ModelId,
    pub address: Address,
}

/// What a search has found so far. Costs are negative scores.
pub(super) struct Found<'a> {
    best: Best<Address>,
    pub top_k: &'a TopK<'a>,
    threshold: f64,
}

impl<'a> Found<'a> {
    /// Nothing yet.
    pub fn new(top_k: &'a TopK<'a>) -> Found<'a> {
        let threshold = top_k.threshold.unwrap_or(PROBE_MATCH_SCORE);
        Found { best: Best::new(top_k.limit), top_k, threshold }
    }

    /// The least score with which a model may still come in.
    pub fn least(&self) -> f64 {
        let matching = if self.top_k.only_matches { self.threshold } else { f64::NEG_INFINITY };
        matching.max(-self.best.reach())
    }

    pub fn offer(&mut self, id: ModelId, address: Address, score: f64) {
        if score > 0.0 && self.best.would_take(-score, id, &address) && self.top_k.takes(score, id, self.threshold) {
            self.best.offer(-score, id, address);
        }
    }
}

/// The [`LOOKED_AT`] that may score most, the greatest first, and all others.
fn best_first(models: &mut [Unsure]) -> (&mut [Unsure], &mut [Unsure]) {
    let order = |a: &Unsure, b: &Unsure| b.most.total_cmp(&a.most).then(a.id.cmp(&b.id));
    let count = LOOKED_AT.min(models.len());
    if count < models.len() {
        models.select_nth_unstable_by(count, order);
    }
    let (first, others) = models.split_at_mut(count);
    first.sort_unstable_by(order);
    (first, others)
}

impl Probe {
    pub fn new(signature: &Signature) -> Probe {
        let face_score = faces::judge(signature, &standard::face(), MatchMethod::Verified).score;
        Probe {
            regions: ProbeRegions::new(signature),
            shape: signature.shape().cloned(),
            dense: signature.dense().map(DenseProbe::new),
            face_score,
        }
    }

    /// The most similar models, best first, ties by id; those with nothing in common are left out.
    pub fn search(&self, segments: &[LiveSegment], top_k: &TopK) -> Vec<Match> {
        let mut found = Found::new(top_k);
        let mut others = Vec::new();
        for which in 0..segments.len() {
            self.scan(segments, which, &mut found, &mut others);
        }
        let least = found.least();
        let mut unsure: Vec<Unsure> = others.into_iter().filter(|model| model.most >= least).collect();
        let mut rest = unsure.as_mut_slice();
        while !rest.is_empty() {
            let (batch, later) = best_first(rest);
            for models in batch.chunks(BATCH) {
                let least = found.least();
                let scores: Vec<f64> =
                    models.par_iter().map(|model| self.score_from(segments, model.address, least)).collect();
                for (model, score) in models.iter().zip(scores) {
                    found.offer(model.id, model.address, score);
                }
                if models.last().is_some_and(|model| model.most < found.least()) {
                    return self.answers(segments, found);
                }
            }
            rest = later;
        }
        self.answers(segments, found)
    }

    pub fn answers(&self, segments: &[LiveSegment], found: Found) -> Vec<Match> {
        let threshold = found.threshold;
        let ranked: Vec<(f64, ModelId, Address)> = found.best.into_ranked().collect();
        ranked.into_par_iter().map(|(cost, id, address)| self.answer(segments, -cost, id, address, threshold)).collect()
    }

    pub fn weights(&self, live: &LiveSegment, place: u32) -> Weights {
        let segment = &live.segment;
        let both_have_dense = self.dense.is_some() && !segment.dense.is_missing(place);
        Weights::new(self.face_score, segment.face_scores[place as usize], both_have_dense)
    }

    /// A model's likeness, or 0 if it is surely less than `least`.
    fn score_from(&self, segments: &[LiveSegment], (which, place): Address, least: f64) -> f64 {
        let weights = self.weights(&segments[which], place);
        let distance = self.shape.as_ref().zip(segments[which].segment.shapes.shape(place)).map(|(a, b)| a.distance(b));
        let things = as_things(distance);
        let dense = self.dense.as_ref().filter(|_| weights.dense > 0.0);
        if dense.is_some() && weights.likeness(Some(0.0), things) < least {
            return 0.0;
        }
        let distance_mm = dense.and_then(|dense| dense.distance_mm(&segments[which].segment.dense, place));
        weights.likeness(distance_mm, things)
    }

    /// Offers a model that is not compared by its dense signature alone.
    pub fn offer_thing(&self, segments: &[LiveSegment], address: Address, found: &mut Found) {
        let score = self.score_from(segments, address, found.least());
        found.offer(segments[address.0].segment.ids[address.1 as usize], address, score);
    }

    pub fn regions_of(&self, segments: &[LiveSegment], (which, place): Address) -> RegionLikeness {
        self.regions.likeness(&segments[which].segment.outlines.outline(place))
    }

    fn answer(
        &self,
        segments: &[LiveSegment],
        score: f64,
        model_id: ModelId,
        address: Address,
        threshold: f64,
    ) -> Match {
        let size = FaceStandard::face_size();
        let pair = self.regions_of(segments, address).best;
        Match {
            model_id,
            score,
            matching_error_mm: pair.as_ref().map_or(size, |pair| size * pair.chord),
            sum_of_distances_mm: pair.as_ref().map_or(3f64.sqrt() * size, |pair| self.regions.least_sum(pair, size)),
            is_match: score >= threshold,
            triangle: pair.map(|pair| pair.found.corners.map(|p| p.into())),
        }
    }
}

/// How a probe and a model compare, figure by figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// How far the probe's triangles of salient regions occur on the model, in [0, 1].
    pub region_triangles: f64,
    /// How probably they are of one class by their shapes as wholes.
    pub shape: f64,
    /// How surely both are faces, in [0, 1].
    pub both_faces: f64,
    /// How far their faces are apart, mm on the standard; `None` unless both have one.
    pub dense_distance_mm: Option<f64>,
}

/// The score of each model by a query with this probe, from its definition: nothing is left out by a bound.
pub fn likenesses(probe: &Signature, models: &[Signature]) -> Vec<f64> {
    let ready = Probe::new(probe);
    let likeness = |model: &Signature| {
        let score = faces::judge(model, &standard::face(), MatchMethod::Verified).score;
        let both = probe.dense().zip(model.dense());
        let weights = Weights::new(ready.face_score, score, both.is_some());
        let things = as_things(probe.shape().zip(model.shape()).map(|(a, b)| a.distance(b)));
        weights.likeness(both.and_then(|(a, b)| a.distance_mm(b)), things)
    };
    models.par_iter().map(likeness).collect()
}

/// Compares two models: what the score of a query by probe is made of.
pub fn compare(probe: &Signature, model: &Signature) -> Comparison {
    let (ready, other) = (Probe::new(probe), Probe::new(model));
    let mut outlines = Outlines::default();
    outlines.push(model);
    Comparison {
        region_triangles: ready.regions.likeness(&outlines.outline(0)).mean,
        shape: as_things(probe.shape().zip(model.shape()).map(|(a, b)| a.distance(b))),
        both_faces: ready.face_score * other.face_score,
        dense_distance_mm: probe.dense().zip(model.dense()).and_then(|(a, b)| a.distance_mm(b)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Gallery;
    use super::*;
    use visage_shape::faces::signature::example::example;

    /// The score of every model, from the definition, best first.
    fn brute_force(probe: &Signature, models: &[(ModelId, Signature)]) -> Vec<(f64, ModelId)> {
        let signatures: Vec<Signature> = models.iter().map(|(_, signature)| signature.clone()).collect();
        let scores = likenesses(probe, &signatures).into_iter().zip(models.iter().map(|(id, _)| *id));
        let mut scores: Vec<(f64, ModelId)> = scores.filter(|(score, _)| *score > 0.0).collect();
        scores.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        scores
    }

    #[test]
    fn a_search_finds_what_measuring_all_finds() {
        // residuals are 1.5 + sin(seed) mm: sure faces, unsure ones and others; ids fall as seeds rise, and some are twice there
        let model = |k: u32| match example(0.13 * f64::from(k % 200), 4 + (k % 5) as usize) {
            of_no_shape if k % 7 == 3 => of_no_shape.with_shape(None),
            signature => signature,
        };
        let models: Vec<(ModelId, Signature)> = (0..300u32).map(|k| (1000 - ModelId::from(k), model(k))).collect();
        let mut gallery = Gallery::build(models[..250].to_vec());
        for (id, signature) in &models[250..] {
            gallery.insert(*id, signature.clone());
        }
        for (seed, regions) in [(-1.0, 8), (0.9, 6), (1.6, 7), (1.2, 2)] {
            let probe = example(seed, regions);
            let brute = brute_force(&probe, &models);
            for limit in [1, 20, 120, 1000] {
                let found = gallery.by_probe(&probe, None, &TopK::best(limit));
                let found: Vec<(f64, ModelId)> = found.into_iter().map(|m| (m.score, m.model_id)).collect();
                assert_eq!(found, brute[..limit.min(brute.len())], "seed {seed}, limit {limit}");
            }
            let even = |id: ModelId| id.is_multiple_of(2);
            let found = gallery.by_probe(&probe, None, &TopK { accepts: &even, ..TopK::best(30) });
            let expected: Vec<ModelId> = brute.iter().map(|b| b.1).filter(|id| even(*id)).take(30).collect();
            assert_eq!(found.iter().map(|m| m.model_id).collect::<Vec<_>>(), expected);
        }
    }
}
