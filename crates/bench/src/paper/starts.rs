//! Disturbed poses, as the paper disturbs them.

use rand::{RngExt, SeedableRng};

use visage::geometry::{Motion, Vector3};

/// The poses of a trial: for every view but the first, u is drawn from (-a, a)^3 and `R_i <- exp([u]x) R_i`; t_i is kept.
/// Trials of the same number draw the same directions at every level of noise `a` (radians).
pub fn disturbed(truth: &[Motion], a: f64, trial: u32) -> Vec<Motion> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(trial.into());
    let mut draw = || a * (2.0 * rng.random::<f64>() - 1.0);
    let disturb = |(view, pose): (usize, &Motion)| {
        if view == 0 {
            return *pose;
        }
        let u = Vector3::new(draw(), draw(), draw());
        Motion::from_parts(pose.translation, nalgebra::UnitQuaternion::from_scaled_axis(u) * pose.rotation)
    };
    truth.iter().enumerate().map(disturb).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_disturbed_within_bounds_and_the_first_view_is_not() {
        let truth: Vec<Motion> = (0..10).map(|k| Motion::translation(f64::from(k), 1.0, 2.0)).collect();
        let starts = disturbed(&truth, 0.04, 7);
        assert_eq!(starts[0], truth[0]);
        for (start, truth) in starts.iter().zip(&truth).skip(1) {
            assert_eq!(start.translation, truth.translation);
            let u = (start.rotation * truth.rotation.inverse()).scaled_axis();
            assert!(u.amax() <= 0.04 && u.amax() > 0.0, "{u}");
        }
        assert_eq!(disturbed(&truth, 0.04, 7), starts, "the same trial is the same start");
        assert_ne!(disturbed(&truth, 0.04, 8), starts);
    }
}
