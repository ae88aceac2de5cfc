//! Facial triangles out of caps and pits, and what each costs against the standard.

use super::caps_and_pits::{Place, Places};
use super::standard::{FaceStandard, INNER_EYE_DISTANCE_MM};
use super::triangle::Triangle;
use visage_geometry::{Motion, Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The most triangles that are kept of one scale level.
        most_per_level: usize = 16,
        /// Of these with one nose: triangles of one nose lead to much the same place, and a busy object has noses enough to
        /// crowd out a face's own.
        most_per_nose: usize = 4,
        /// A triangle farther from the standard than this is none, RMS mm on the standard.
        most_rms_mm: f64 = 12.0,
        /// One standard deviation of faces: RMS matching error, mm on the standard.
        rms_spread_mm: f64 = 3.0,
        /// Of 1 - cos of the angle between a corner's normal and the standard's, mean over the corners.
        normal_spread: f64 = 0.06,
        /// Of the logarithm of the ratio of the two pits.
        log_pit_ratio_spread: f64 = 0.5,
        /// Of the logarithm of the cap's curvature.
        log_cap_spread: f64 = 0.4,
        /// Of the logarithm of the pits' curvature.
        log_pit_spread: f64 = 0.6,
    }
}

/// A triangle's size relative to what its scale level expects.
const SIZES: std::ops::RangeInclusive<f64> = 0.72..=1.4;

/// A facial triangle with what its cost is made of. Positions in the file's frame and unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleCandidate {
    /// Right eye, left eye, nose (the subject's right and left).
    pub corners: [Point3; 3],
    /// Outward normals there.
    pub normals: [Vector3; 3],
    /// Curvature times the level's expected inner-eye distance: pit, pit, cap.
    pub strengths: [f64; 3],
    /// The level's expected inner-eye distance, in the file's unit.
    pub expected: f64,
}

/// What a candidate costs against a standard, term by term; each is about 1 at one standard deviation of the
/// faces of the public set.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Cost {
    /// Matching error.
    pub shape: f64,
    /// Normals at the corners, after the triangle's pose.
    pub normals: f64,
    /// Unlike pits at the two eyes.
    pub symmetry: f64,
    /// A cap flatter or sharper than the standard's nose.
    pub cap: f64,
    /// Pits flatter or sharper than the standard's eye corners.
    pub pits: f64,
}

impl Cost {
    /// The root of the summed squares.
    pub fn total(&self) -> f64 {
        [self.shape, self.normals, self.symmetry, self.cap, self.pits].iter().map(|t| t * t).sum::<f64>().sqrt()
    }
}

impl TriangleCandidate {
    /// The same triangle on the moved surface.
    pub fn moved(&self, motion: &Motion) -> TriangleCandidate {
        TriangleCandidate {
            corners: self.corners.map(|corner| motion * corner),
            normals: self.normals.map(|normal| motion.rotation * normal),
            ..*self
        }
    }

    /// The labelled triangle.
    pub fn triangle(&self) -> Triangle {
        Triangle::new(self.corners)
    }

    /// A direction on the outer side: the sum of the three normals.
    pub fn outward(&self) -> Vector3 {
        self.normals.iter().sum()
    }

    /// The cost against `standard`.
    pub fn cost(&self, standard: &FaceStandard) -> Cost {
        let triangle = self.triangle();
        let outward = self.outward();
        let shape = triangle.shape(&outward);
        let error = shape.matching_error(&standard.detected_shape(), standard.detected.size());
        let rotation = triangle.rotation_onto(&outward, &standard.detected, &standard.outward);
        let turned: f64 = (0..3).map(|k| 1.0 - (rotation * self.normals[k]).dot(&standard.normals[k])).sum();
        // curvature times length: what counts is the triangle's own size, not the level's expectation
        let size = triangle.size() / standard.detected.size() * INNER_EYE_DISTANCE_MM / self.expected;
        let [right, left, cap] = self.strengths.map(|s| s.max(1e-9) * size);
        let [standard_pit, standard_cap] = standard.curvatures;
        Cost {
            shape: error / 3f64.sqrt() / TUNING.rms_spread_mm,
            normals: turned / 3.0 / TUNING.normal_spread,
            symmetry: (right / left).ln() / TUNING.log_pit_ratio_spread,
            cap: (cap / standard_cap).ln() / TUNING.log_cap_spread,
            pits: ((right * left).sqrt() / standard_pit).ln() / TUNING.log_pit_spread,
        }
    }
}

