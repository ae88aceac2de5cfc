//! The corners of a class's selective triangles: places where its surface is a cap or a pit, and what a triangle of
//! such places costs against them.

use serde::{Deserialize, Serialize};

use crate::faces::caps_and_pits::{Place, Places};
use crate::faces::triangle::Triangle;
use visage_geometry::{Point3, Vector3};

/// What the surface does at a corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CornerKind {
    /// It stands out in every direction, as a nose tip does.
    Cap,
    /// It is hollow in every direction, as an inner eye corner is.
    Pit,
}

impl CornerKind {
    /// The places of this kind, strongest first.
    pub fn places(self, places: &Places) -> &[Place] {
        match self {
            CornerKind::Cap => &places.caps,
            CornerKind::Pit => &places.pits,
        }
    }
}

/// A landmark as the curvature operator sees it. Frame and unit of the standard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Corner {
    /// The landmark's name.
    pub name: String,
    /// Cap or pit.
    pub kind: CornerKind,
    /// Where it was annotated.
    pub annotated: Point3,
    /// Where the operator finds the cap or pit.
    pub detected: Point3,
    /// The outward unit normal there.
    pub normal: Vector3,
    /// The curvature there times the class's feature length: of a cap the smaller one, of a pit minus the larger.
    pub strength: f64,
}

/// Three corners that tell a class from other things.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SelectiveTriangle {
    /// The corners.
    pub corners: [Corner; 3],
}

/// A triangle of a model that may be the selective one. Positions in the model's frame and unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleCandidate {
    /// The corners, in the order of the selective triangle's.
    pub triangle: Triangle,
    /// A direction on the side that corresponds to the selective triangle's outward side.
    pub outward: Vector3,
    /// What it costs: about 1 for each deviation of usual size.
    pub cost: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The most triangles that are kept of one scale level and side.
        most_per_level: usize = 12,
        /// A usual deviation of the matching error, RMS mm on the standard; twice it along each axis is no candidate.
        rms_spread_mm: f64 = 4.0,
        /// A triangle with a larger error is no candidate.
        most_rms_mm: f64 = 14.0,
        /// Of 1 - cos of the angle between a corner's normal and the standard's, mean over the corners.
        normal_spread: f64 = 0.08,
        /// Of the logarithm of a corner's curvature.
        log_strength_spread: f64 = 0.5,
        /// Where the mean of the corners' normals has less than this share along the triangle's normal, it does not tell which
        /// side is outside: both are tried.
        least_facing: f64 = 0.35,
    }
}

/// A triangle's size relative to what its scale level expects.
const SIZES: std::ops::RangeInclusive<f64> = 0.72..=1.4;
/// The lengths of single sides relative to that: only a quick way to leave triangles out.
const SIDES: std::ops::RangeInclusive<f64> = 0.5..=2.0;

impl SelectiveTriangle {
    /// The triangle as it was annotated.
    pub fn annotated(&self) -> Triangle {
        Triangle::new(self.corners.each_ref().map(|corner| corner.annotated))
    }

    /// The triangle as the operator finds it.
    pub fn detected(&self) -> Triangle {
        Triangle::new(self.corners.each_ref().map(|corner| corner.detected))
    }

    /// The mean of the corners' normals.
    fn mean_normal(&self) -> Vector3 {
        self.corners.iter().map(|corner| corner.normal).sum::<Vector3>() / 3.0
    }

    /// Whether the corners' normals tell which side of the triangle is outside.
    pub fn has_side(&self) -> bool {
        let mean = self.mean_normal();
        self.detected().normal(&mean).dot(&mean) > TUNING.least_facing
    }

    /// A direction on the outer side; where the normals don't tell, the side from which the corners run
    /// counter-clockwise.
    pub fn outward(&self) -> Vector3 {
        if self.has_side() { self.mean_normal() } else { winding(&self.detected()) }
    }

    /// How far the corners are from lying in a line: 0 in a line, 1 for equal sides.
    pub fn fatness(&self) -> f64 {
        2.0 * self.detected().shape(&self.outward()).0.z.abs()
    }

    /// The cheapest triangles among the places of one level. `expected` is the level's feature length, in the model's
    /// unit; `expected_mm` the same on the standard.
    pub fn candidates(&self, places: &Places, expected: f64, expected_mm: f64) -> Vec<TriangleCandidate> {
        let [first, second, third] = self.corners.each_ref().map(|corner| corner.kind.places(places));
        let scale = expected / expected_mm;
        let standard = self.detected();
        let fits = |a: &Place, b: &Place, k: usize| {
            let usual = (standard.corners[(k + 1) % 3] - standard.corners[k]).norm() * scale;
            SIDES.contains(&((b.point - a.point).norm() / usual))
        };
        let mut found = Vec::new();
        for a in first {
            for b in second.iter().filter(|b| fits(a, b, 0)) {
                for c in third.iter().filter(|c| fits(b, c, 1) && fits(c, a, 2)) {
                    self.add(&[*a, *b, *c], scale, &standard, &mut found);
                }
            }
        }
        found.sort_by(|a: &TriangleCandidate, b| a.cost.total_cmp(&b.cost));
        found.truncate(TUNING.most_per_level);
        found
    }

