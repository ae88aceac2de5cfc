//! From a surface to its salient regions: mean curvature, weighted curvature `[P11]`, multi-scale saliency
//! `[P12]`, threshold and clustering. Pure.
//!
//! Meshes get their mean curvature from the cotangent Laplace-Beltrami operator ([`curvature`]), bare clouds
//! from local quadric fits ([`quadric`]). All of it works on [`CurvedSurface`]: positions, outward normals,
//! areas and mean curvature, convex positive.

pub mod cells;
pub mod curvature;
mod falloff;
pub mod multiscale;
pub mod orientation;
pub mod patches;
pub mod proximity;
pub mod quadric;
pub mod regions;
pub mod samples;
pub mod skin;

pub use cells::CellGrid;
pub use multiscale::{saliency, weighted_curvature};
pub use orientation::Side;
pub use patches::Patches;
pub use quadric::Principal;
pub use regions::{Region, RegionOptions, salient_regions};
pub use samples::Samples;

use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Bounds, Mesh, Point3, Vector3};

/// The paper's unit of scale: xi as a share of the bounding box's diagonal.
pub const XI_OF_DIAGONAL: f64 = 0.003;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// More points than this are gathered into cells before the multi-scale sums, whose cost grows with the
        /// square of the density. A head of this many points has a spacing of 1.6 xi: finer than the smallest sigma.
        max_points: usize = 40_000,
        /// The same if there are more than this many points to a cell: some files crowd their vertices into a few places.
        crowded: usize = 2,
        /// The finest cell, in xi, that points are gathered into.
        cell_in_xi: f64 = 1.5,
        /// Cells of a surface with too many neighbours are enlarged by this.
        coarser: f64 = 1.3,
    }
}

/// The median, of an even number the greater of both in the middle; `None` of nothing.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    let half = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)
}

/// Whether the multi-scale sums over these points would look at more pairs than [`cells::MOST_PAIRS`].
fn has_too_many_pairs(points: &[Point3], xi: f64) -> bool {
    xi > 0.0 && cells::pairs_within(points, multiscale::WIDEST_IN_XI * xi) > cells::MOST_PAIRS
}

/// Points of a surface with what saliency needs to know of each; all lists have one length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CurvedSurface {
    /// Positions, in the unit of the file.
    pub points: Vec<Point3>,
    /// Unit normals, outward if the sign is known (zero where no face with an area meets).
    pub normals: Vec<Vector3>,
    /// The area that each point stands for; 0 leaves its curvature out of every sum.
    pub areas: Vec<f64>,
    /// Mean curvature l(v), one over length; convex positive.
    pub mean_curvatures: Vec<f64>,
}

impl CurvedSurface {
    /// A mesh's vertices. `side` is the factor that turns the mesh's winding outward: 1 or -1.
    ///
    /// Curvatures beyond 1/xi are cut there: a radius below xi is noise to every scale of `[P12]`, and one
    /// needle-shaped face must not own the maximum that the maps are scaled by.
    pub fn from_mesh(mesh: &Mesh, side: f64) -> CurvedSurface {
        let mut surface = curvature::of_mesh(mesh, side);
        surface.cut_curvature();
        let gathered = surface.gathered(TUNING.cell_in_xi * surface.xi());
        let crowded = surface.points.len() > TUNING.crowded * gathered.points.len();
        let surface = if crowded || surface.points.len() > TUNING.max_points { gathered } else { surface };
        surface.bounded()
    }

    /// A bare cloud with unit normals: thinned to cells, its curvature from weighted quadric fits.
    pub fn from_cloud(points: &[Point3], normals: &[Vector3], progress: &Progress) -> Result<CurvedSurface, Canceled> {
        let xi = XI_OF_DIAGONAL * Bounds::of(points).map_or(0.0, |b| b.diagonal());
        let mut cell = TUNING.cell_in_xi * xi;
        let mut samples = Samples::from_cloud(points, normals, cell);
        while has_too_many_pairs(&samples.points, xi) {
            progress.check()?;
            cell *= TUNING.coarser;
            samples = Samples::from_cloud(points, normals, cell);
        }
        let mean_curvatures = quadric::mean_curvatures(&samples, progress)?;
        let Samples { points, normals, areas, .. } = samples;
        let mut surface = CurvedSurface { points, normals, areas, mean_curvatures };
        surface.cut_curvature();
        Ok(surface)
    }

