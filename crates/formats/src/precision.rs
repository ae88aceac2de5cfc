//! What `f32` does to positions: how they are stored in binary files that leave it to the writer, and what was lost
//! before they came here.

use visage_geometry::{Bounds, Point3};

/// Positions are stored as `f32` if that moves no point by more than this share of the cloud's diagonal.
const FLOAT_ROUNDING: f64 = 1e-7;

/// Whether `f32` holds these positions without rounding them visibly.
pub(super) fn fits_float(points: &[Point3]) -> bool {
    let Some(bounds) = Bounds::of(points) else { return true };
    let tolerance = FLOAT_ROUNDING * bounds.diagonal();
    points.iter().flat_map(|p| p.iter()).all(|x| (f64::from(*x as f32) - x).abs() <= tolerance)
}

/// Points from which the precision of all is told.
const SAMPLE: usize = 1 << 12;
/// Fewer points say nothing of the spacing.
const LEAST: usize = 64;
/// Rounding to steps of this share of the spacing is a noise of 3 % of it, which is less than any scanner's.
const HARMLESS_STEP: f64 = 0.1;

/// Says so where coordinates were rounded to `f32` far from the origin before they came here, and the steps are so wide
/// that they show between neighbours.
pub(super) fn rounding(points: &[Point3]) -> Option<String> {
    if points.len() < LEAST {
        return None;
    }
    let stride = points.len().div_ceil(SAMPLE);
    let sample: Vec<Point3> = points.iter().step_by(stride).copied().collect();
    let diagonal = Bounds::of(&sample)?.diagonal();
    // of points all over a surface as large as the bounds
    let spacing = diagonal / (points.len() as f64).sqrt();
    let axes = (0..3).filter(|axis| sample.iter().all(|p| f64::from(p[*axis] as f32) == p[*axis]));
    let largest = axes.map(|axis| sample.iter().map(|p| p[axis].abs()).fold(0.0, f64::max)).fold(0.0, f64::max);
    let step = f64::from((largest as f32).next_up()) - f64::from(largest as f32);
    (step > HARMLESS_STEP * spacing && largest > diagonal).then(|| {
        format!(
            "coordinates were rounded to steps of up to {step} before they came here, for points that are some {spacing:.1e} \
             apart: they are 32-bit floats up to {largest:.3e} from the origin; subtract an offset before the export, or \
             export 64-bit floats"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a sphere of two metres.
    fn sphere(place: [f64; 3]) -> Vec<Point3> {
        let turn = |k: u32| (f64::from(k) * 2.399_963, 1.0 - f64::from(k) / 1000.0);
        (0..2000)
            .map(turn)
            .map(|(angle, z)| ((1.0 - z * z).sqrt(), angle, z))
            .map(|(r, angle, z)| Point3::from(place) + nalgebra::Vector3::new(r * angle.cos(), r * angle.sin(), z))
            .collect()
    }

    #[test]
    fn steps_of_floats_are_noticed_where_they_show() {
        let utm = sphere([500_000.0, 4_500_000.0, 100.0]);
        let floats = |points: &[Point3]| points.iter().map(|p| p.map(|x| f64::from(x as f32))).collect::<Vec<_>>();
        let note = rounding(&floats(&utm)).expect("rounded");
        assert!(note.starts_with("coordinates were rounded to steps of up to 0.5 before they came here"), "{note}");
        assert!(note.contains("subtract an offset"), "{note}");
        for sound in [utm.clone(), floats(&sphere([0.0; 3])), floats(&sphere([10.0, 300.0, 1.0])), floats(&utm[..9])] {
            assert_eq!(rounding(&sound), None);
        }
        // one axis is enough
        let height = floats(&sphere([0.0, 0.0, 4e6]));
        assert!(rounding(&height).is_some_and(|note| note.contains("steps of up to 0.25")));
    }

    #[test]
    fn far_from_the_origin_floats_are_too_short() {
        let near = [Point3::new(0.1, 0.2, 0.3), Point3::new(1.0, 1.0, 1.0)];
        assert!(fits_float(&near) && fits_float(&[]));
        assert!(!fits_float(&near.map(|p| p + nalgebra::Vector3::x() * 4.0e5)));
    }
}