    fn add(&self, places: &[Place; 3], scale: f64, standard: &Triangle, found: &mut Vec<TriangleCandidate>) {
        let triangle = Triangle::new(places.map(|place| place.point));
        let size = triangle.size() / standard.size() / scale;
        if !SIZES.contains(&size) {
            return;
        }
        let mean = places.iter().map(|place| place.normal).sum::<Vector3>();
        let sides =
            if self.has_side() { [Some(mean), None] } else { [1.0, -1.0].map(|s| Some(winding(&triangle) * s)) };
        for outward in sides.into_iter().flatten() {
            if let Some(cost) = self.cost(places, &triangle, &outward, size) {
                found.push(TriangleCandidate { triangle, outward, cost });
            }
        }
    }

    /// `size`: relative to what the level expects.
    fn cost(&self, places: &[Place; 3], triangle: &Triangle, outward: &Vector3, size: f64) -> Option<f64> {
        let (standard, standard_outward) = (self.detected(), self.outward());
        let error = triangle.shape(outward).matching_error(&standard.shape(&standard_outward), standard.size());
        let rms = error / 3f64.sqrt();
        if rms > TUNING.most_rms_mm {
            return None;
        }
        let rotation = triangle.rotation_onto(outward, &standard, &standard_outward);
        let pairs = || places.iter().zip(&self.corners);
        let turned: f64 = pairs().map(|(place, corner)| 1.0 - (rotation * place.normal).dot(&corner.normal)).sum();
        // curvature times length: what counts is the triangle's own size, not the level's expectation
        let bent = pairs().map(|(place, corner)| (place.strength * size / corner.strength).ln().powi(2)).sum::<f64>();
        let terms = [
            rms / TUNING.rms_spread_mm,
            turned / 3.0 / TUNING.normal_spread,
            (bent / 3.0).sqrt() / TUNING.log_strength_spread,
        ];
        Some(terms.iter().map(|term| term * term).sum::<f64>().sqrt())
    }
}

/// A direction from which the corners run counter-clockwise; zero for corners in a line.
fn winding(triangle: &Triangle) -> Vector3 {
    let [a, b, c] = triangle.corners;
    (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(kind: CornerKind, place: [f64; 3], normal: [f64; 3]) -> Corner {
        let at = Point3::from(place);
        let normal = Vector3::from(normal).normalize();
        Corner { name: "a".to_owned(), kind, annotated: at, detected: at, normal, strength: 2.0 }
    }

    fn standing() -> SelectiveTriangle {
        SelectiveTriangle {
            corners: [
                corner(CornerKind::Cap, [-30.0, 0.0, 0.0], [-0.3, 0.0, 1.0]),
                corner(CornerKind::Cap, [25.0, 5.0, 0.0], [0.3, 0.0, 1.0]),
                corner(CornerKind::Pit, [4.0, 28.0, 3.0], [0.0, 0.2, 1.0]),
            ],
        }
    }

    fn places_of(triangle: &SelectiveTriangle, scale: f64) -> Places {
        let mut places = Places::default();
        for corner in &triangle.corners {
            let place = Place {
                point: Point3::from(corner.detected.coords * scale),
                normal: corner.normal,
                strength: corner.strength,
            };
            match corner.kind {
                CornerKind::Cap => places.caps.push(place),
                CornerKind::Pit => places.pits.push(place),
            }
        }
        places
    }

    #[test]
    fn the_standard_costs_nothing_at_any_scale_and_its_mirror_image_much() {
        let triangle = standing();
        assert!(triangle.has_side() && triangle.fatness() > 0.5);
        let found = triangle.candidates(&places_of(&triangle, 0.1), 3.68, 36.8);
        assert!(found[0].cost < 1e-6, "{found:?}");
        let mut mirrored = triangle.clone();
        for corner in &mut mirrored.corners {
            corner.detected.x = -corner.detected.x;
            corner.normal.x = -corner.normal.x;
        }
        let found = triangle.candidates(&places_of(&mirrored, 0.1), 3.68, 36.8);
        assert!(found.iter().all(|candidate| candidate.cost > 1.0), "{found:?}");
        assert!(triangle.candidates(&places_of(&triangle, 0.1), 36.8, 36.8).is_empty(), "a tenth of the size");
    }

    #[test]
    fn a_triangle_whose_normals_lie_in_its_plane_is_tried_from_both_sides() {
        let mut flat = standing();
        for corner in &mut flat.corners {
            corner.normal = Vector3::new(corner.detected.x, corner.detected.y - 10.0, 0.0).normalize();
            corner.kind = CornerKind::Cap;
        }
        assert!(!flat.has_side());
        let found = flat.candidates(&places_of(&flat, 1.0), 36.8, 36.8);
        assert!(found[0].cost < 1e-6);
        let turned = |c: &TriangleCandidate| c.outward.dot(&flat.outward()) < 0.0;
        assert!(found.iter().any(turned) && !turned(&found[0]), "{found:?}");
    }
}
