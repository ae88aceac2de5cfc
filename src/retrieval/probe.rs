//! How much a stored model looks like a probe: do the probe's triangles of salient regions occur on it, with the
//! same shape, the same relative size and the same pattern of caps and pits?
//!
//! Turn, place and scale don't matter. A triangle counts `(1 - d^2)^2` for the most similar one of the model, `d`
//! being the distance in shape and size in units of [`MOST_CHORD`] and [`MOST_LOG_SIZE`]; the score is the mean over
//! the probe's triangles. Two models that are both surely faces are alike for that alone; how much more is told by
//! their dense signatures, not by triangles: the places where a face is salient are the same on everyone.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::gallery::Entry;
use super::triangle_index::TriangleIndex;
use super::triangle_query::scaled;
use super::triangles::{IndexedTriangle, Origin};
use super::{Match, ModelId, Wanted};
use crate::faces::standard::Standard;
use crate::faces::{Signature, Triangle, sum_of_distances};

/// Triangles farther apart than this on the sphere (of radius 1/2) have nothing in common.
const MOST_CHORD: f64 = 0.08;
/// Nor have those whose relative sizes differ by more than this, as a logarithm.
const MOST_LOG_SIZE: f64 = 0.2;
/// The likeness of two sure faces that have nothing else in common.
const FACE_KINSHIP: f64 = 0.5;
/// The dense distance at which two faces are half-way between one person's and two people's, mm on the standard: one
/// head twice, with noise and holes, 0.2 to 0.5 (30 heads of the public set); two heads 0.7 and more in 99 of 100 pairs.
pub const SAME_PERSON_MM: f64 = 0.6;
/// Scores from this on count as a match.
pub const PROBE_MATCH_SCORE: f64 = 0.4;

/// What is known of one model's likeness.
#[derive(Debug, Clone, Copy)]
struct Likeness {
    total: f64,
    /// Chord of the best pair, the probe's triangle and the model's.
    best: (f64, u32, u32),
}

/// Gathers likenesses of many models with one probe.
pub(super) struct Similarities<'a> {
    probe: &'a Entry,
    /// Places of the probe's region triangles.
    places: Vec<u32>,
    found: BTreeMap<ModelId, Likeness>,
}

/// One probe triangle's best counterpart on a model.
type Counterpart = (ModelId, f64, (f64, u32, u32));

impl<'a> Similarities<'a> {
    pub(super) fn new(probe: &'a Entry) -> Self {
        let places = (0..probe.triangles.len() as u32)
            .filter(|place| probe.triangles[*place as usize].origin == Origin::Regions)
            .collect();
        Similarities { probe, places, found: BTreeMap::new() }
    }

    /// Counts all models of an index; `model` gives a place's id and entry, or `None` for one to leave out.
    pub(super) fn add_indexed<'b>(
        &mut self,
        index: &TriangleIndex,
        model: impl Fn(u32) -> Option<(ModelId, &'b Entry)> + Sync,
    ) {
        let lists: Vec<Vec<Counterpart>> = self
            .places
            .par_iter()
            .map(|&place| {
                let probe = &self.probe.triangles[place as usize];
                let mut counterparts = Vec::new();
                for labelled in probe.labelings() {
                    for hit in index.within(&labelled.shape, MOST_CHORD) {
                        let Some((id, entry)) = model(hit.model) else { continue };
                        let other = &entry.triangles[hit.triangle as usize];
                        if let Some((kernel, chord)) = alike(&labelled, other) {
                            counterparts.push((id, kernel, (chord, place, hit.triangle)));
                        }
                    }
                }
                best_of_each_model(counterparts)
            })
            .collect();
        for counterpart in lists.into_iter().flatten() {
            self.count(counterpart);
        }
    }

    /// Counts one model, triangle by triangle.
    pub(super) fn add_one(&mut self, id: ModelId, entry: &Entry) {
        for index in 0..self.places.len() {
            let place = self.places[index];
            let mut counterparts = Vec::new();
            for labelled in self.probe.triangles[place as usize].labelings() {
                for (triangle, other) in entry.triangles.iter().enumerate() {
                    if let Some((kernel, chord)) = alike(&labelled, other) {
                        counterparts.push((id, kernel, (chord, place, triangle as u32)));
                    }
                }
            }
            for counterpart in best_of_each_model(counterparts) {
                self.count(counterpart);
            }
        }
    }

