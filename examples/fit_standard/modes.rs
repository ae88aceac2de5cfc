//! The modes: every face is registered to the relief by a smooth symmetric displacement, turn, place, size and
//! proportions are taken out, and the principal components of the rest are kept.

use nalgebra::{DMatrix, DVector};
use visage::faces::modes::{COLUMNS, LANDMARKS, MODES, ROWS, SPLINE};
use visage::faces::relief;
use visage::faces::spline::Term;
use visage::faces::target::Target;
use visage::faces::template::is_in_region;
use visage::geometry::{Point3, Vector3};
use visage::saliency::{CellGrid, Samples};

use super::dataset::{POSING, PosedFace};

/// The grid over the face on which surfaces are compared, mm.
const STEP_MM: f64 = 3.0;
/// Samples of each face.
const SPACING_MM: f64 = 1.5;
/// Their normals are averaged over this radius, mm, as the detector's are.
const SMOOTHING_MM: f64 = 6.0;
/// Counterparts are looked for within this, mm; it shrinks to a third.
const REACH_MM: f64 = 15.0;
/// Residuals beyond this hardly count (Geman-McClure).
const ROBUST_MM: f64 = 3.0;
/// A landmark counts as much as this many grid points.
const LANDMARK_WEIGHT: f64 = 8.0;
/// Weight of squared second differences of the coefficients.
const SMOOTHNESS: f64 = 0.6;
/// Weight of the squared coefficients themselves: what nothing holds stays.
const STIFFNESS: f64 = 1e-2;
const ROUNDS: usize = 20;
const UNKNOWNS: usize = 3 * ROWS * COLUMNS;

/// One place of the grid: the relief's point and normal there, and the spline's terms.
struct Place {
    point: Point3,
    normal: Vector3,
    terms: [Term; 16],
}

impl Place {
    fn at(x: f64, y: f64) -> Place {
        let (point, normal) = relief::at(x, y);
        Place { point, normal, terms: SPLINE.terms(x, y) }
    }

    fn displacement(&self, coefficients: &DVector<f64>) -> Vector3 {
        let mut sum = Vector3::zeros();
        for term in &self.terms {
            for axis in 0..3 {
                sum[axis] += sign(term, axis) * term.weights[0] * coefficients[index(term, axis)];
            }
        }
        sum
    }
}

fn index(term: &Term, axis: usize) -> usize {
    3 * (term.row * COLUMNS + term.column) + axis
}

fn sign(term: &Term, axis: usize) -> f64 {
    if term.mirrored && axis == 0 { -1.0 } else { 1.0 }
}

fn grid() -> Vec<Place> {
    let steps = |from: f64, to: f64| (0..=((to - from) / STEP_MM) as i32).map(move |k| from + STEP_MM * f64::from(k));
    steps(relief::LOWEST_MM, relief::HIGHEST_MM)
        .flat_map(|y| steps(-57.0, 57.0).map(move |x| (x, y)))
        .filter(|&(x, y)| is_in_region(x, y))
        .map(|(x, y)| Place::at(x, y))
        .collect()
}

/// The normal equations of a displacement.
struct Equations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Equations {
    fn new(smoothness: f64, stiffness: f64) -> Equations {
        let mut matrix = DMatrix::identity(UNKNOWNS, UNKNOWNS) * stiffness;
        let mut add = |indices: [(usize, f64); 3]| {
            for (i, a) in indices {
                for (j, b) in indices {
                    matrix[(i, j)] += smoothness * a * b;
                }
            }
        };
        for axis in 0..3 {
            let at = |row: usize, column: usize| 3 * (row * COLUMNS + column) + axis;
            let image = if axis == 0 { -1.0 } else { 1.0 };
            for row in 0..ROWS {
                add([(at(row, 0), image), (at(row, 0), -2.0), (at(row, 1), 1.0)]);
                for column in 1..COLUMNS - 1 {
                    add([(at(row, column - 1), 1.0), (at(row, column), -2.0), (at(row, column + 1), 1.0)]);
                }
            }
            for row in 1..ROWS - 1 {
                for column in 0..COLUMNS {
                    add([(at(row - 1, column), 1.0), (at(row, column), -2.0), (at(row + 1, column), 1.0)]);
                }
            }
        }
        Equations { matrix, right: DVector::zeros(UNKNOWNS) }
    }

