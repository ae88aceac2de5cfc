//! Disturbing true poses, and how far estimated poses are from the truth.

use rand::SeedableRng;
use rand::distr::Distribution;
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitSphere;

use visage_geometry::{Motion, Point3, Vector3, se3};

/// Poses as a user might give them: each turned by `angle` radians about a random axis through the world's origin and
/// shifted by `shift` in a random direction. View 0, which fixes the world, stays.
pub fn disturb(poses: &[Motion], angle: f64, shift: f64, seed: u64) -> Vec<Motion> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut direction = || Vector3::from(UnitSphere.sample(&mut rng) as [f64; 3]);
    let mut disturbed = |(view, pose): (usize, &Motion)| {
        let error = Motion::new(direction() * shift, direction() * angle);
        if view == 0 { *pose } else { error * pose }
    };
    poses.iter().enumerate().map(&mut disturbed).collect()
}

/// How far estimated poses are from the true ones, after the whole is moved as well as it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseError {
    /// Mean rotation error of the views, degrees.
    pub rotation_deg_mean: f64,
    /// Largest rotation error of a view, degrees.
    pub rotation_deg_max: f64,
    /// Root mean square distance of the points from where they belong, in the unit of the points.
    pub points_rms: f64,
}

/// Compares `pose_world` of every view with the truth. `points` are sample points of each view in its own frame; the
/// rigid motion of the whole (no error of a registration) is the one that brings them nearest to their true places.
///
/// All three have one entry a view. With no points at all the errors are NaN.
pub fn pose_error(estimated: &[Motion], truth: &[Motion], points: &[Vec<Point3>]) -> PoseError {
    let places = |poses: &[Motion]| -> Vec<Point3> {
        poses.iter().zip(points).flat_map(|(pose, points)| points.iter().map(move |p| pose * p)).collect()
    };
    let (found, expected) = (places(estimated), places(truth));
    let gauge = best_motion(&found, &expected);
    let squares: f64 = found.iter().zip(&expected).map(|(f, e)| (gauge * f - e).norm_squared()).sum();
    let angle = |(estimated, truth): (&Motion, &Motion)| {
        se3::rotation_angle(&(truth.rotation.inverse() * gauge.rotation * estimated.rotation)).to_degrees()
    };
    let angles: Vec<f64> = estimated.iter().zip(truth).map(angle).collect();
    PoseError {
        rotation_deg_mean: angles.iter().sum::<f64>() / angles.len() as f64,
        rotation_deg_max: angles.iter().copied().fold(0.0, f64::max),
        points_rms: (squares / found.len() as f64).sqrt(),
    }
}

/// The rigid motion that brings `from` nearest to `to`, point by point (least squares).
fn best_motion(from: &[Point3], to: &[Point3]) -> Motion {
    let mean = |points: &[Point3]| points.iter().map(|p| p.coords).sum::<Vector3>() / points.len().max(1) as f64;
    let (from_mean, to_mean) = (mean(from), mean(to));
    let terms = from.iter().zip(to).map(|(f, t)| (t.coords - to_mean) * (f.coords - from_mean).transpose());
    let rotation = se3::nearest_rotation(&terms.sum());
    Motion::from_parts((to_mean - rotation * from_mean).into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views() -> (Vec<Motion>, Vec<Vec<Point3>>) {
        let poses = (0..4).map(|i| Motion::new(Vector3::z() * 5.0, Vector3::y() * f64::from(i))).collect();
        let corner = |i: i32| Point3::new(f64::from(i % 3 - 1), f64::from(i % 5 - 2), f64::from(i % 7 - 3)) * 40.0;
        (poses, vec![(0..105).map(corner).collect(); 4])
    }

    #[test]
    fn moving_the_whole_is_no_error() {
        let (truth, points) = views();
        let gauge = Motion::new(Vector3::new(10.0, -300.0, 7.0), Vector3::new(0.4, 2.0, -1.0));
        let estimated: Vec<Motion> = truth.iter().map(|pose| gauge * pose).collect();
        let error = pose_error(&estimated, &truth, &points);
        assert!(error.points_rms < 1e-9 && error.rotation_deg_max < 1e-6, "{error:?}");
    }

    #[test]
    fn one_turned_view_is_found() {
        let (truth, points) = views();
        let mut estimated = truth.clone();
        estimated[2] = Motion::new(Vector3::zeros(), Vector3::x() * 3f64.to_radians()) * truth[2];
        let error = pose_error(&estimated, &truth, &points);
        assert!((1.5..3.1).contains(&error.rotation_deg_max), "{error:?}");
        assert!(error.rotation_deg_mean < error.rotation_deg_max && error.points_rms > 1.0, "{error:?}");
    }

    #[test]
    fn disturbing_keeps_view_0_and_turns_the_others_by_the_angle() {
        let (truth, _) = views();
        let disturbed = disturb(&truth, 0.05, 4.0, 9);
        assert_eq!(disturbed[0], truth[0]);
        for (after, before) in disturbed.iter().zip(&truth).skip(1) {
            let error = after * before.inverse();
            assert!((se3::rotation_angle(&error.rotation) - 0.05).abs() < 1e-12);
            assert!((error.translation.vector.norm() - 4.0).abs() < 1e-12);
        }
        assert_eq!(disturbed, disturb(&truth, 0.05, 4.0, 9));
        assert_ne!(disturbed, disturb(&truth, 0.05, 4.0, 10));
    }
}