/// The triangles of one level that look most like the standard, cheapest first.
pub fn candidates(places: &Places, expected: f64, standard: &FaceStandard) -> Vec<TriangleCandidate> {
    let mut found: Vec<(f64, TriangleCandidate)> = Vec::new();
    for nose in &places.caps {
        let mut of_nose: Vec<(f64, TriangleCandidate)> = Vec::new();
        for (i, eye) in places.pits.iter().enumerate() {
            for other in &places.pits[i + 1..] {
                if let Some(candidate) = labelled(eye, other, nose, expected, standard) {
                    of_nose.push((candidate.cost(standard).total(), candidate));
                }
            }
        }
        of_nose.sort_by(|a, b| a.0.total_cmp(&b.0));
        of_nose.truncate(TUNING.most_per_nose);
        found.extend(of_nose);
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().take(TUNING.most_per_level).map(|(_, candidate)| candidate).collect()
}

/// The triangle with right and left told apart: `(nose - right) x (left - right)` lies on the outer side.
/// `None` if its size or shape is out of the question.
fn labelled(
    eye: &Place,
    other: &Place,
    nose: &Place,
    expected: f64,
    standard: &FaceStandard,
) -> Option<TriangleCandidate> {
    let outward = eye.normal + other.normal + nose.normal;
    let side = (nose.point - eye.point).cross(&(other.point - eye.point)).dot(&outward);
    let (right, left) = if side > 0.0 { (eye, other) } else { (other, eye) };
    let triangle = Triangle::new([right.point, left.point, nose.point]);
    let size = triangle.size() / standard.detected.size() * INNER_EYE_DISTANCE_MM / expected;
    if !SIZES.contains(&size) {
        return None;
    }
    let error = triangle.shape(&outward).matching_error(&standard.detected_shape(), standard.detected.size());
    (error < TUNING.most_rms_mm * 3f64.sqrt()).then_some(TriangleCandidate {
        corners: triangle.corners,
        normals: [right.normal, left.normal, nose.normal],
        strengths: [right.strength, left.strength, nose.strength],
        expected,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::standard::face;

    fn places() -> Places {
        let standard = face();
        let [pit, cap] = standard.curvatures;
        let [right, left, nose] = [0, 1, 2].map(|k| Place {
            point: standard.detected.corners[k],
            normal: standard.normals[k],
            strength: if k == 2 { cap } else { pit },
        });
        Places { caps: vec![nose], pits: vec![left, right] }
    }

    #[test]
    fn the_standard_costs_nothing_and_knows_right_from_left() {
        let standard = face();
        let expected = INNER_EYE_DISTANCE_MM;
        let found = candidates(&places(), expected, &standard);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].corners, standard.detected.corners);
        assert!(found[0].cost(&standard).total() < 1e-9);
    }

    #[test]
    fn each_difference_costs() {
        let standard = face();
        let right = candidates(&places(), INNER_EYE_DISTANCE_MM, &standard)[0];
        let flat = TriangleCandidate { strengths: [2.7, 2.7, 4.3 / 2.0], ..right };
        assert!((flat.cost(&standard).cap - 0.5f64.ln() / TUNING.log_cap_spread).abs() < 1e-9);
        let uneven = TriangleCandidate { strengths: [2.7 * 2.0, 2.7 / 2.0, 4.3], ..right };
        assert!((uneven.cost(&standard).symmetry - 4f64.ln() / TUNING.log_pit_ratio_spread).abs() < 1e-9);
        assert!(uneven.cost(&standard).pits.abs() < 1e-9);
        let tilted = TriangleCandidate { normals: [Vector3::y(), right.normals[1], right.normals[2]], ..right };
        assert!(tilted.cost(&standard).normals > 1.0);
    }

    #[test]
    fn a_face_seen_from_behind_or_far_too_large_is_no_candidate() {
        let standard = face();
        let mut inside_out = places();
        for place in inside_out.caps.iter_mut().chain(&mut inside_out.pits) {
            place.normal = -place.normal;
        }
        let behind = candidates(&inside_out, INNER_EYE_DISTANCE_MM, &standard);
        assert!(behind.iter().all(|c| c.cost(&standard).total() > 3.0), "{behind:?}");
        assert!(candidates(&places(), 2.0 * INNER_EYE_DISTANCE_MM, &standard).is_empty());
    }
}
