//! Rigid motions and their Lie algebra: the exact exponential and logarithm of SE(3).
//!
//! A twist is a 6-vector `(u, w)`: translation part first (a length), rotation vector second (radians).
//! This is `vec` `[P5]` of the 4x4 matrix logarithm `[P4]`; `exp` undoes `cev` `[P9]` and the matrix
//! exponential `[P10]`.
//! Formulas: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, appendix D.

use super::Vector3;

/// A rigid motion in f64: a unit quaternion and a translation.
pub type Motion = nalgebra::Isometry3<f64>;
/// An element of se(3): translation part, then rotation vector in radians.
pub type Twist = nalgebra::Vector6<f64>;

/// Below this angle (radians) series replace the closed forms, which lose digits there.
const SMALL_ANGLE: f64 = 1e-4;

/// The matrix `[w]x` with `[w]x v = w x v`.
#[inline]
pub fn skew(w: &Vector3) -> nalgebra::Matrix3<f64> {
    w.cross_matrix()
}

/// The rigid motion of a twist: `exp` of SE(3), the translation through the left Jacobian `V`.
pub fn exp(twist: &Twist) -> Motion {
    let u = twist.fixed_rows::<3>(0).into_owned();
    let w = twist.fixed_rows::<3>(3).into_owned();
    let angle2 = w.norm_squared();
    let angle = angle2.sqrt();
    let (a, b) = if angle < SMALL_ANGLE {
        (0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0)
    } else {
        // 1 - cos as 2 sin^2 of the half angle keeps its digits
        let half_sine = (angle * 0.5).sin();
        (2.0 * half_sine * half_sine / angle2, (angle - angle.sin()) / (angle2 * angle))
    };
    let wu = w.cross(&u);
    let translation = u + a * wu + b * w.cross(&wu);
    Motion::from_parts(translation.into(), nalgebra::UnitQuaternion::from_scaled_axis(w))
}

/// The twist of a rigid motion: the inverse of [`exp`], with a rotation angle in [0, pi].
///
/// Exact near 0 and near pi, since the rotation vector comes from the quaternion and not from the trace.
pub fn log(motion: &Motion) -> Twist {
    let w = rotation_vector(&motion.rotation);
    let t = motion.translation.vector;
    let angle2 = w.norm_squared();
    let angle = angle2.sqrt();
    // V^-1 = I - [w]x / 2 + c [w]x^2
    let c = if angle < SMALL_ANGLE {
        1.0 / 12.0 + angle2 / 720.0
    } else {
        let half = 0.5 * angle;
        (1.0 - half * half.cos() / half.sin()) / angle2
    };
    let wt = w.cross(&t);
    let u = t - 0.5 * wt + c * w.cross(&wt);
    Twist::new(u.x, u.y, u.z, w.x, w.y, w.z)
}

/// The rotation vector of a unit quaternion, its angle in [0, pi].
#[inline]
pub fn rotation_vector(rotation: &nalgebra::UnitQuaternion<f64>) -> Vector3 {
    let q = rotation.quaternion();
    // q and -q are the same rotation: the one with w >= 0 turns by at most pi
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let v = q.imag() * sign;
    let sine = v.norm();
    if sine < 1e-12 {
        return v * 2.0;
    }
    v * (2.0 * sine.atan2(q.w * sign) / sine)
}

/// The angle of a rotation, radians in [0, pi].
#[inline]
pub fn rotation_angle(rotation: &nalgebra::UnitQuaternion<f64>) -> f64 {
    rotation_vector(rotation).norm()
}

/// A 4x4 row-major matrix is not a rigid motion.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotRigid {
    /// A number is NaN or infinite.
    #[error("the matrix has a number that is not finite")]
    NotFinite,
    /// The last row is not 0 0 0 1.
    #[error("the last row must be 0 0 0 1")]
    LastRow,
    /// The upper left 3x3 block is no rotation.
    #[error("the 3x3 block is no rotation (its distance from the nearest one is {0:.2e}; a scale, shear or mirror?)")]
    NotARotation(f64),
}

/// How far (Frobenius) a 3x3 block may be from a rotation: six printed digits pass, a scale of 0.1 % does not.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Reads a 4x4 row-major matrix as a rigid motion; a rounded rotation is moved to the nearest exact one.
pub fn from_rows(rows: &[[f64; 4]; 4]) -> Result<Motion, NotRigid> {
    if rows.iter().flatten().any(|x| !x.is_finite()) {
        return Err(NotRigid::NotFinite);
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(NotRigid::LastRow);
    }
    let block = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
    let rotation = nearest_rotation(&block);
    let distance = (block - rotation.to_rotation_matrix().matrix()).norm();
    if distance > ROTATION_TOLERANCE {
        return Err(NotRigid::NotARotation(distance));
    }
    Ok(Motion::from_parts(Vector3::new(rows[0][3], rows[1][3], rows[2][3]).into(), rotation))
}

