//! The heights of the relief: the robust, smoothed least-squares fit to all faces at once.

use nalgebra::{DMatrix, DVector};
use visage::faces::relief::{COLUMNS, HALF_WIDTH_MM, HIGHEST_MM, LOWEST_MM, ROWS, SPLINE};
use visage::geometry::{Mesh, Point3};

use super::dataset::PosedFace;

/// Residuals beyond this hardly count (Geman-McClure).
const ROBUST_MM: f64 = 3.0;
/// Weight of squared second differences of the coefficients, against a mean square residual.
const SMOOTHNESS: f64 = 4e-3;
const ROUNDS: usize = 6;

/// A piece of a posed face: where it is, and how much it counts.
struct Sample {
    point: Point3,
    weight: f64,
}

/// The centres of the faces that look to the front, inside the domain, weighted by projected area; the weights of
/// one mesh sum to `weight`.
fn front_samples(mesh: &Mesh, weight: f64) -> Vec<Sample> {
    let mut samples = Vec::new();
    for face in 0..mesh.faces.len() {
        let [a, b, c] = mesh.corners(face);
        let point = Point3::from((a.coords + b.coords + c.coords) / 3.0);
        let normal = mesh.area_normal(face);
        let inside = point.x.abs() < HALF_WIDTH_MM && point.y > LOWEST_MM && point.y < HIGHEST_MM;
        if inside && point.z > 50.0 && normal.z > 0.25 * normal.norm() {
            samples.push(Sample { point, weight: normal.z });
        }
    }
    let total: f64 = samples.iter().map(|s| s.weight).sum();
    for sample in &mut samples {
        sample.weight *= weight / total;
    }
    samples
}

/// The robust, smoothed least-squares fit, row by row.
fn fit(samples: &[Sample]) -> DVector<f64> {
    let unknowns = ROWS * COLUMNS;
    let mut coefficients = DVector::from_element(unknowns, 95.0);
    for round in 0..ROUNDS {
        let mut matrix = smoothness(unknowns);
        let mut right = DVector::zeros(unknowns);
        let (mut squares, mut weights) = (0.0, 0.0);
        for sample in samples {
            let terms =
                SPLINE.terms(sample.point.x, sample.point.y).map(|t| (t.row * COLUMNS + t.column, t.weights[0]));
            let residual = sample.point.z - terms.iter().map(|(k, w)| w * coefficients[*k]).sum::<f64>();
            let robust = (1.0 + (residual / ROBUST_MM).powi(2)).powi(-2);
            let weight = sample.weight * if round == 0 { 1.0 } else { robust };
            squares += weight * residual * residual;
            weights += weight;
            for (k, w) in terms {
                right[k] += weight * w * sample.point.z;
                for (l, v) in terms {
                    matrix[(k, l)] += weight * w * v;
                }
            }
        }
        eprintln!("round {round}: weighted residual {:.3} mm", (squares / weights).sqrt());
        coefficients = matrix.cholesky().expect("smoothing makes it definite").solve(&right);
    }
    coefficients
}

/// Squared second differences along rows and columns (across the midline too).
fn smoothness(unknowns: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::identity(unknowns, unknowns) * 1e-12;
    let mut add = |indices: [usize; 3]| {
        for (i, a) in indices.into_iter().zip([1.0, -2.0, 1.0]) {
            for (j, b) in indices.into_iter().zip([1.0, -2.0, 1.0]) {
                matrix[(i, j)] += SMOOTHNESS * a * b / unknowns as f64;
            }
        }
    };
    let at = |row: usize, column: usize| row * COLUMNS + column;
    for row in 0..ROWS {
        add([at(row, 0), at(row, 0), at(row, 1)]);
        for column in 1..COLUMNS - 1 {
            add([at(row, column - 1), at(row, column), at(row, column + 1)]);
        }
    }
    for row in 1..ROWS - 1 {
        for column in 0..COLUMNS {
            add([at(row - 1, column), at(row, column), at(row + 1, column)]);
        }
    }
    matrix
}

/// The table of coefficients as Rust source.
pub fn table(faces: &[PosedFace]) -> String {
    let weighted = |face: &PosedFace| front_samples(&face.mesh, 1.0 / super::of_its_source(face, faces));
    let samples: Vec<Sample> = faces.iter().flat_map(weighted).collect();
    let coefficients = fit(&samples);
    let row = |row: usize| {
        let cells: Vec<String> = (0..COLUMNS).map(|c| format!("{:.2}", coefficients[row * COLUMNS + c])).collect();
        format!("    [{}],\n", cells.join(", "))
    };
    let rows: String = (0..ROWS).map(row).collect();
    format!(
        "//! The coefficients of the built-in face, mm. Made by `examples/fit_standard`; not to be edited by hand.\n\n\
         use super::relief::{{COLUMNS, ROWS}};\n\n\
         /// Rows from the upper lip to the forehead, columns from the midline outward.\n\
         #[rustfmt::skip]\n\
         pub(super) const COEFFICIENTS: [[f32; COLUMNS]; ROWS] = [\n{rows}];\n"
    )
}
