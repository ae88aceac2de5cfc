//! A bare triangle as a query.

use std::collections::BTreeSet;

use super::best::Best;
use super::live_segment::LiveSegment;
use super::triangles::IndexedTriangle;
use super::{Match, ModelId, Rank, TopK};
use visage_geometry::{Point3, Vector3};
use visage_shape::faces::standard::FaceStandard;
use visage_shape::faces::{Shape, Triangle, judgement, sum_of_distances};

/// A bare triangle in every way it may be met in the index.
pub(super) struct TriangleQuery {
    pub triangle: Triangle,
    pub outward: Vector3,
    either_side: bool,
    /// Its canonical shape in three labelings, and in three more if it may be seen from either side.
    pub shapes: Vec<Shape>,
}

impl TriangleQuery {
    pub fn new(triangle: Triangle, outward: Option<Vector3>) -> TriangleQuery {
        let [a, b, c] = triangle.corners;
        let winding = (b - a).cross(&(c - a));
        let side = outward.unwrap_or(winding);
        let shape = triangle.shape(&side);
        let canonical = if shape.0.z < 0.0 { shape.swapped() } else { shape };
        let mut shapes = vec![canonical];
        if outward.is_none() {
            // seen from the other side, the same corners run the other way round
            shapes.push(canonical.mirrored().swapped());
        }
        let shapes = shapes.into_iter().flat_map(|s| [s, s.relabelled(), s.relabelled().relabelled()]).collect();
        TriangleQuery { triangle, outward: side, either_side: outward.is_none(), shapes }
    }

    /// The chord between a canonical shape and the nearest of the query's.
    pub fn chord(&self, shape: &Shape) -> f64 {
        self.shapes.iter().map(|s| s.chord(shape)).fold(f64::INFINITY, f64::min)
    }

    /// The score of a triangle that is as far off as the paper's threshold allows.
    pub fn match_score() -> f64 {
        score(judgement::THRES_FT_MM / FaceStandard::face_size())
    }

    /// The answer for a model whose nearest triangle was found.
    pub fn answer(&self, model_id: ModelId, found: &IndexedTriangle, threshold: f64) -> Match {
        let size = FaceStandard::face_size();
        let chord = self.chord(&found.shape);
        let query = scaled(&self.triangle, size);
        let [a, b, c] = found.corners;
        let sides: &[f64] = if self.either_side { &[1.0, -1.0] } else { &[1.0] };
        let labelings = [[a, b, c], [b, c, a], [c, a, b], [b, a, c], [a, c, b], [c, b, a]];
        let sums =
            sides.iter().flat_map(|side| labelings.map(|corners| (Triangle::new(corners), found.outward * *side)));
        let sums = sums.map(|(triangle, outward)| sum_of_distances(&triangle, &outward, &query, &self.outward));
        Match {
            model_id,
            score: score(chord),
            matching_error_mm: size * chord,
            sum_of_distances_mm: sums.fold(f64::INFINITY, f64::min),
            is_match: score(chord) >= threshold,
            triangle: Some(found.corners.map(|p| p.into())),
        }
    }
}

impl TriangleQuery {
    /// The wanted models of some segments, by their nearest triangles.
    pub fn search(&self, segments: &[LiveSegment], top_k: &TopK) -> Vec<Match> {
        let threshold = top_k.threshold.unwrap_or_else(Self::match_score);
        let passed = top_k.after.map(|after| self.not_after(segments, after)).unwrap_or_default();
        let least = if top_k.only_matches { threshold } else { 0.0 };
        // costs are negative scores; of a model's equal triangles the first
        let mut best: Best<(u16, usize)> = Best::new(top_k.limit);
        for (which, live) in segments.iter().enumerate() {
            let reach = |best: &Best<_>| chord(least.max(-best.reach()));
            for shape in &self.shapes {
                live.segment.triangles.visit(shape, reach(&best), &mut |place, number| {
                    if let Some((id, score)) = live.score(self, place, number)
                        && best.would_take(-score, id, &(number, which))
                        && !passed.contains(&id)
                        && top_k.takes(score, id, threshold)
                    {
                        best.offer(-score, id, (number, which));
                    }
                    reach(&best)
                });
            }
        }
        let found = |id, (number, which): (u16, usize)| {
            let segment = &segments[which].segment;
            Some(self.answer(id, &segment.outlines.outline(segment.place(id)?).triangle(number)?, threshold))
        };
        best.into_ranked().filter_map(|(_, id, place)| found(id, place)).collect()
    }

    /// The models whose rank is not after the given one: a worse triangle of theirs must not bring them in again.
    fn not_after(&self, segments: &[LiveSegment], after: Rank) -> BTreeSet<ModelId> {
        let (mut passed, reach) = (BTreeSet::new(), chord(after.score));
        for live in segments {
            for shape in &self.shapes {
                live.segment.triangles.visit(shape, reach, &mut |place, number| {
                    let scored = live.score(self, place, number);
                    let rank = scored.map(|(model_id, score)| Rank { score, model_id });
                    passed.extend(rank.filter(|rank| rank.key() <= after.key()).map(|rank| rank.model_id));
                    reach
                });
            }
        }
        passed
    }
}

/// The greatest chord that gives a score.
fn chord(score: f64) -> f64 {
    if score > 0.0 { 1.0 - score } else { f64::INFINITY }
}

/// How alike two triangles are whose shapes are that far apart, in [0, 1].
pub(super) fn score(chord: f64) -> f64 {
    (1.0 - chord).max(0.0)
}

/// The triangle scaled to the given size.
pub(super) fn scaled(triangle: &Triangle, size: f64) -> Triangle {
    let factor = size / triangle.size();
    Triangle::new(triangle.corners.map(|p| Point3::from(p.coords * factor)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> [Point3; 3] {
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 2.0, 0.0]].map(Point3::from)
    }

    #[test]
    fn every_labelling_seen_from_the_right_side_is_met() {
        let query = TriangleQuery::new(Triangle::new(corners()), Some(Vector3::z()));
        let [a, b, c] = corners();
        for labelled in [[a, b, c], [b, c, a], [c, a, b]] {
            assert!(query.chord(&Triangle::new(labelled).shape(&Vector3::z())) < 1e-12);
        }
        let from_below = Triangle::new([b, a, c]).shape(&-Vector3::z());
        assert!(from_below.0.z > 0.0 && query.chord(&from_below) > 0.1, "a mirrored triangle is another one");
    }

    #[test]
    fn without_a_side_both_are_met() {
        let query = TriangleQuery::new(Triangle::new(corners()), None);
        let [a, b, c] = corners();
        assert!(query.chord(&Triangle::new([b, a, c]).shape(&-Vector3::z())) < 1e-12);
        assert!(query.chord(&Triangle::new([c, a, b]).shape(&Vector3::z())) < 1e-12);
    }

    #[test]
    fn scaling_sets_the_size() {
        assert!((scaled(&Triangle::new(corners()), 47.0).size() - 47.0).abs() < 1e-12);
    }
}