/// A scale nearer to 1 than this is rounding, however exact the matrix is otherwise.
const SCALE_TOLERANCE: f64 = 1e-5;
/// The same in a matrix that is not exact: the rotations of some depth cameras are 7e-5 too short.
const INEXACT_SCALE_TOLERANCE: f64 = 1e-3;
/// What is farther from a multiple of a rotation than this (Frobenius) is not exact.
const EXACT: f64 = 1e-9;
/// Rounding each number to so many decimals changes the scale by up to 7 times what it changes otherwise (20 000 random
/// rotations); what stands out by more is a scale.
const CLEARLY: f64 = 8.0;

/// The motion nearest to a matrix, and what is between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestMotion {
    /// The rigid motion.
    pub motion: Motion,
    /// The scale that comes before it; 1 if there is none.
    pub scale: f64,
    /// How far (Frobenius) the 3x3 block, with its scale taken out, is from the rotation.
    pub distance: f64,
}

/// Reads a 4x4 row-major matrix as the nearest rigid motion that follows a scaling by some s > 0.
///
/// Its rotation may be rounded: the block, with the scale taken out, may be `tolerance` (Frobenius) from one. Rounding
/// changes the scale too, so one that is of the same size as what rounding did otherwise is none.
pub fn nearest_motion(rows: &[[f64; 4]; 4], tolerance: f64) -> Result<NearestMotion, NotRigid> {
    if rows.iter().flatten().any(|x| !x.is_finite()) {
        return Err(NotRigid::NotFinite);
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(NotRigid::LastRow);
    }
    let block = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
    let rotation = nearest_rotation(&block);
    let exact = *rotation.to_rotation_matrix().matrix();
    // of all multiples of the rotation this one is nearest to the block
    let scale = exact.dot(&block) / 3.0;
    let is_scale = scale.is_normal() && scale > 0.0;
    if !is_scale {
        return Err(NotRigid::NotARotation((block - exact).norm()));
    }
    let shape = (block / scale - exact).norm();
    let change = (scale - 1.0).abs();
    let tolerated = if shape < EXACT { SCALE_TOLERANCE } else { INEXACT_SCALE_TOLERANCE };
    let scale = if change > tolerated && change * 3f64.sqrt() > CLEARLY * shape { scale } else { 1.0 };
    let distance = (block / scale - exact).norm();
    if distance > tolerance {
        return Err(NotRigid::NotARotation(distance));
    }
    let motion = Motion::from_parts(Vector3::new(rows[0][3], rows[1][3], rows[2][3]).into(), rotation);
    Ok(NearestMotion { motion, scale, distance })
}

/// Reads a 4x4 row-major matrix `[s R, t]` as a rigid motion that follows a scaling by `s` > 0.
#[inline]
pub fn from_scaled_rows(rows: &[[f64; 4]; 4]) -> Result<(Motion, f64), NotRigid> {
    nearest_motion(rows, ROTATION_TOLERANCE).map(|nearest| (nearest.motion, nearest.scale))
}

/// A rigid motion as a 4x4 row-major matrix.
#[inline]
pub fn to_rows(motion: &Motion) -> [[f64; 4]; 4] {
    let m = motion.to_homogeneous();
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}

/// A rigid motion that follows a scaling, as a 4x4 row-major matrix `[s R, t]`.
#[inline]
pub fn to_scaled_rows(motion: &Motion, scale: f64) -> [[f64; 4]; 4] {
    let mut rows = to_rows(motion);
    rows[..3].iter_mut().for_each(|row| row[..3].iter_mut().for_each(|x| *x *= scale));
    rows
}

