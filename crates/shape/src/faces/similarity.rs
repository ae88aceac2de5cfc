//! Where a standard lies in a model: turn, place, scale, and how its proportions differ.

use super::triangle::Triangle;
use visage_geometry::{Motion, Point3, Vector3};

/// A map from the standard's frame (mm) to the model's: `p_model = R (scale * stretch * p_standard) + t`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Similarity {
    /// Model units in one millimetre of the standard.
    pub scale: f64,
    /// Factors along the standard's axes (width, height, depth); their product is 1.
    pub stretch: Vector3,
    /// R and t.
    pub motion: Motion,
}

impl Similarity {
    /// The least-squares similarity that maps `from` onto `to`, both labelled alike, the outer side of the one onto
    /// the outer side of the other.
    pub fn of_triangles(from: &Triangle, from_outward: &Vector3, to: &Triangle, to_outward: &Vector3) -> Similarity {
        let rotation = from.rotation_onto(from_outward, to, to_outward);
        let (a, b) = (from.center(), to.center());
        let pairs = from.corners.iter().zip(&to.corners);
        let dot: f64 = pairs.map(|(p, q)| (q - b).dot(&(rotation * (p - a)))).sum();
        let size2 = from.size().powi(2);
        let scale = if size2 > 0.0 { dot / size2 } else { 1.0 };
        let rotation = visage_geometry::se3::nearest_rotation(&rotation);
        let translation = b.coords - rotation * a.coords * scale;
        Similarity { scale, stretch: Vector3::repeat(1.0), motion: Motion::from_parts(translation.into(), rotation) }
    }

    /// Where the standard lies in the moved model.
    pub fn moved(&self, motion: &Motion) -> Similarity {
        Similarity { motion: motion * self.motion, ..*self }
    }

    /// A place of the standard in the model.
    pub fn point(&self, p: &Point3) -> Point3 {
        let stretched = p.coords.component_mul(&self.stretch) * self.scale;
        Point3::from(self.motion.rotation * stretched + self.motion.translation.vector)
    }

    /// The place of the standard that lies at `p` in the model.
    pub fn standard_point(&self, p: &Point3) -> Point3 {
        let back = self.motion.rotation.inverse() * (p.coords - self.motion.translation.vector) / self.scale;
        Point3::from(back.component_div(&self.stretch))
    }

    /// The least-squares similarity, without stretch, that maps points onto their counterparts (Umeyama, 1991).
    pub fn of_points(from: &[Point3], to: &[Point3]) -> Similarity {
        let count = from.len().max(1) as f64;
        let center = |points: &[Point3]| points.iter().map(|p| p.coords).sum::<Vector3>() / count;
        let (a, b) = (center(from), center(to));
        let mut correlation = nalgebra::Matrix3::zeros();
        let mut spread = 0.0;
        for (p, q) in from.iter().zip(to) {
            correlation += (q.coords - b) * (p.coords - a).transpose();
            spread += (p.coords - a).norm_squared();
        }
        let rotation = visage_geometry::se3::nearest_rotation(&correlation);
        let turned = rotation.to_rotation_matrix().matrix().transpose() * correlation;
        let scale = if spread > 0.0 { turned.trace() / spread } else { 1.0 };
        let translation = b - rotation * a * scale;
        Similarity { scale, stretch: Vector3::repeat(1.0), motion: Motion::from_parts(translation.into(), rotation) }
    }

    /// A surface normal of the standard in the model; unit length stays.
    pub fn normal(&self, n: &Vector3) -> Vector3 {
        (self.motion.rotation * n.component_div(&self.stretch)).normalize()
    }

    /// Grown by `growth` along the standard's axes, then turned by the rotation vector `w`, both about `center` (a
    /// place of the standard), then shifted.
    pub fn nudged(&self, center: &Point3, w: &Vector3, growth: &Vector3, shift: &Vector3) -> Similarity {
        let factors = self.stretch.component_mul(growth) * self.scale;
        let scale = factors.product().cbrt();
        let rotation = nalgebra::UnitQuaternion::from_scaled_axis(*w) * self.motion.rotation;
        let translation = self.point(center).coords + shift - rotation * factors.component_mul(&center.coords);
        Similarity { scale, stretch: factors / scale, motion: Motion::from_parts(translation.into(), rotation) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Triangle {
        Triangle::new([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 3.0, 0.0]].map(Point3::from))
    }

    #[test]
    fn a_posed_triangle_gives_its_pose_back() {
        let truth = Similarity {
            scale: 2.5,
            stretch: Vector3::repeat(1.0),
            motion: Motion::new(Vector3::new(3.0, -1.0, 9.0), Vector3::new(0.4, 1.0, -2.0)),
        };
        let to = Triangle::new(triangle().corners.map(|p| truth.point(&p)));
        let found = Similarity::of_triangles(&triangle(), &Vector3::z(), &to, &truth.normal(&Vector3::z()));
        assert!((found.scale - 2.5).abs() < 1e-9);
        let corners = Similarity::of_points(&triangle().corners, &to.corners);
        for p in [Point3::new(1.0, 2.0, 3.0), Point3::origin()] {
            assert!((found.point(&p) - truth.point(&p)).norm() < 1e-9);
            assert!((corners.point(&p) - truth.point(&p)).norm() < 1e-9);
            assert!((truth.standard_point(&truth.point(&p)) - p).norm() < 1e-9);
        }
    }

    #[test]
    fn a_nudge_grows_and_turns_about_its_centre() {
        let stretch = Vector3::new(1.25, 0.8, 1.0);
        let start = Similarity { scale: 2.0, stretch, motion: Motion::new(Vector3::x(), Vector3::new(0.3, 0.1, 0.0)) };
        let center = Point3::new(5.0, 1.0, -2.0);
        let (w, growth) = (Vector3::new(0.0, 0.0, 0.3), Vector3::new(1.1, 1.2, 0.9));
        let nudged = start.nudged(&center, &w, &growth, &Vector3::x());
        assert!((nudged.point(&center) - (start.point(&center) + Vector3::x())).norm() < 1e-12);
        assert!((nudged.stretch.product() - 1.0).abs() < 1e-12);
        let p = Point3::new(-3.0, 4.0, 1.0);
        let grown = center + (p - center).component_mul(&growth);
        let expected = nalgebra::Rotation3::new(w) * (start.point(&grown) - start.point(&center));
        assert!((nudged.point(&p) - nudged.point(&center) - expected).norm() < 1e-12);
    }

    #[test]
    fn normals_stay_across_a_stretched_surface() {
        let pose = Similarity {
            scale: 3.0,
            stretch: Vector3::new(2.0, 1.0, 0.5),
            motion: Motion::rotation(Vector3::new(0.2, 0.7, 0.1)),
        };
        let (along, normal) = (Vector3::new(1.0, 0.0, 1.0), Vector3::new(1.0, 0.0, -1.0));
        let moved = pose.point(&Point3::from(along)) - pose.point(&Point3::origin());
        assert!(moved.dot(&pose.normal(&normal)).abs() < 1e-12);
        assert!((pose.normal(&normal).norm() - 1.0).abs() < 1e-12);
    }
}