    /// The same surface with so few points that sums over neighbours are bounded: what fills space has far more
    /// neighbours than a surface.
    fn bounded(self) -> CurvedSurface {
        let (mut surface, mut cell) = (self, TUNING.cell_in_xi);
        let xi = surface.xi();
        while has_too_many_pairs(&surface.points, xi) {
            cell *= TUNING.coarser;
            surface = surface.gathered(cell * xi);
        }
        surface
    }

    /// The paper's xi: 0.3 % of the diagonal of the bounding box.
    pub fn xi(&self) -> f64 {
        XI_OF_DIAGONAL * Bounds::of(&self.points).map_or(0.0, |b| b.diagonal())
    }

    fn cut_curvature(&mut self) {
        let limit = 1.0 / self.xi().max(f64::MIN_POSITIVE);
        for l in &mut self.mean_curvatures {
            *l = l.clamp(-limit, limit);
        }
    }

    /// The same surface with one point a cell: means weighted by area.
    fn gathered(&self, cell: f64) -> CurvedSurface {
        let cells = samples::gather(&self.points, &self.normals, &self.areas, cell);
        let mut sums = vec![0.0; cells.samples.points.len()];
        for (point, &cell) in cells.cell_of.iter().enumerate() {
            sums[cell as usize] += self.areas[point] * self.mean_curvatures[point];
        }
        let Samples { points, normals, areas, .. } = cells.samples;
        let mean_curvatures = sums.iter().zip(&areas).map(|(s, a)| if *a > 0.0 { s / a } else { 0.0 }).collect();
        CurvedSurface { points, normals, areas, mean_curvatures }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::curvature::tests::sphere;
    use rand::{RngExt, SeedableRng};

    /// Points that fill a cube.
    fn noise(count: usize) -> Vec<Point3> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        (0..count).map(|_| Point3::new(rng.random(), rng.random(), rng.random())).collect()
    }

    #[test]
    fn what_fills_space_is_thinned_until_its_sums_are_bounded_and_a_surface_is_not() {
        let points = noise(300_000);
        let normals = vec![Vector3::z(); points.len()];
        let xi = XI_OF_DIAGONAL * 3f64.sqrt();
        assert!(cells::pairs_within(&points, multiscale::WIDEST_IN_XI * xi) > cells::MOST_PAIRS);
        let curved = CurvedSurface::from_cloud(&points, &normals, &Progress::silent()).expect("not canceled");
        assert!(curved.points.len() > 5000);
        assert!(cells::pairs_within(&curved.points, multiscale::WIDEST_IN_XI * curved.xi()) <= cells::MOST_PAIRS);
        let mesh = sphere(1.0, 7);
        let (count, xi) = (mesh.vertices.len(), XI_OF_DIAGONAL * 12f64.sqrt());
        assert!(count > 60_000);
        assert!(cells::pairs_within(&mesh.vertices, multiscale::WIDEST_IN_XI * xi) < cells::MOST_PAIRS);
    }

    #[test]
    fn a_million_slivers_are_cut_into_a_bounded_number_of_pieces() {
        let sliver = |k: u32| {
            let y = 1e-5 * f64::from(k);
            [Point3::new(0.0, y, 0.0), Point3::new(1.0, y, 0.0), Point3::new(1.0, y + 1e-7, 0.0)]
        };
        let vertices: Vec<Point3> = (0..100_000).flat_map(sliver).collect();
        let faces = (0..100_000u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let samples = Samples::from_mesh(&Mesh { vertices, faces }, 1e-3);
        assert!(samples.points.len() < 2_000_000, "{}", samples.points.len());
    }
}