    /// `direction . displacement(place) = value`
    fn add(&mut self, place: &Place, direction: &Vector3, value: f64, weight: f64) {
        let entries: Vec<(usize, f64)> = place
            .terms
            .iter()
            .flat_map(|t| (0..3).map(move |axis| (index(t, axis), sign(t, axis) * t.weights[0] * direction[axis])))
            .collect();
        for (i, a) in &entries {
            self.right[*i] += weight * a * value;
            for (j, b) in &entries {
                self.matrix[(*i, *j)] += weight * a * b;
            }
        }
    }

    /// `displacement(place) = vector`
    fn add_vector(&mut self, place: &Place, vector: &Vector3, weight: f64) {
        for axis in 0..3 {
            self.add(place, &Vector3::ith(axis, 1.0), vector[axis], weight);
        }
    }

    fn solve(self) -> DVector<f64> {
        self.matrix.cholesky().expect("smoothing makes it definite").solve(&self.right)
    }
}

/// The displacement that lays the relief onto a face.
fn registered(face: &PosedFace, places: &[Place]) -> DVector<f64> {
    let near = |p: &Point3| p.x.abs() < 75.0 && p.y > -50.0 && p.y < 95.0 && p.z > 20.0;
    let mut samples = Samples::from_part(&face.mesh, SPACING_MM, near);
    let cells = CellGrid::new(&samples.points, 4.0);
    samples.normals = samples.smoothed_normals(&samples, &cells, SMOOTHING_MM);
    let target = Target { samples: &samples, grid: &cells, sign: 1.0 };
    let landmarks: Vec<(Place, Vector3)> = POSING
        .iter()
        .filter_map(|(name, [x, y, _])| {
            let found = face.landmarks[LANDMARKS.iter().position(|l| l == name)?]?;
            let place = Place::at(*x, *y);
            let offset = found - place.point;
            Some((place, offset))
        })
        .collect();
    let mut displacement = DVector::zeros(UNKNOWNS);
    let mut residual = 0.0;
    for round in 0..ROUNDS {
        let fade = 1.0 - 2.0 / 3.0 * round as f64 / ROUNDS as f64;
        let mut equations = Equations::new(SMOOTHNESS * (0.3 + 3.0 * (fade - 1.0 / 3.0)), STIFFNESS);
        let (mut squares, mut weights) = (0.0, 0.0);
        for place in places {
            let moved = place.displacement(&displacement);
            let point = place.point + moved;
            let Some(near) = target.counterpart(&point, &place.normal, REACH_MM * fade, 0.5) else { continue };
            let distance = near.normal.dot(&(near.point - point));
            let weight = (1.0 + (distance / ROBUST_MM).powi(2)).powi(-2);
            squares += weight * distance * distance;
            weights += weight;
            equations.add(place, &near.normal, near.normal.dot(&(near.point - place.point)), weight);
        }
        for (place, offset) in &landmarks {
            equations.add_vector(place, offset, LANDMARK_WEIGHT);
        }
        displacement = equations.solve();
        residual = (squares / f64::max(weights, 1.0)).sqrt();
    }
    let at_landmarks: Vec<f64> = landmarks.iter().map(|(p, o)| (p.displacement(&displacement) - o).norm()).collect();
    eprintln!("{}: residual {residual:.2} mm, landmarks {at_landmarks:.1?}", face.source);
    displacement
}

