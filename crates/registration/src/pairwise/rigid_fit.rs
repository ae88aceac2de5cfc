//! The rigid motion that best maps one set of points onto another, in closed form.
//!
//! Arun, Huang, Blostein, "Least-squares fitting of two 3-D point sets", PAMI 1987, with the determinant fixed to +1
//! after Umeyama, PAMI 1991.

use nalgebra::Matrix3;

use visage_geometry::neighbours::LocalPoint;
use visage_geometry::{Motion, Vector3, se3};

/// Sums over correspondences, from which the fit follows; points are added one by one in a fixed order.
#[derive(Debug, Clone, Copy, Default)]
pub struct RigidFit {
    count: f64,
    source: Vector3,
    target: Vector3,
    cross: Matrix3<f64>,
}

impl RigidFit {
    /// Adds a correspondence: `source` is to be moved onto `target`.
    #[inline]
    pub fn add(&mut self, source: &LocalPoint, target: &LocalPoint) {
        let s = Vector3::new(source[0].into(), source[1].into(), source[2].into());
        let t = Vector3::new(target[0].into(), target[1].into(), target[2].into());
        self.count += 1.0;
        self.source += s;
        self.target += t;
        self.cross += t * s.transpose();
    }

    /// The motion that minimises the sum of squared distances; `None` for fewer than three correspondences.
    pub fn solve(&self) -> Option<Motion> {
        if self.count < 3.0 {
            return None;
        }
        let (source, target) = (self.source / self.count, self.target / self.count);
        let rotation = se3::nearest_rotation(&(self.cross / self.count - target * source.transpose()));
        let translation = target - rotation * source;
        Some(Motion::from_parts(translation.into(), rotation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Point3;

    #[test]
    fn recovers_a_known_motion() {
        let truth = Motion::new(Vector3::new(3.0, -1.0, 0.5), Vector3::new(0.3, -1.1, 2.0));
        let mut fit = RigidFit::default();
        for i in 0..50 {
            let p = Point3::new((i % 5) as f64, (i % 7) as f64 * 0.5, (i % 3) as f64 - 1.0);
            let q = truth * p;
            fit.add(&[p.x as f32, p.y as f32, p.z as f32], &[q.x as f32, q.y as f32, q.z as f32]);
        }
        let found = fit.solve().expect("fifty correspondences");
        assert!((found.to_homogeneous() - truth.to_homogeneous()).norm() < 1e-5);
    }

    #[test]
    fn never_mirrors() {
        let mut fit = RigidFit::default();
        for p in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -1.0, -1.0f32]] {
            fit.add(&p, &[-p[0], p[1], p[2]]);
        }
        let rotation = fit.solve().expect("four correspondences").rotation.to_rotation_matrix();
        assert!((rotation.matrix().determinant() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn two_correspondences_fix_nothing() {
        let mut fit = RigidFit::default();
        fit.add(&[0.0; 3], &[1.0; 3]);
        fit.add(&[1.0; 3], &[2.0; 3]);
        assert!(fit.solve().is_none());
    }
}
