//! How much a pose depends on single parts of the overlap: a block jackknife.
//!
//! The sandwich takes what is wrong in one small cell of space to say nothing of the next. Scans are bent, fragments drift and
//! noise comes in patches: what is wrong reaches as far as the surface does. So the correspondences of a view are cut
//! into K patches of equal count by halving them `TUNING.halvings` times along their longest extent, and the view's normal equations
//! are solved without each patch in turn, while the other views stay. The variance of these poses is
//! `(K - 1) / K sum over k of (x_k - mean)^2` (Quenouille 1956, Tukey 1958; blocks for correlated data: Kuensch 1989).

use nalgebra::{Matrix6, Vector6};

use visage_geometry::Vector3;
use visage_geometry::se3::Twist;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Halvings: 32 patches. On code-made sets 8, 16 and 32 tell right poses from wrong ones the better the more they are
        /// (docs/results/scanners.md).
        halvings: u32 = 5,
        /// Correspondences of a patch, at least: of fewer there are fewer patches.
        least: usize = 4,
        /// Added to the information, as a share of what holds a motion of the surface in the mean: a direction that one patch
        /// alone holds is not divided by zero without it.
        damping: f64 = 1e-6,
    }
}

/// What one correspondence says of a view.
#[derive(Debug, Clone, Copy)]
pub struct Held {
    /// Where it is, in the world about some middle.
    pub place: Vector3,
    /// How the residual changes with a left twist of the view about its centroid.
    pub row: Twist,
    /// How much it is believed.
    pub weight: f64,
    /// The residual, a length.
    pub residual: f64,
}

/// Root mean square displacement of a view's surface, a length, by one standard deviation of its pose; `q' extent q` is the
/// mean squared displacement by a twist q, and `slope` by how much less than its weight a residual changes the gradient. `None` if
/// too little holds it.
pub fn displacement(mut held: Vec<Held>, extent: &Matrix6<f64>, slope: f64) -> Option<f64> {
    let mut patches = Vec::new();
    halve(&mut held, TUNING.halvings, &mut patches);
    let count = patches.len() as f64;
    let (information, gradient) =
        patches.iter().fold((Matrix6::zeros(), Vector6::zeros()), |(h, g), patch: &Patch| (h + patch.0, g + patch.1));
    let damping = extent * (TUNING.damping / 6.0 * (extent.try_inverse()? * information).trace());
    let without = |(h, g): &Patch| Some((information - h + damping).cholesky()?.solve(&(gradient - g)) / slope);
    let poses: Vec<Twist> = patches.iter().map(without).collect::<Option<_>>()?;
    let mean = poses.iter().sum::<Twist>() / count;
    let squares: f64 = poses.iter().map(|pose| pose - mean).map(|q| q.dot(&(extent * q)).max(0.0)).sum();
    (patches.len() > 1).then(|| ((count - 1.0) / count * squares).sqrt())
}

/// The information and the gradient of a patch.
type Patch = (Matrix6<f64>, Vector6<f64>);

fn halve(held: &mut [Held], times: u32, patches: &mut Vec<Patch>) {
    if times == 0 || held.len() < 2 * TUNING.least {
        let mut patch = (Matrix6::zeros(), Vector6::zeros());
        for Held { row, weight, residual, .. } in held {
            patch.0 += *weight * *row * row.transpose();
            patch.1 += *row * (*weight * *residual);
        }
        patches.push(patch);
        return;
    }
    let middle = held.iter().map(|held| held.place).sum::<Vector3>() / held.len() as f64;
    let spread = |axis: usize| held.iter().map(|held| (held.place[axis] - middle[axis]).powi(2)).sum::<f64>();
    let axis = Vector3::new(spread(0), spread(1), spread(2)).imax();
    let half = held.len() / 2;
    held.select_nth_unstable_by(half, |a, b| a.place[axis].total_cmp(&b.place[axis]));
    let (low, high) = held.split_at_mut(half);
    halve(low, times - 1, patches);
    halve(high, times - 1, patches);
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::se3;

    /// A bumpy sheet of side 20 on itself, with a residual for each place.
    fn sheet(residual: impl Fn(f64, f64) -> f64) -> (Vec<Held>, Matrix6<f64>) {
        let mut extent = Matrix6::zeros();
        let held = |k: i32| {
            let (x, y) = (f64::from(k % 40) / 2.0 - 9.75, f64::from(k / 40) / 2.0 - 9.75);
            let normal = Vector3::new((0.7 * x).sin(), (0.9 * y).cos(), 1.5).normalize();
            let place = Vector3::new(x, y, 0.0);
            let turn = place.cross(&normal);
            let row = Twist::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z);
            Held { place, row, weight: 1.0, residual: residual(x, y) }
        };
        let all: Vec<Held> = (0..1600).map(held).collect();
        for Held { place, .. } in &all {
            let mut moved = nalgebra::Matrix3x6::<f64>::zeros();
            moved.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
            moved.fixed_view_mut::<3, 3>(0, 3).copy_from(&-se3::skew(place));
            extent += moved.transpose() * moved / 1600.0;
        }
        (all, extent)
    }

    fn noise(x: f64, y: f64) -> f64 {
        ((x * 12.9898 + y * 78.233).sin() * 43758.5453).fract()
    }

    #[test]
    fn what_is_wrong_over_patches_loosens_a_pose_more_than_what_is_wrong_point_by_point() {
        let known = |residual: fn(f64, f64) -> f64| {
            let (held, extent) = sheet(residual);
            let all = held.iter().map(|held| held.residual.powi(2)).sum::<f64>();
            displacement(held, &extent, 1.0).expect("many correspondences") / (all / 1600.0).sqrt()
        };
        let (by_points, bent) = (known(noise), known(|x, y| (0.5 * x).sin() * (0.4 * y).cos()));
        assert!(bent > 4.0 * by_points, "{by_points} {bent}");
    }

    #[test]
    fn residuals_that_a_motion_explains_leave_nothing_open() {
        let motion = Twist::new(0.1, -0.2, 0.05, 0.01, 0.02, -0.01);
        let (mut held, extent) = sheet(|_, _| 0.0);
        held.iter_mut().for_each(|held| held.residual = held.row.dot(&motion));
        let left = displacement(held, &extent, 1.0).expect("many correspondences");
        assert!(left < 1e-4, "{left}");
    }

    #[test]
    fn what_hangs_on_one_place_is_loose() {
        let (mut held, extent) = sheet(noise);
        let whole = displacement(held.clone(), &extent, 1.0).expect("many correspondences");
        // but for one corner all is flat
        for held in held.iter_mut().filter(|held| held.place.x < 5.0 || held.place.y < 5.0) {
            let turn = held.place.cross(&Vector3::z());
            held.row = Twist::new(0.0, 0.0, 1.0, turn.x, turn.y, turn.z);
        }
        let loose = displacement(held, &extent, 1.0).expect("many correspondences");
        assert!(loose > 3.0 * whole, "{whole} {loose}");
    }

    #[test]
    fn too_little_says_nothing() {
        let (held, extent) = sheet(noise);
        assert_eq!(displacement(held[..6].to_vec(), &extent, 1.0), None);
        assert_eq!(displacement(Vec::new(), &extent, 1.0), None);
    }
}