    fn count(&mut self, (id, kernel, pair): Counterpart) {
        let likeness =
            self.found.entry(id).or_insert(Likeness { total: 0.0, best: (f64::INFINITY, u32::MAX, u32::MAX) });
        likeness.total += kernel;
        if pair < likeness.best {
            likeness.best = pair;
        }
    }

    /// The wanted of `models`, most similar first, ties by id; those with nothing in common are left out.
    pub(super) fn ranked<'b>(
        &self,
        models: impl Iterator<Item = (&'b ModelId, &'b Entry)>,
        wanted: &Wanted,
    ) -> Vec<Match> {
        let threshold = wanted.threshold.unwrap_or(PROBE_MATCH_SCORE);
        let mut scored: Vec<(f64, ModelId, &Entry)> = models
            .map(|(id, entry)| (self.likeness(entry, self.regions(*id)), *id, entry))
            .filter(|(score, id, _)| *score > 0.0 && wanted.takes(*score, *id, threshold))
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        scored.truncate(wanted.limit);
        scored.into_iter().map(|(score, id, entry)| self.answer(score, id, entry, threshold)).collect()
    }

    /// How far the probe's triangles occur on a model, in [0, 1].
    fn regions(&self, id: ModelId) -> f64 {
        self.found.get(&id).map_or(0.0, |likeness| likeness.total / self.places.len().max(1) as f64)
    }

    fn dense_distance_mm(&self, entry: &Entry) -> Option<f64> {
        self.probe.dense.as_ref().zip(entry.dense.as_ref()).and_then(|(a, b)| a.distance_mm(b))
    }

    /// Likeness by regions, and in so far as both are faces by their dense signatures.
    fn likeness(&self, entry: &Entry, regions: f64) -> f64 {
        let both_faces = self.probe.face_score() * entry.face_score();
        let as_faces = match self.dense_distance_mm(entry) {
            Some(distance_mm) => FACE_KINSHIP + (1.0 - FACE_KINSHIP) * same_person(distance_mm),
            None => regions + (1.0 - regions) * FACE_KINSHIP,
        };
        regions + both_faces * (as_faces - regions)
    }

    fn answer(&self, score: f64, model_id: ModelId, entry: &Entry, threshold: f64) -> Match {
        let size = Standard::face_size();
        let pair = self.found.get(&model_id).map(|likeness| {
            let (chord, place, triangle) = likeness.best;
            (chord, &self.probe.triangles[place as usize], &entry.triangles[triangle as usize])
        });
        let error = pair.map_or(size, |(chord, ..)| size * chord);
        let sum = pair.map_or(3f64.sqrt() * size, |(_, probe, other)| least_sum(probe, other, size));
        Match {
            model_id,
            score,
            matching_error_mm: error,
            sum_of_distances_mm: sum,
            is_match: score >= threshold,
            triangle: pair.map(|(_, _, other)| other.corners.map(|p| p.into())),
        }
    }
}

/// How a probe and a model compare, figure by figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// How far the probe's triangles of salient regions occur on the model, in [0, 1].
    pub region_triangles: f64,
    /// How alike their shapes are as wholes, in [0, 1].
    pub shape: f64,
    /// How surely both are faces, in [0, 1].
    pub both_faces: f64,
    /// How far their faces are apart, mm on the standard; `None` unless both have one.
    pub dense_distance_mm: Option<f64>,
}

/// Compares two models: what the score of a query by probe is made of.
pub fn compare(probe: &Signature, model: &Signature) -> Comparison {
    let (probe, model) = (Entry::new(probe), Entry::new(model));
    let mut similarities = Similarities::new(&probe);
    similarities.add_one(0, &model);
    Comparison {
        region_triangles: similarities.regions(0),
        shape: 0.0,
        both_faces: probe.face_score() * model.face_score(),
        dense_distance_mm: similarities.dense_distance_mm(&model),
    }
}

