//! From a surface to its facial triangles, over all scale levels and, where it is open, both sides.

use super::candidates::{Candidate, candidates};
use super::features::{features, places};
use super::standard::{INNER_EYE_DISTANCE_MM, Standard};
use crate::geometry::{Mesh, Unit, Vector3};
use crate::progress::{Canceled, Progress};
use crate::saliency::{CellGrid, Samples, Side};

/// Expected inner-eye distances as shares of the bounding box's diagonal, for files of unknown unit: from a
/// face alone down to a torso (the faces of the public set: 0.048 to 0.18).
const LEVELS_OF_DIAGONAL: [f64; 5] = [0.045, 0.06, 0.08, 0.106, 0.141];
/// Samples a level: their spacing as a share of the expected inner-eye distance.
const SPACING: f64 = 0.1;
/// A level that would need more samples than this is skipped: such a face would be a detail of the object.
const MOST_SAMPLES: usize = 45_000;

/// A surface ready to be sampled at any spacing, with consistent unit normals at its points.
#[derive(Debug, Clone, Copy)]
pub struct Oriented<'a> {
    /// Vertices, and faces unless it is a bare cloud.
    pub mesh: &'a Mesh,
    /// Unit normals at the vertices.
    pub normals: &'a [Vector3],
    /// Which side they point to.
    pub side: Side,
}

impl Oriented<'_> {
    fn sampled(&self, spacing: f64) -> Samples {
        if self.mesh.faces.is_empty() {
            Samples::from_cloud(&self.mesh.vertices, self.normals, spacing)
        } else {
            Samples::from_mesh(self.mesh, self.normals, spacing)
        }
    }

    /// The area of the surface; 0 for a bare cloud.
    fn area(&self) -> f64 {
        (0..self.mesh.faces.len()).map(|f| 0.5 * self.mesh.area_normal(f).norm()).sum()
    }
}

/// The facial triangles of all levels, cheapest first. `progress` is asked between levels.
pub fn detect(
    surface: &Oriented,
    unit: Unit,
    standard: &Standard,
    progress: &Progress,
) -> Result<Vec<Candidate>, Canceled> {
    let diagonal = surface.mesh.bounds().map_or(0.0, |b| b.diagonal());
    let levels: Vec<f64> = match unit.in_mm() {
        Some(mm) => vec![INNER_EYE_DISTANCE_MM / mm],
        None => LEVELS_OF_DIAGONAL.iter().map(|share| share * diagonal).collect(),
    };
    let area = surface.area();
    let mut found = Vec::new();
    for expected in levels {
        progress.check()?;
        let spacing = SPACING * expected;
        // a plane passes through at least area / spacing^2 cells: don't even start where that is too many
        if diagonal <= 0.0 || area / (spacing * spacing) > MOST_SAMPLES as f64 {
            continue;
        }
        let samples = surface.sampled(spacing);
        if samples.points.len() <= MOST_SAMPLES {
            found.extend(detect_level(&samples, expected, surface.side, standard));
        }
    }
    found.sort_by(|a, b| a.cost(standard).total().total_cmp(&b.cost(standard).total()));
    Ok(found)
}

fn detect_level(samples: &Samples, expected: f64, side: Side, standard: &Standard) -> Vec<Candidate> {
    let grid = CellGrid::new(&samples.points, 0.18 * expected);
    let features = features(samples, &grid, expected);
    side.signs()
        .iter()
        .flat_map(|&sign| candidates(&places(samples, &grid, &features, expected, sign), expected, standard))
        .collect()
}
