//! How faces differ from the built-in one: a mean correction and a few modes of deformation, each a displacement in
//! three dimensions over the relief, with the landmarks carried along. Frame and unit of the standard.
//!
//! The table is fitted together with the relief by `examples/fit_standard`: every face is registered to the relief
//! without folds, and the modes are the principal components of what is left after turn, place, size and proportions,
//! symmetric about the midline. A mode's weight is in standard deviations of the fitted faces.

use super::modes_table::{DISPLACEMENTS, LANDMARK_MODES};
use super::spline::MirroredSpline;
use visage_geometry::{Point3, Vector3};

/// How many modes there are.
pub const MODES: usize = 8;
/// Coefficients across half of the face.
pub const COLUMNS: usize = 6;
/// Coefficients along the height.
pub const ROWS: usize = 11;

/// The spline that the displacements are coefficients of: about 13 mm from one to the next, over the same area as
/// the relief.
pub const SPLINE: MirroredSpline = MirroredSpline {
    columns: COLUMNS,
    rows: ROWS,
    column_step_mm: super::relief::HALF_WIDTH_MM / (COLUMNS as f64 - 1.5),
    row_step_mm: STEP_MM,
    first_row_mm: super::relief::LOWEST_MM - STEP_MM,
};
const STEP_MM: f64 = (super::relief::HIGHEST_MM - super::relief::LOWEST_MM) / (ROWS as f64 - 3.0);

/// The weights of the modes, in standard deviations.
pub type Weights = nalgebra::SVector<f64, MODES>;

/// The landmarks that the standard carries, in the order of the table; right and left are the subject's own.
pub const LANDMARKS: [&str; 10] = [
    "eye_r_outer",
    "eye_r_inner",
    "eye_l_inner",
    "eye_l_outer",
    "nose_tip",
    "subnasale",
    "mouth_r",
    "mouth_l",
    "chin",
    "sellion",
];

/// A vector over the face with its derivatives along x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// The vector, mm.
    pub value: Vector3,
    /// Its derivative along x.
    pub along_x: Vector3,
    /// Its derivative along y.
    pub along_y: Vector3,
}

impl Jet {
    /// Adds `weight` times the other.
    pub fn add(&mut self, weight: f64, other: &Jet) {
        self.value += other.value * weight;
        self.along_x += other.along_x * weight;
        self.along_y += other.along_y * weight;
    }
}

/// The mean correction (first) and the modes at (x, y).
pub fn displacements(x: f64, y: f64) -> [Jet; MODES + 1] {
    let terms = SPLINE.terms(x, y);
    std::array::from_fn(|mode| {
        let mut sums = [Vector3::zeros(); 3];
        for term in &terms {
            let [across, up, out] = DISPLACEMENTS[mode][term.row][term.column].map(f64::from);
            let coefficient = Vector3::new(if term.mirrored { -across } else { across }, up, out);
            for (sum, weight) in sums.iter_mut().zip(term.weights) {
                *sum += coefficient * weight;
            }
        }
        Jet { value: sums[0], along_x: sums[1], along_y: sums[2] }
    })
}

/// The landmarks of a face with these weights, in the order of [`LANDMARKS`].
pub fn landmarks(weights: &Weights) -> [Point3; LANDMARKS.len()] {
    std::array::from_fn(|landmark| {
        let vector = |mode: usize| Vector3::from(LANDMARK_MODES[mode][landmark].map(f64::from));
        let moved = (0..MODES).map(|mode| vector(mode + 1) * weights[mode]).sum::<Vector3>();
        Point3::from(vector(0) + moved)
    })
}