/// In (0, 1]: 1 at no distance, a half at [`SAME_PERSON_MM`].
fn same_person(distance_mm: f64) -> f64 {
    1.0 / (1.0 + (distance_mm / SAME_PERSON_MM).powi(2))
}

/// The kernel of two triangles in one labelling and their chord, if they are near enough to count.
fn alike(probe: &IndexedTriangle, other: &IndexedTriangle) -> Option<(f64, f64)> {
    if other.origin != Origin::Regions || probe.convex != other.convex {
        return None;
    }
    let chord = probe.shape.chord(&other.shape);
    let distance2 = (chord / MOST_CHORD).powi(2) + ((probe.log_size - other.log_size) / MOST_LOG_SIZE).powi(2);
    (distance2 < 1.0).then(|| ((1.0 - distance2).powi(2), chord))
}

/// Of each model the counterpart with the greatest kernel; ordered by model.
fn best_of_each_model(mut counterparts: Vec<Counterpart>) -> Vec<Counterpart> {
    counterparts.sort_by(|a, b| {
        let (chord_a, chord_b) = (a.2, b.2);
        a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(chord_a.0.total_cmp(&chord_b.0)).then(chord_a.2.cmp(&chord_b.2))
    });
    counterparts.dedup_by_key(|counterpart| counterpart.0);
    counterparts
}

fn least_sum(probe: &IndexedTriangle, other: &IndexedTriangle, size: f64) -> f64 {
    let standard = scaled(&Triangle::new(probe.corners), size);
    other
        .labelings()
        .map(|labelled| sum_of_distances(&Triangle::new(labelled.corners), &other.outward, &standard, &probe.outward))
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::triangles::triangles_of;
    use super::*;
    use crate::faces::signature::tests::example;

    #[test]
    fn triangles_are_alike_only_with_the_same_pattern_and_size() {
        let triangle = triangles_of(&example(0.2, 5))[0];
        assert_eq!(alike(&triangle, &triangle), Some((1.0, 0.0)));
        let [a, b, c] = triangle.convex;
        assert_eq!(alike(&triangle, &IndexedTriangle { convex: [!a, b, c], ..triangle }), None);
        assert_eq!(alike(&triangle, &IndexedTriangle { log_size: triangle.log_size + 0.21, ..triangle }), None);
        let (kernel, _) = alike(&triangle, &IndexedTriangle { log_size: triangle.log_size + 0.1, ..triangle })
            .expect("half of the most is near enough");
        assert!((kernel - 0.5625).abs() < 1e-12);
    }

    #[test]
    fn of_faces_the_one_with_the_nearest_dense_signature_comes_first() {
        assert_eq!((same_person(0.0), same_person(SAME_PERSON_MM)), (1.0, 0.5));
        let face = |seed: f64| Entry::new(&example(seed, 8));
        // residuals are 1.5 + sin(seed): these three are sure faces
        let (probe, near, far) = (face(-1.0), face(-1.02), face(-1.6));
        let similarities = Similarities::new(&probe);
        let (near, far) = (similarities.likeness(&near, 0.0), similarities.likeness(&far, 0.0));
        assert!(near > far && far > 0.4 && near > 0.6, "{near} {far}");
        assert!(similarities.likeness(&probe, 0.0) > 0.95);
    }

    #[test]
    fn the_index_gives_what_one_by_one_gives() {
        let entries: Vec<Entry> = (0..20).map(|k| Entry::new(&example(0.8 * f64::from(k), 8))).collect();
        let probe = Entry::new(&example(0.81, 8));
        let index = TriangleIndex::build(entries.iter().map(|e| e.triangles.as_slice()));
        let mut indexed = Similarities::new(&probe);
        indexed.add_indexed(&index, |place| Some((ModelId::from(place), &entries[place as usize])));
        let mut one_by_one = Similarities::new(&probe);
        for (id, entry) in entries.iter().enumerate() {
            one_by_one.add_one(id as ModelId, entry);
        }
        let ids: Vec<ModelId> = (0..20).collect();
        let ranked = |s: &Similarities| s.ranked(ids.iter().zip(&entries), &Wanted::best(20));
        assert_eq!(ranked(&indexed), ranked(&one_by_one));
        assert_eq!(ranked(&indexed)[0].model_id, 1, "the nearest seed");
    }
}
