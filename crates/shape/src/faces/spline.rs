//! Cubic B-splines over the face, mirrored at the midline: what the built-in surface and its modes are written in.

/// A grid of coefficients for half of the face; the other half mirrors them. x to the subject's left, y up, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MirroredSpline {
    /// Coefficients across half of the face.
    pub columns: usize,
    /// Coefficients along the height.
    pub rows: usize,
    /// The distance of two columns, mm.
    pub column_step_mm: f64,
    /// The distance of two rows, mm.
    pub row_step_mm: f64,
    /// The y of row 0, mm.
    pub first_row_mm: f64,
}

/// One coefficient's share in the value at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// The coefficient's row.
    pub row: usize,
    /// Its column, counted from the midline.
    pub column: usize,
    /// Whether it stands in for its mirror image: what points sideways changes its sign.
    pub mirrored: bool,
    /// Its weight in the value, and in the slopes along x and y (per mm).
    pub weights: [f64; 3],
}

impl MirroredSpline {
    /// The sixteen coefficients that make up the value at (x, y).
    pub fn terms(&self, x: f64, y: f64) -> [Term; 16] {
        let full = 2 * self.columns;
        let (first_column, u) = locate(x / self.column_step_mm + 0.5 * (full as f64 - 1.0), full);
        let (first_row, v) = locate((y - self.first_row_mm) / self.row_step_mm, self.rows);
        let ((wx, dx), (wy, dy)) = (cubic(u), cubic(v));
        std::array::from_fn(|k| {
            let (i, j) = (k % 4, k / 4);
            let column = first_column + i;
            let mirrored = column < self.columns;
            let column = if mirrored { self.columns - 1 - column } else { column - self.columns };
            let slopes = [dx[i] * wy[j] / self.column_step_mm, wx[i] * dy[j] / self.row_step_mm];
            Term { row: first_row + j, column, mirrored, weights: [wx[i] * wy[j], slopes[0], slopes[1]] }
        })
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_reproduce_a_plane() {
        let spline =
            MirroredSpline { columns: 12, rows: 16, column_step_mm: 5.6, row_step_mm: 8.0, first_row_mm: -38.0 };
        for (x, y) in [(0.0, 0.0), (3.3, -29.9), (-58.0, 70.0), (58.8, 74.0), (11.2, 2.0)] {
            let terms = spline.terms(x, y);
            let sum = |k: usize| terms.iter().map(|t| t.weights[k]).sum::<f64>();
            assert!((sum(0) - 1.0).abs() < 1e-12 && sum(1).abs() < 1e-12 && sum(2).abs() < 1e-12);
            let row_y = |row: usize| -38.0 + 8.0 * row as f64;
            let plane: f64 = terms.iter().map(|t| t.weights[0] * row_y(t.row)).sum();
            assert!((plane - y).abs() < 1e-9, "coefficients in a line give a line");
            let column_x = |t: &Term| (t.column as f64 + 0.5) * 5.6 * if t.mirrored { -1.0 } else { 1.0 };
            let across: f64 = terms.iter().map(|t| t.weights[0] * column_x(t)).sum();
            assert!((across - x).abs() < 1e-9, "mirrored with changed sign they give x");
        }
    }
}
