//! The built-in face as a surface: a smooth, symmetric height field over (x, y), written as a table of spline
//! coefficients. Frame of the standard: x to the subject's left, y up, z out; mm.
//!
//! The coefficients are fitted by `cargo run --release --example fit_standard DATA` to heads and faces under the
//! MIT, Apache-2.0 and CC0 licences, each laid onto the standard's landmarks first.

use super::relief_table::COEFFICIENTS;
use crate::geometry::{Point3, Vector3};

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

/// The four cubic B-spline weights at `t` in [0, 1], and their derivatives.
fn cubic(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    let (t2, t3) = (t * t, t * t * t);
    let weights = [s * s * s / 6.0, (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0, (3.0 * (t + t2 - t3) + 1.0) / 6.0, t3 / 6.0];
    let slopes = [-0.5 * s * s, 1.5 * t2 - 2.0 * t, 0.5 + t - 1.5 * t2, 0.5 * t2];
    (weights, slopes)
}

/// Where `coordinate` lies between the coefficients: the first of four and the rest in [0, 1].
fn locate(coordinate: f64, count: usize) -> (usize, f64) {
    let cell = coordinate.floor().clamp(1.0, count as f64 - 3.0);
    (cell as usize - 1, coordinate - cell)
}

/// The coefficients that make up the height at (x, y), with their weights, and with the weights of both slopes:
/// `(row, column, [height, dz/dx, dz/dy])`. Mirrored columns are listed under their own half.
pub fn terms(x: f64, y: f64) -> [(usize, usize, [f64; 3]); 16] {
    let full = 2 * COLUMNS;
    let (column, u) = locate(x / COLUMN_STEP_MM + 0.5 * (full as f64 - 1.0), full);
    let (row, v) = locate((y - FIRST_ROW_MM) / ROW_STEP_MM, ROWS);
    let ((wx, dx), (wy, dy)) = (cubic(u), cubic(v));
    std::array::from_fn(|k| {
        let (i, j) = (k % 4, k / 4);
        let column = column + i;
        let half = if column >= COLUMNS { column - COLUMNS } else { COLUMNS - 1 - column };
        let weights = [wx[i] * wy[j], dx[i] * wy[j] / COLUMN_STEP_MM, wx[i] * dy[j] / ROW_STEP_MM];
        (row + j, half, weights)
    })
}

/// The point of the face over (x, y) and the outward unit normal there.
pub fn at(x: f64, y: f64) -> (Point3, Vector3) {
    let mut sums = [0.0; 3];
    for (row, column, weights) in terms(x, y) {
        for (sum, weight) in sums.iter_mut().zip(weights) {
            *sum += weight * f64::from(COEFFICIENTS[row][column]);
        }
    }
    let [z, slope_x, slope_y] = sums;
    (Point3::new(x, y, z), Vector3::new(-slope_x, -slope_y, 1.0).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_reproduce_a_plane() {
        for (x, y) in [(0.0, 0.0), (3.3, -29.9), (-58.0, 70.0), (58.8, 74.0), (11.2, 2.0)] {
            let terms = terms(x, y);
            let sum = |k: usize| terms.iter().map(|(_, _, w)| w[k]).sum::<f64>();
            assert!((sum(0) - 1.0).abs() < 1e-12 && sum(1).abs() < 1e-12 && sum(2).abs() < 1e-12);
            let plane: f64 = terms.iter().map(|(row, _, w)| w[0] * (FIRST_ROW_MM + ROW_STEP_MM * *row as f64)).sum();
            assert!((plane - y).abs() < 1e-9, "coefficients in a line give a line");
        }
    }

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
