//! Which motions of a pair its geometry leaves free.

use nalgebra::{Matrix3x6, Matrix6};

use super::row;
use visage_geometry::{Vector3, se3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A motion by which surfaces leave each other by less than this share of it (root mean squares) is free. Set on code-made
        /// prints, not varied; beside it, of right hypotheses of a walk 83 % hold by more than 0.075 (docs/results/walk.md).
        least_hold: f64 = 0.1,
    }
}

/// What geometry leaves free of the motion between two views, a twist of the world.
pub struct Freedom {
    /// Of a twist the part along free motions.
    pub free: Matrix6<f64>,
    /// Of a twist what geometry may speak of: all but that of the free part which is only held by noise of the normals.
    pub held: Matrix6<f64>,
}

impl Freedom {
    /// Of correspondences with both their normals, at places; `None` if geometry holds every motion.
    pub fn of(correspondences: impl Iterator<Item = ([Vector3; 2], Vector3)>) -> Option<Self> {
        let (mut extent, mut real, mut all) = (Matrix6::zeros(), Matrix6::zeros(), Matrix6::zeros());
        for (normals, place) in correspondences {
            let mut moved = Matrix3x6::<f64>::zeros();
            moved.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
            moved.fixed_view_mut::<3, 3>(0, 3).copy_from(&-se3::skew(&place));
            extent += moved.transpose() * moved;
            let [a, b] = normals.map(|normal| row(&normal, &place));
            // one normal of each view: their noise is gone from the mean of the product
            real += 0.5 * (a * b.transpose() + b * a.transpose());
            all += 0.5 * (a * a.transpose() + b * b.transpose());
        }
        let root = extent.cholesky()?.l();
        let inverse = root.try_inverse()?;
        let eigen = (inverse * real * inverse.transpose()).symmetric_eigen();
        let (mut free, mut unheard) = (Matrix6::zeros(), Matrix6::zeros());
        for k in (0..6).filter(|k| eigen.eigenvalues[*k] < TUNING.least_hold.powi(2)) {
            let motion = inverse.transpose() * eigen.eigenvectors.column(k);
            let part = motion * motion.transpose() * extent;
            let seeming = (motion.transpose() * all * motion)[(0, 0)].max(f64::MIN_POSITIVE);
            free += part;
            unheard += part * (1.0 - (eigen.eigenvalues[k] / seeming).clamp(0.0, 1.0));
        }
        (free != Matrix6::zeros()).then(|| Freedom { free, held: Matrix6::identity() - unheard })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    fn freedom(surface: impl Fn(f64, f64) -> (Vector3, Vector3)) -> Option<Freedom> {
        let at = |k: i32| surface(f64::from(k % 20) / 20.0, f64::from(k / 20) / 20.0);
        Freedom::of((0..400).map(at).map(|(place, normal)| ([normal; 2], place)))
    }

    #[test]
    fn a_cylinder_turns_about_its_axis_and_slides_along_it() {
        let cylinder = |u: f64, v: f64| {
            let (sin, cos) = (3.0 * u).sin_cos();
            (Vector3::new(cos, sin, 2.0 * v), Vector3::new(cos, sin, 0.0))
        };
        let Freedom { free, .. } = freedom(cylinder).expect("two motions are free");
        let along = Vector6::new(0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
        let about = Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert!((free * along - along).norm() < 1e-6 && (free * about - about).norm() < 1e-6);
        let aside = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        assert!((free * free - free).norm() < 1e-6 && (free * aside - aside).norm() > 0.5);
        assert!((free.trace() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_bumpy_sheet_is_held() {
        let bumpy = |u: f64, v: f64| {
            let slope = Vector3::new(-3.0 * (9.0 * u).cos(), -3.0 * (8.0 * v).cos(), 1.0);
            (Vector3::new(u, v, (9.0 * u).sin() / 3.0 + 3.0 * (8.0 * v).sin() / 8.0), slope.normalize())
        };
        assert!(freedom(bumpy).is_none());
    }
}
