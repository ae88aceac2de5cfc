//! How positions are stored in binary files that leave it to the writer.

use visage_geometry::{Bounds, Point3};

/// Positions are stored as `f32` if that moves no point by more than this share of the cloud's diagonal.
const FLOAT_ROUNDING: f64 = 1e-7;

/// Whether `f32` holds these positions without rounding them visibly.
pub(super) fn fits_float(points: &[Point3]) -> bool {
    let Some(bounds) = Bounds::of(points) else { return true };
    let tolerance = FLOAT_ROUNDING * bounds.diagonal();
    points.iter().flat_map(|p| p.iter()).all(|x| (f64::from(*x as f32) - x).abs() <= tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_origin_floats_are_too_short() {
        let near = [Point3::new(0.1, 0.2, 0.3), Point3::new(1.0, 1.0, 1.0)];
        assert!(fits_float(&near) && fits_float(&[]));
        assert!(!fits_float(&near.map(|p| p + nalgebra::Vector3::x() * 4.0e5)));
    }
}