/// A registered face: its places over the grid and its landmarks, weighted.
struct Registered {
    points: Vec<Point3>,
    landmarks: [Option<Point3>; LANDMARKS.len()],
    weight: f64,
}

impl Registered {
    /// Takes out turn, place, size and proportions against `mean`.
    fn align(&mut self, mean: &[Point3]) {
        for _ in 0..8 {
            let center = |points: &[Point3]| points.iter().map(|p| p.coords).sum::<Vector3>() / points.len() as f64;
            let (from, to) = (center(&self.points), center(mean));
            let mut correlation = nalgebra::Matrix3::zeros();
            for (p, q) in self.points.iter().zip(mean) {
                correlation += (q.coords - to) * (p.coords - from).transpose();
            }
            let rotation = visage::geometry::se3::nearest_rotation(&correlation);
            let (mut products, mut squares) = (Vector3::zeros(), Vector3::zeros());
            for (p, q) in self.points.iter().zip(mean) {
                let turned = rotation * (p.coords - from);
                products += turned.component_mul(&(q.coords - to));
                squares += turned.component_mul(&turned);
            }
            let growth = products.component_div(&squares);
            let place = |p: &Point3| Point3::from((rotation * (p.coords - from)).component_mul(&growth) + to);
            self.points = self.points.iter().map(place).collect();
            self.landmarks = self.landmarks.map(|l| l.as_ref().map(place));
        }
    }
}

/// The weighted mean of vectors.
fn mean(items: impl Iterator<Item = (Vector3, f64)>) -> Vector3 {
    let (sum, weights) = items.fold((Vector3::zeros(), 0.0), |(s, w), (v, weight)| (s + v * weight, w + weight));
    sum / f64::max(weights, f64::MIN_POSITIVE)
}

/// Each landmark made symmetric with its counterpart on the other side.
fn symmetric(landmarks: [Option<Point3>; LANDMARKS.len()]) -> [Option<Point3>; LANDMARKS.len()] {
    const OTHER: [usize; LANDMARKS.len()] = [3, 2, 1, 0, 4, 5, 7, 6, 8, 9];
    std::array::from_fn(|k| {
        let (p, q) = (landmarks[k]?, landmarks[OTHER[k]]?);
        Some(Point3::new((p.x - q.x) / 2.0, (p.y + q.y) / 2.0, (p.z + q.z) / 2.0))
    })
}

/// The table of modes as Rust source.
pub fn table(faces: &[PosedFace]) -> String {
    let places = grid();
    let mut all: Vec<Registered> = faces
        .iter()
        .map(|face| {
            let displacement = registered(face, &places);
            let points = places.iter().map(|p| p.point + p.displacement(&displacement)).collect();
            // a source of many faces counts more than one of few, but not in proportion
            let weight = super::of_its_source(face, faces).powf(-0.5);
            Registered { points, landmarks: symmetric(face.landmarks), weight }
        })
        .collect();
    let mut middle: Vec<Point3> = places.iter().map(|p| p.point).collect();
    for _ in 0..5 {
        for face in &mut all {
            face.align(&middle);
        }
        middle =
            (0..places.len()).map(|k| Point3::from(mean(all.iter().map(|f| (f.points[k].coords, f.weight))))).collect();
    }
    let landmarks: Vec<Vector3> = (0..LANDMARKS.len())
        .map(|l| mean(all.iter().filter_map(|f| Some((f.landmarks[l]?.coords, f.weight)))))
        .collect();
    let fields: Vec<DVector<f64>> = all
        .iter()
        .map(|f| spline(&places, &(0..places.len()).map(|k| f.points[k] - middle[k]).collect::<Vec<_>>()))
        .collect();
    let mut displacements =
        vec![spline(&places, &(0..places.len()).map(|k| middle[k] - places[k].point).collect::<Vec<_>>())];
    let mut carried: Vec<Vec<Vector3>> = vec![landmarks.clone()];
    for (combination, spread) in components(&all, &middle) {
        eprintln!("mode: {spread:.2} mm");
        displacements.push(fields.iter().zip(&combination).map(|(f, a)| f * *a).sum());
        let moved = |l: usize| {
            let offsets =
                all.iter().zip(&combination).filter_map(|(f, a)| Some((f.landmarks[l]?.coords - landmarks[l]) * *a));
            offsets.sum::<Vector3>()
        };
        carried.push((0..LANDMARKS.len()).map(moved).collect());
    }
    source(&displacements, &carried)
}

