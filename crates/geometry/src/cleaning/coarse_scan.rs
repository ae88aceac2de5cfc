//! A scan in a few thousand surfels, enough to see planes and what is far from what.

use crate::Vector3;
use crate::neighbours::{IndexedPoints, LocalPoint};
use crate::normals::patch_within;
use crate::thinning::{Thinned, thin};

/// About how many surfels stand for a scan.
const SURFELS: f64 = 2500.0;
/// Never more than so many: where points lie in clumps their spacing says nothing.
const MOST_SURFELS: usize = 20_000;
/// A scan of n points has about `n (EDGE_FACTOR / edge)^2` voxels of an edge given in spacings.
const EDGE_FACTOR: f64 = 1.7;
/// A voxel narrower than this (in spacings) holds too few points to average.
const FINEST_EDGE: f64 = 2.5;
/// Radius of a surfel's neighbourhood, in edges.
const REACH: f64 = 1.2;
/// Points of a neighbourhood that are looked at: enough for a normal.
const NEIGHBOURS: usize = 60;

/// The surfels of a scan.
pub struct CoarseScan {
    /// Positions, along a space-filling curve.
    pub points: Vec<LocalPoint>,
    /// Unit normals, their signs arbitrary; none before [`CoarseScan::with_normals`].
    pub normals: Vec<Vector3>,
    /// Points in each surfel's voxel.
    pub counts: Vec<u32>,
    /// Edge of the voxels, a length.
    pub edge: f64,
    /// Spacing of the points.
    pub spacing: f64,
    /// Range accuracy of the points, a length.
    pub range_accuracy: f64,
}

impl CoarseScan {
    /// Looks coarsely at points with this spacing and range accuracy, without normals: they cost more than all the rest, and most
    /// sets are judged without.
    pub fn new(points: &[LocalPoint], spacing: f64, range_accuracy: f64) -> Self {
        let mut edge = spacing * (EDGE_FACTOR * (points.len() as f64 / SURFELS).sqrt()).max(FINEST_EDGE);
        let mut thinned = thin(points, edge as f32);
        while thinned.counts.len() > MOST_SURFELS {
            edge *= 1.5;
            thinned = thin(points, edge as f32);
        }
        let Thinned { centroids: points, counts } = thinned;
        CoarseScan { points, normals: Vec::new(), counts, edge, spacing, range_accuracy }
    }

    /// The same with normals, from the points that were surveyed.
    pub fn with_normals(self, indexed: &IndexedPoints) -> Self {
        let points = &indexed.points;
        // every so many points are enough for normals
        let step = (points.len() / (NEIGHBOURS * self.count()).max(1)).max(1);
        let sampled = (step > 1).then(|| IndexedPoints::new(points.iter().step_by(step).copied().collect()));
        let sampled = sampled.as_ref().unwrap_or(indexed);
        let reach = (REACH * self.edge) as f32;
        let normals = self.points.iter().map(|center| normal(sampled, center, reach)).collect();
        CoarseScan { normals, ..self }
    }

    /// The number of surfels.
    pub fn count(&self) -> usize {
        self.counts.len()
    }

    /// A surfel's position.
    pub fn position(&self, surfel: usize) -> Vector3 {
        nalgebra::Vector3::from(self.points[surfel]).cast::<f64>()
    }
}

/// The normal at `center`; zero where there are too few points.
fn normal(indexed: &IndexedPoints, center: &LocalPoint, reach: f32) -> Vector3 {
    patch_within(indexed, center, reach).normal.unwrap_or_else(Vector3::zeros)
}
