//! How the likeness of two models is put together.
//!
//! Two faces are compared by their dense signatures alone: the places where a face is salient are the same on
//! everyone. Things are compared by their shape as a whole ([`ShapeDescriptor`](visage_shape::descriptor::ShapeDescriptor)); their
//! likeness is the probability that they are of one class, as people class things.
//! What both are judged to be faces by ([`MATCH_SCORE`]) is enough for the first; below, the two ways are weighed by the
//! lesser of the scores, and a face and a thing that is none are less alike for that.

use visage_shape::faces::judgement::MATCH_SCORE;

/// The distance of shapes at which every other pair is of one class, where one in sixty is whatever its distance, and how fast the
/// odds fall with it: as a power. A logistic regression on the logarithm of the distances of all pairs of the Princeton Shape
/// Benchmark's training half; how far it holds on other sets is in docs/results/things.md.
const SAME_CLASS: f64 = 0.401;
const SAME_CLASS_POWER: f64 = 7.745;
/// The same for a single scan and the nearest view of its own model, of 893, against those of all others.
const SAME_VIEW: f64 = 0.103;
const SAME_VIEW_POWER: f64 = 7.912;
/// The likeness of two sure faces that have nothing else in common, and the most of a sure face and a sure other thing.
pub(super) const FACE_KINSHIP: f64 = 0.5;
/// The dense distance at which two faces are half-way between one person's and two people's, mm on the standard: one
/// head twice, with noise and holes, 0.2 to 0.5 (30 heads of the public set); two heads 0.7 and more in 99 of 100 pairs.
pub const SAME_PERSON_MM: f64 = 0.6;

/// Likeness as things, in [0, 1], by the distance of the shapes; 0 if one has none.
pub(super) fn as_things(distance: Option<f64>) -> f64 {
    distance.map_or(0.0, |distance| 1.0 / (1.0 + (distance / SAME_CLASS).powf(SAME_CLASS_POWER)))
}

/// The distance of shapes beyond which likeness as things is less than `least`; a hair more.
pub(super) fn reach_of_things(least: f64) -> f64 {
    reach(least, SAME_CLASS, SAME_CLASS_POWER)
}

/// The distance of views beyond which the score by views is less than `least`; a hair more.
pub(super) fn reach_of_views(least: f64) -> f64 {
    reach(least, SAME_VIEW, SAME_VIEW_POWER)
}

/// Where odds that are even at `middle` and fall with a power of the distance give `least`; a hair more.
fn reach(least: f64, middle: f64, power: f64) -> f64 {
    if least <= 0.0 {
        return f64::INFINITY;
    }
    middle * (1.0 / least - 1.0).max(0.0).powf(1.0 / power) * (1.0 + 1e-9) + 1e-9
}

/// That a single scan is of a model, by the distance of the nearest view of it; 0 without views.
pub(super) fn as_views(distance: Option<f64>) -> f64 {
    distance.map_or(0.0, |distance| 1.0 / (1.0 + (distance / SAME_VIEW).powf(SAME_VIEW_POWER)))
}

/// In (0, 1]: 1 at no distance, a half at [`SAME_PERSON_MM`].
fn same_person(distance_mm: f64) -> f64 {
    1.0 / (1.0 + (distance_mm / SAME_PERSON_MM).powi(2))
}

/// How a likeness is weighed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    /// Of the dense signatures.
    pub dense: f64,
    /// What likeness as things counts at most.
    things: f64,
}

impl Weights {
    /// Given how surely either is a face, in [0, 1].
    pub fn new(probe_score: f64, score: f64, both_have_dense: bool) -> Weights {
        let dense = if both_have_dense { (probe_score.min(score) / MATCH_SCORE).min(1.0) } else { 0.0 };
        let kinship = 1.0 - FACE_KINSHIP * (probe_score - score).abs();
        Weights { dense, things: (1.0 - dense) * kinship }
    }

    /// Whether two models with dense signatures are weighed by these alone.
    pub fn are_sure(probe_score: f64, score: f64) -> bool {
        probe_score.min(score) >= MATCH_SCORE
    }

    /// The likeness; without a distance the faces have nothing to be told apart by.
    pub fn likeness(&self, distance_mm: Option<f64>, things: f64) -> f64 {
        let as_faces = FACE_KINSHIP + (1.0 - FACE_KINSHIP) * distance_mm.map_or(0.0, same_person);
        self.dense * as_faces + self.things * things
    }

    /// The dense distance beyond which the likeness is less than `least`, whatever else; a hair more.
    pub fn reach_mm(&self, least: f64) -> f64 {
        let same_person = ((least - self.things) / self.dense - FACE_KINSHIP) / (1.0 - FACE_KINSHIP);
        if same_person <= 0.0 || same_person.is_nan() {
            return f64::INFINITY;
        }
        SAME_PERSON_MM * (1.0 / same_person - 1.0).max(0.0).sqrt() * (1.0 + 1e-9) + 1e-6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_faces_the_one_with_the_nearest_dense_signature_comes_first() {
        assert_eq!((same_person(0.0), same_person(SAME_PERSON_MM)), (1.0, 0.5));
        let sure = Weights::new(0.9, 0.95, true);
        assert_eq!((sure.dense, sure.things), (1.0, 0.0));
        for score in [0.0, 0.4, 0.5, 0.55, 0.6, 1.0] {
            assert_eq!(Weights::are_sure(0.55, score), Weights::new(0.55, score, true).dense == 1.0);
        }
        assert!(sure.likeness(Some(0.3), 0.0) > sure.likeness(Some(0.7), 1.0));
        assert_eq!(sure.likeness(None, 1.0), FACE_KINSHIP);
    }

    #[test]
    fn a_face_and_another_thing_are_no_more_alike_than_any_two_faces() {
        let mixed = Weights::new(0.999, 0.001, true);
        assert!(mixed.likeness(Some(0.0), 1.0) < FACE_KINSHIP + 0.01);
        assert_eq!(Weights::new(0.0, 0.0, false).likeness(None, 0.7), 0.7);
    }

    #[test]
    fn likeness_as_things_falls_with_the_distance_and_is_even_at_that_of_one_class() {
        assert_eq!((as_things(Some(0.0)), as_things(Some(SAME_CLASS)), as_things(None)), (1.0, 0.5, 0.0));
        assert!(as_things(Some(0.3)) > 0.85 && as_things(Some(0.6)) < 0.05);
        for least in [1e-9, 0.01, 0.4, 0.999_999] {
            let reach = reach_of_things(least);
            assert!(as_things(Some(reach)) < least && as_things(Some((reach - 1e-6).max(0.0))) > least - 1e-3);
            let reach = reach_of_views(least);
            assert!(as_views(Some(reach)) < least && as_views(Some((reach - 1e-6).max(0.0))) > least - 1e-3);
        }
        assert_eq!(reach_of_things(0.0), f64::INFINITY);
    }

    #[test]
    fn beyond_the_reach_no_likeness_is_enough() {
        for weights in [Weights::new(1.0, 1.0, true), Weights::new(0.6, 0.7, true), Weights::new(0.3, 0.9, true)] {
            for least in [0.2, 0.55, 0.7, 0.9, 0.999] {
                let reach_mm = weights.reach_mm(least);
                assert!(reach_mm.is_infinite() || weights.likeness(Some(reach_mm), 1.0) < least);
                assert!(reach_mm == 1e-6 || weights.likeness(Some((reach_mm - 1e-5).max(0.0)), 1.0) >= least - 1e-3);
            }
        }
    }
}