/// The displacement field through vectors at the grid's places.
fn spline(places: &[Place], vectors: &[Vector3]) -> DVector<f64> {
    let mut equations = Equations::new(0.05, 1e-4);
    for (place, vector) in places.iter().zip(vectors) {
        equations.add_vector(place, vector, 1.0);
    }
    equations.solve()
}

/// The strongest principal components as combinations of the faces: one standard deviation each, with its root
/// mean square displacement.
fn components(all: &[Registered], middle: &[Point3]) -> Vec<(Vec<f64>, f64)> {
    let total: f64 = all.iter().map(|f| f.weight).sum();
    let offset = |f: &Registered, k: usize| (f.points[k] - middle[k]) * (f.weight / total).sqrt();
    let gram = DMatrix::from_fn(all.len(), all.len(), |i, j| {
        (0..middle.len()).map(|k| offset(&all[i], k).dot(&offset(&all[j], k))).sum::<f64>() / middle.len() as f64
    });
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    eprintln!("spread of all: {:.2} mm", eigen.eigenvalues.sum().sqrt());
    order
        .into_iter()
        .take(MODES)
        .map(|m| {
            let combination = (0..all.len()).map(|i| eigen.eigenvectors[(i, m)] * (all[i].weight / total).sqrt());
            (combination.collect(), eigen.eigenvalues[m].max(0.0).sqrt())
        })
        .collect()
}

fn source(displacements: &[DVector<f64>], landmarks: &[Vec<Vector3>]) -> String {
    let vector = |v: [f64; 3]| format!("[{:.2}, {:.2}, {:.2}]", v[0], v[1], v[2]).replace("-0.00", "0.00");
    let rows = |field: &DVector<f64>| -> String {
        let cell = |row: usize, column: usize| {
            let first = 3 * (row * COLUMNS + column);
            vector([field[first], field[first + 1], field[first + 2]])
        };
        let row =
            |r: usize| format!("        [{}],\n", (0..COLUMNS).map(|c| cell(r, c)).collect::<Vec<_>>().join(", "));
        format!("    [\n{}    ],\n", (0..ROWS).map(row).collect::<String>())
    };
    let fields: String = displacements.iter().map(rows).collect();
    let carried: String = landmarks
        .iter()
        .map(|l| format!("    [{}],\n", l.iter().map(|v| vector((*v).into())).collect::<Vec<_>>().join(", ")))
        .collect();
    format!(
        "//! The modes of the built-in face, mm. Made by `examples/fit_standard`; not to be edited by hand.\n\n\
         #![allow(clippy::approx_constant)] // a displacement may happen to look like one\n\n\
         use super::modes::{{COLUMNS, LANDMARKS, MODES, ROWS}};\n\n\
         /// Displacements (across, up, out): the mean correction, then each mode at one standard deviation. Rows from\n\
         /// the upper lip to the forehead, columns from the midline outward.\n\
         #[rustfmt::skip]\n\
         pub(super) const DISPLACEMENTS: [[[[f32; 3]; COLUMNS]; ROWS]; MODES + 1] = [\n{fields}];\n\n\
         /// The landmarks' mean places, then how each mode moves them.\n\
         #[rustfmt::skip]\n\
         pub(super) const LANDMARK_MODES: [[[f32; 3]; LANDMARKS.len()]; MODES + 1] = [\n{carried}];\n"
    )
}
