//! A scan reduced to what rough registration needs of it: a few thousand oriented surfels, each described once.

use rayon::prelude::*;

use super::descriptor::{Descriptors, describe};
use super::sight::SightMap;
use crate::geometry::Vector3;
use crate::geometry::neighbours::{IndexedPoints, LocalPoint};
use crate::geometry::normals::least_spread;
use crate::geometry::thinning::thin;
use crate::registration::sensor::{Sensor, outer_side, sheet_axis};
use crate::registration::view::View;

/// A view's sketch, in its local frame.
#[derive(Debug, Clone)]
pub struct Sketch {
    /// Surfel positions with their tree.
    pub indexed: IndexedPoints,
    /// Unit normals towards the scanner.
    pub normals: Vec<nalgebra::Vector3<f32>>,
    /// Whether the surface goes on all around.
    pub is_inner: Vec<bool>,
    /// The indices of the inner surfels, in order.
    pub inner: Vec<u32>,
    /// Where the scanner stood.
    pub sensor: Sensor,
    /// How clear the scanner's side is: 0 (a coin toss) to 1 (told by the file or plain to see).
    pub side_clarity: f64,
    /// The largest distance of a surfel from the view's centroid.
    pub radius: f64,
    /// What the surface looks like around each inner surfel.
    pub descriptors: Descriptors,
    /// What the scanner saw in each direction.
    pub sight: SightMap,
}

/// Radius of a normal's neighbourhood, in edges.
const NORMAL_REACH: f64 = 1.2;
/// A surfel lies on a rim if the mean of its neighbourhood is farther off than this share of its radius: half a disc
/// has its mean at 0.42.
const RIM_OFFSET: f32 = 0.3;
/// Directions tried for the viewing axis, over the half sphere.
const DIRECTIONS: usize = 150;
/// Side of the cells in which a sheet is told from two, in edges.
const SHEET_CELL: f64 = 2.0;

impl Sketch {
    /// Sketches a view with surfels of one voxel of edge `edge`; `sensor` if the file or the caller told it.
    pub fn new(view: &View, edge: f64, sensor: Option<Sensor>) -> Self {
        let centroids = thin(view.points(), edge as f32).centroids;
        let reach = (NORMAL_REACH * edge) as f32;
        let fitted: Vec<(nalgebra::Vector3<f32>, bool)> =
            centroids.iter().map(|center| fit(&view.indexed, center, reach)).collect();
        let (mut normals, is_inner): (Vec<_>, Vec<bool>) = fitted.into_iter().unzip();
        let (sensor, side_clarity) = match sensor {
            Some(sensor) => (sensor, 1.0),
            None => own_side(&centroids, &normals, edge),
        };
        for (normal, point) in normals.iter_mut().zip(&centroids) {
            if normal.cast::<f64>().dot(&sensor.direction_from(point)) < 0.0 {
                *normal = -*normal;
            }
        }
        let inner: Vec<u32> = (0..is_inner.len() as u32).filter(|index| is_inner[*index as usize]).collect();
        let radius = centroids.iter().map(|c| nalgebra::Vector3::from(*c).norm()).fold(0.0f32, f32::max).into();
        let indexed = IndexedPoints::new(centroids);
        let descriptors = describe(&indexed, &normals, &inner, edge);
        let sight = SightMap::new(view.points(), &sensor, edge);
        Sketch { indexed, normals, is_inner, inner, sensor, side_clarity, radius, descriptors, sight }
    }

    /// The number of surfels.
    pub fn len(&self) -> usize {
        self.normals.len()
    }

    /// A surfel's position.
    pub fn position(&self, index: usize) -> nalgebra::Vector3<f32> {
        self.indexed.points[index].into()
    }
}

/// Sketches all views with one common edge, in parallel.
pub fn sketch_all(views: &[View], edge: f64, sensors: &[Option<Sensor>]) -> Vec<Sketch> {
    views.par_iter().zip(sensors).with_max_len(1).map(|(view, sensor)| Sketch::new(view, edge, *sensor)).collect()
}

/// The scanner's side, read off the scan alone: what a scanner sees of a body bulges towards it.
fn own_side(points: &[LocalPoint], normals: &[nalgebra::Vector3<f32>], edge: f64) -> (Sensor, f64) {
    let positions: Vec<Vector3> = points.iter().map(|p| nalgebra::Vector3::from(*p).cast::<f64>()).collect();
    let axis = sheet_axis(&positions, SHEET_CELL * edge, DIRECTIONS);
    let samples: Vec<(LocalPoint, [f32; 3])> = points.iter().zip(normals).map(|(p, n)| (*p, (*n).into())).collect();
    let middle = positions.iter().sum::<Vector3>() / positions.len().max(1) as f64;
    outer_side(axis, &samples, &middle)
}

/// The normal (its sign arbitrary) at `center`, and whether the surface goes on all around it.
fn fit(indexed: &IndexedPoints, center: &LocalPoint, reach: f32) -> (nalgebra::Vector3<f32>, bool) {
    let center = nalgebra::Vector3::from(*center);
    let (mut count, mut sum, mut squares) = (0.0f32, nalgebra::Vector3::zeros(), nalgebra::Matrix3::zeros());
    indexed.tree.for_each_within(&center.into(), reach * reach, |neighbour| {
        let d = nalgebra::Vector3::from(indexed.points[neighbour.index as usize]) - center;
        count += 1.0;
        sum += d;
        squares += d * d.transpose();
    });
    if count < 3.0 {
        return (nalgebra::Vector3::z(), false);
    }
    let mean = sum / count;
    let (normal, _) = least_spread(&(squares / count - mean * mean.transpose()).cast::<f64>());
    (normal.cast::<f32>(), mean.norm() < RIM_OFFSET * reach)
}
