//! The built-in face standard: the facial triangle FT_S, and the same triangle as the detector's operator sees it.

use super::triangle::{Shape, Triangle};
use visage_geometry::{Point3, Vector3};

/// The distance between the inner eye corners of the standard, mm: the yardstick of every scale level.
pub const INNER_EYE_DISTANCE_MM: f64 = 36.8;

/// A class of models by its three characteristic places. Frame: x to the subject's left, y up, z out; mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceStandard {
    /// The name that queries ask for.
    pub name: &'static str,
    /// The annotated facial triangle FT_S: right and left inner eye corner, nose tip.
    pub annotated: Triangle,
    /// The same places as the curvature operator finds them.
    pub detected: Triangle,
    /// Outward unit normals of the surface at the detected places.
    pub normals: [Vector3; 3],
    /// Curvature at the eyes (of a pit: minus the larger principal one) and at the nose (of a cap: the smaller one),
    /// times the inner-eye distance.
    pub curvatures: [f64; 2],
    /// A direction on the outer side of the triangle.
    pub outward: Vector3,
}

impl FaceStandard {
    /// The shape of the annotated triangle.
    pub fn annotated_shape(&self) -> Shape {
        self.annotated.shape(&self.outward)
    }

    /// The shape of the detected triangle.
    pub fn detected_shape(&self) -> Shape {
        self.detected.shape(&self.outward)
    }

    /// The size S of the face standard's annotated triangle, mm: the scale of matching errors without a standard.
    pub fn face_size() -> f64 {
        face().annotated.size()
    }
}

/// The face standard.
///
/// The annotated triangle is the mean of published head models. A cap's curvature peaks some 7 mm below the
/// anatomical nose tip and a pit's some 2 mm outside the eye corner, hence the second triangle with its normals:
/// the medians of what the operator finds on the heads it was measured on.
pub fn face() -> FaceStandard {
    let eye_normal = Vector3::new(-0.12, -0.03, 0.99);
    FaceStandard {
        name: "face",
        annotated: Triangle::new([
            Point3::new(-18.4, 32.5, 92.0),
            Point3::new(18.4, 32.5, 92.0),
            Point3::new(0.0, 4.1, 130.7),
        ]),
        detected: Triangle::new([
            Point3::new(-20.1, 33.1, 91.8),
            Point3::new(20.1, 33.1, 91.8),
            Point3::new(0.0, -3.4, 129.2),
        ]),
        normals: [
            eye_normal.normalize(),
            Vector3::new(-eye_normal.x, eye_normal.y, eye_normal.z).normalize(),
            Vector3::new(0.0, -0.56, 0.83).normalize(),
        ],
        curvatures: [2.7, 4.3],
        outward: Vector3::new(0.0, 1.0, 1.0),
    }
}

/// The standard with this name, if it is built in.
pub fn by_name(name: &str) -> Option<FaceStandard> {
    (name == "face").then(face)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_face_is_symmetric_and_known_by_name() {
        let standard = by_name("face").expect("the face is built in");
        for triangle in [standard.annotated, standard.detected] {
            let [right, left, nose] = triangle.corners;
            assert_eq!([-right.x, right.y, right.z], [left.x, left.y, left.z]);
            assert_eq!(nose.x, 0.0);
        }
        assert!(standard.annotated_shape().0.z < 0.0, "right, left, nose run clockwise seen from outside");
        assert!(standard.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-12));
        assert_eq!(by_name("cup"), None);
    }

    #[test]
    fn the_detected_triangle_is_near_the_annotated_one() {
        let standard = face();
        let pairs = standard.annotated.corners.iter().zip(&standard.detected.corners);
        assert!(pairs.into_iter().all(|(a, d)| (a - d).norm() < 8.0));
        assert!(standard.annotated_shape().chord(&standard.detected_shape()) < 0.1);
    }
}