/// The rotation nearest to a 3x3 matrix in the Frobenius norm, determinant +1 (by SVD).
#[inline]
pub fn nearest_rotation(matrix: &nalgebra::Matrix3<f64>) -> nalgebra::UnitQuaternion<f64> {
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return nalgebra::UnitQuaternion::identity();
    };
    let sign = (u * v_t).determinant().signum();
    let rotation = u * nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matrix_exp(twist: &Twist) -> nalgebra::Matrix4<f64> {
        let mut m = nalgebra::Matrix4::zeros();
        m.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&Vector3::new(twist[3], twist[4], twist[5])));
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&twist.fixed_rows::<3>(0));
        m.exp()
    }

    proptest! {
        #[test]
        fn exp_is_the_matrix_exponential(v in prop::array::uniform6(-1.5..1.5f64), scale in prop::sample::select(vec![1.0, 1e-3, 1e-5, 1e-9])) {
            let twist = Twist::from_row_slice(&v) * scale;
            prop_assert!((exp(&twist).to_homogeneous() - matrix_exp(&twist)).norm() < 1e-12);
        }

        #[test]
        fn log_undoes_exp(u in prop::array::uniform3(-10.0..10.0f64), w in prop::array::uniform3(-1.0..1.0f64), angle in prop::sample::select(vec![0.0, 1e-12, 1e-7, 9e-5, 2e-4, 0.3, 3.0, 3.1, std::f64::consts::PI - 1e-9])) {
            let w = Vector3::from_row_slice(&w).try_normalize(1e-6).unwrap_or(Vector3::x()) * angle;
            let twist = Twist::new(u[0], u[1], u[2], w.x, w.y, w.z);
            let back = log(&exp(&twist));
            prop_assert!((back - twist).norm() < 1e-7, "{twist} {back}");
        }
    }

    #[test]
    fn half_turns_are_logged() {
        let motion = Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::y() * std::f64::consts::PI);
        let twist = log(&motion);
        assert!((exp(&twist).to_homogeneous() - motion.to_homogeneous()).norm() < 1e-12);
    }

    #[test]
    fn rows_that_are_not_rigid_are_refused() {
        let mut rows = to_rows(&Motion::identity());
        rows[0][0] = 1.1;
        assert!(matches!(from_rows(&rows), Err(NotRigid::NotARotation(_))));
        rows[0][0] = -1.0;
        assert!(matches!(from_rows(&rows), Err(NotRigid::NotARotation(_))), "a mirror is no rotation");
        rows[0][0] = f64::NAN;
        assert_eq!(from_rows(&rows), Err(NotRigid::NotFinite));
        rows[0][0] = 1.0;
        rows[3][0] = 0.5;
        assert_eq!(from_rows(&rows), Err(NotRigid::LastRow));
    }

    #[test]
    fn scaled_rows_round_trip_and_a_mirror_is_no_scale() {
        let motion = Motion::new(Vector3::new(0.1, -2.0, 30.0), Vector3::new(0.4, -0.7, 2.1));
        for scale in [1.0, 0.8, 1000.0] {
            let (back, found) = from_scaled_rows(&to_scaled_rows(&motion, scale)).expect("a scaled motion");
            assert!((found / scale - 1.0).abs() < 1e-12);
            assert!((back.to_homogeneous() - motion.to_homogeneous()).norm() < 1e-9);
        }
        let mut rows = to_rows(&motion);
        rows[1].iter_mut().for_each(|x| *x = -*x);
        assert!(matches!(from_scaled_rows(&rows), Err(NotRigid::NotARotation(_))));
        rows[0] = rows[1];
        assert!(from_scaled_rows(&rows).is_err(), "a flat matrix");
        rows[0][0] = f64::INFINITY;
        assert_eq!(from_scaled_rows(&rows), Err(NotRigid::NotFinite));
    }

    #[test]
    fn rounding_is_no_scale_and_a_scale_is_no_rounding() {
        let motion = Motion::new(Vector3::new(0.1, -2.0, 30.0), Vector3::new(0.4, -0.7, 2.1));
        let rounded =
            |scale: f64, unit: f64| to_scaled_rows(&motion, scale).map(|row| row.map(|x| (x / unit).round() * unit));
        for unit in [1e-2, 1e-3, 1e-4, 1e-6] {
            let nearest = nearest_motion(&rounded(1.0, unit), 0.015).expect("rounded");
            assert_eq!(nearest.scale, 1.0, "{unit}");
            assert!(nearest.distance < 1.5 * unit && nearest.motion.rotation.angle_to(&motion.rotation) < 1.5 * unit);
            let scaled = nearest_motion(&rounded(1.3, unit), 0.015).expect("rounded");
            assert!((scaled.scale - 1.3).abs() < unit, "{unit}");
        }
        // rotations of a depth camera, 7e-5 too short and in single precision; and a scale that was found
        let short = to_scaled_rows(&motion, 1.0 - 7e-5).map(|row| row.map(|x| f64::from(x as f32)));
        assert_eq!(nearest_motion(&short, 1e-3).expect("short").scale, 1.0);
        let found = from_scaled_rows(&to_scaled_rows(&motion, 1.00007)).expect("a scale").1;
        assert!((found - 1.00007).abs() < 1e-12);
    }

    #[test]
    fn rows_round_trip() {
        let motion = Motion::new(Vector3::new(0.1, -2.0, 30.0), Vector3::new(0.4, -0.7, 2.1));
        let back = from_rows(&to_rows(&motion)).expect("a motion's matrix is rigid");
        assert!((back.to_homogeneous() - motion.to_homogeneous()).norm() < 1e-12);
    }
}
