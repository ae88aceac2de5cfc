//! The built-in face as a surface: a smooth, symmetric height field over (x, y), written as a table of spline
//! coefficients. Frame of the standard: x to the subject's left, y up, z out; mm.
//!
//! The coefficients are fitted by `cargo run --release --example fit_standard DATA` to heads and faces under the
//! MIT, Apache-2.0 and CC0 licences, each laid onto the standard's landmarks first.

use super::relief_table::COEFFICIENTS;
use super::spline::MirroredSpline;
use visage_geometry::{Point3, Vector3};

/// Coefficients across half of the face; the other half mirrors them.
pub const COLUMNS: usize = 12;
/// Coefficients along the height.
pub const ROWS: usize = 16;
/// The distance of two columns, mm.
const COLUMN_STEP_MM: f64 = 5.6;
/// The distance of two rows, mm.
const ROW_STEP_MM: f64 = 8.0;
/// The y of row 0, mm.
const FIRST_ROW_MM: f64 = -38.0;

/// The face is defined for |x| up to this, mm.
pub const HALF_WIDTH_MM: f64 = (COLUMNS as f64 - 1.5) * COLUMN_STEP_MM;
/// The lowest y, mm: the upper lip. Mouth and chin move too much to be part of a standard.
pub const LOWEST_MM: f64 = FIRST_ROW_MM + ROW_STEP_MM;
/// The highest y, mm: the upper forehead.
pub const HIGHEST_MM: f64 = FIRST_ROW_MM + (ROWS as f64 - 2.0) * ROW_STEP_MM;

/// The spline that the heights are coefficients of.
pub const SPLINE: MirroredSpline = MirroredSpline {
    columns: COLUMNS,
    rows: ROWS,
    column_step_mm: COLUMN_STEP_MM,
    row_step_mm: ROW_STEP_MM,
    first_row_mm: FIRST_ROW_MM,
};

/// The height over (x, y) and its slopes along x and y.
pub fn height(x: f64, y: f64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for term in SPLINE.terms(x, y) {
        for (sum, weight) in sums.iter_mut().zip(term.weights) {
            *sum += weight * f64::from(COEFFICIENTS[term.row][term.column]);
        }
    }
    sums
}

/// The point of the face over (x, y) and the outward unit normal there.
pub fn at(x: f64, y: f64) -> (Point3, Vector3) {
    let [z, slope_x, slope_y] = height(x, y);
    (Point3::new(x, y, z), Vector3::new(-slope_x, -slope_y, 1.0).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_face_is_symmetric_and_smooth() {
        for (x, y) in [(5.0, 10.0), (20.0, 33.0), (41.0, 60.0)] {
            let ((left, normal), (right, mirrored)) = (at(x, y), at(-x, y));
            assert!((left.z - right.z).abs() < 1e-9 && (normal.x + mirrored.x).abs() < 1e-9);
            let (beside, above) = (at(x + 1e-5, y).0.z, at(x, y + 1e-5).0.z);
            assert!((normal.x / normal.z + (beside - left.z) / 1e-5).abs() < 1e-3);
            assert!((normal.y / normal.z + (above - left.z) / 1e-5).abs() < 1e-3);
        }
    }

    #[test]
    fn the_nose_stands_out_and_the_eyes_lie_deep() {
        let z = |x, y| at(x, y).0.z;
        assert!((0..60).map(|k| z(0.0, f64::from(k) - 29.0)).fold(0.0, f64::max) > 125.0, "the nose");
        assert!(z(18.4, 32.5) < z(0.0, 36.0) - 12.0, "the inner eye corner lies behind the sellion");
        assert!(z(0.0, 0.0) - z(40.0, 0.0) > 25.0, "the cheek lies behind the nose");
    }
}
