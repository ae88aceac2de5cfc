//! Fits the built-in face: `cargo run --release --example fit_standard DATA > src/faces/relief_table.rs`.
//!
//! DATA is a folder with `manifest.csv` and `models/` (binary little-endian PLY). Taken are complete faces with exact
//! or published landmarks under the MIT, Apache-2.0 and CC0 licences. Each is laid onto the standard's landmarks by
//! a similarity; the spline is the robust least-squares fit to all of them, every source counting the same. An
//! optional second argument names a source to leave out (its files' prefix), to judge that source's faces honestly.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use visage::faces::relief::{COLUMNS, HALF_WIDTH_MM, HIGHEST_MM, LOWEST_MM, ROWS, terms};
use visage::geometry::{Mesh, Point3, Vector3};

/// The standard's landmarks, mm: inner and outer eye corners, sellion, nose tip, subnasale.
const LANDMARKS: [(&str, [f64; 3]); 7] = [
    ("eye_r_inner", [-18.4, 32.5, 92.0]),
    ("eye_l_inner", [18.4, 32.5, 92.0]),
    ("eye_r_outer", [-44.6, 34.3, 86.0]),
    ("eye_l_outer", [44.6, 34.3, 86.0]),
    ("sellion", [0.0, 36.3, 110.7]),
    ("nose_tip", [0.0, 4.1, 130.7]),
    ("subnasale", [0.0, -12.0, 115.7]),
];
/// Sources by the prefix of their files' names.
const SOURCES: [&str; 3] = ["ict_", "simpop_", "makehuman_"];
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

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, data, left_out @ ..] = arguments.as_slice() else {
        eprintln!("usage: fit_standard DATA [PREFIX OF THE SOURCE TO LEAVE OUT]");
        std::process::exit(2);
    };
    let mut samples = Vec::new();
    for source in SOURCES.iter().filter(|source| !left_out.iter().any(|out| out == *source)) {
        let faces = posed_faces(Path::new(data), source);
        eprintln!("{source}: {} faces", faces.len());
        for face in &faces {
            samples.extend(front_samples(face, 1.0 / faces.len() as f64));
        }
    }
    let coefficients = fit(&samples);
    print_table(&coefficients);
}

/// The faces of a source, laid onto the standard.
fn posed_faces(data: &Path, source: &str) -> Vec<Mesh> {
    let manifest = std::fs::read_to_string(data.join("manifest.csv")).expect("DATA has a manifest.csv");
    let rows: Vec<Vec<String>> = manifest.lines().map(split_csv).collect();
    let column = |name: &str| rows[0].iter().position(|c| c == name).expect("a known column");
    let (file, label, completeness, licence) =
        (column("file"), column("label"), column("completeness"), column("licence"));
    rows[1..]
        .iter()
        .filter(|row| row[label] == "face" && row[completeness] == "whole" && row[file].contains(&format!("/{source}")))
        .filter(|row| ["MIT", "Apache-2.0", "CC0-1.0"].iter().any(|free| row[licence].starts_with(free)))
        .filter_map(|row| {
            let landmarks = LANDMARKS.map(|(name, _)| numbers(&row[column(name)]));
            let landmarks: Vec<Point3> = landmarks.into_iter().flatten().collect();
            (landmarks.len() == LANDMARKS.len()).then(|| posed(load(&data.join(&row[file])), &landmarks))
        })
        .collect()
}

fn split_csv(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    for character in line.chars() {
        match character {
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            other => fields.last_mut().expect("never empty").push(other),
        }
    }
    fields
}

fn numbers(field: &str) -> Option<Point3> {
    let values: Vec<f64> = field.split_whitespace().filter_map(|v| v.parse().ok()).collect();
    <[f64; 3]>::try_from(values).ok().map(Point3::from)
}

fn load(path: &Path) -> Mesh {
    let bytes = std::fs::read(path).expect("the model is there");
    let end = bytes.windows(11).position(|w| w == b"end_header\n").expect("a PLY header") + 11;
    let header = std::str::from_utf8(&bytes[..end]).expect("an ASCII header");
    let count = |element: &str| -> usize {
        let line = header.lines().find(|l| l.starts_with(&format!("element {element} "))).expect("the element");
        line.rsplit(' ').next().expect("a count").parse().expect("a number")
    };
    let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")));
    let index = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let (vertices, faces) = (count("vertex"), count("face"));
    let start = end + 12 * vertices;
    Mesh {
        vertices: (0..vertices)
            .map(|v| end + 12 * v)
            .map(|at| Point3::new(float(at), float(at + 4), float(at + 8)))
            .collect(),
        faces: (0..faces).map(|f| start + 13 * f + 1).map(|at| [index(at), index(at + 4), index(at + 8)]).collect(),
    }
}

/// Lays the mesh onto the standard's landmarks by the least-squares similarity.
fn posed(mesh: Mesh, landmarks: &[Point3]) -> Mesh {
    let targets = LANDMARKS.map(|(_, place)| Point3::from(place));
    let mean = |points: &[Point3]| points.iter().map(|p| p.coords).sum::<Vector3>() / points.len() as f64;
    let (from, to) = (mean(landmarks), mean(&targets));
    let mut correlation = nalgebra::Matrix3::zeros();
    let mut spread = 0.0;
    for (p, q) in landmarks.iter().zip(&targets) {
        correlation += (q.coords - to) * (p.coords - from).transpose();
        spread += (p.coords - from).norm_squared();
    }
    let rotation = visage::geometry::se3::nearest_rotation(&correlation).to_rotation_matrix();
    let scale = (rotation.matrix().transpose() * correlation).trace() / spread;
    let vertices = mesh.vertices.iter().map(|p| Point3::from(rotation * (p.coords - from) * scale + to)).collect();
    Mesh { vertices, ..mesh }
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
            let terms = terms(sample.point.x, sample.point.y).map(|(row, column, w)| (row * COLUMNS + column, w[0]));
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

fn print_table(coefficients: &DVector<f64>) {
    println!(
        "//! The coefficients of the built-in face, mm. Made by `examples/fit_standard.rs`; not to be edited by hand.\n"
    );
    println!("use super::relief::{{COLUMNS, ROWS}};\n");
    println!("/// Rows from the upper lip to the forehead, columns from the midline outward.");
    println!("#[rustfmt::skip]");
    println!("pub(super) const COEFFICIENTS: [[f32; COLUMNS]; ROWS] = [");
    for row in 0..ROWS {
        let cells: Vec<String> = (0..COLUMNS).map(|c| format!("{:.2}", coefficients[row * COLUMNS + c])).collect();
        println!("    [{}],", cells.join(", "));
    }
    println!("];");
}
