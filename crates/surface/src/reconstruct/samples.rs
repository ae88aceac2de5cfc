//! The points of all views, averaged where they are many: what the field is made of.

use rayon::prelude::*;

use super::grid::{BlockKey, Blocks, block_of, place_of};
use visage_geometry::{Bounds, Point3};

/// A piece of surface, in edges of cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Mean position.
    pub place: [f32; 3],
    /// Outward unit normal.
    pub normal: [f32; 3],
    /// How many points it stands for.
    pub weight: f32,
}

/// Where the grid lies in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The node 0 0 0.
    pub origin: Point3,
    /// Edge of a cell, a length.
    pub cell: f64,
    /// The first node beyond what holds points, along each axis.
    pub size: [i32; 3],
}

/// Nodes of room around all points: blocks that are touched must be in the grid.
const ROOM: i32 = 16;

impl Frame {
    /// Around points within `bounds`.
    pub fn around(bounds: &Bounds, cell: f64) -> Self {
        let extent = bounds.max - bounds.min;
        let size = |axis: usize| (extent[axis] / cell).ceil() as i32 + 2 * ROOM + 1;
        let origin = bounds.min - nalgebra::Vector3::repeat(f64::from(ROOM) * cell);
        Frame { origin, cell, size: [size(0), size(1), size(2)] }
    }

    /// A place in edges of cells.
    #[inline]
    pub fn local(&self, point: &Point3) -> [f32; 3] {
        ((point - self.origin) / self.cell).cast::<f32>().into()
    }

    /// A place in the world.
    #[inline]
    pub fn world(&self, place: &[f32; 3]) -> Point3 {
        self.origin + nalgebra::Vector3::from(*place).cast::<f64>() * self.cell
    }
}

/// Samples in the order of their blocks, and for each block where its own begin.
#[derive(Debug, Clone)]
pub struct Samples {
    /// All of them.
    pub samples: Vec<Sample>,
    /// Ranges of `samples`.
    pub blocks: Blocks<std::ops::Range<u32>>,
}

/// Whether a normal is one: without a direction it is 0.
#[inline]
fn has_direction(normal: &nalgebra::Vector3<f32>) -> bool {
    normal.norm_squared() > 0.25
}

/// The cell of a point, in the order of blocks, and the eighth of directions that its normal points in.
#[inline]
fn bin(frame: &Frame, point: &Point3, normal: &nalgebra::Vector3<f32>) -> u64 {
    let octant = u64::from(normal.x < 0.0) | u64::from(normal.y < 0.0) << 1 | u64::from(normal.z < 0.0) << 2;
    let cell = frame.local(point).map(|x| x as i32);
    block_of(&cell) << 12 | (place_of(&cell) as u64) << 3 | octant
}

impl Samples {
    /// One for each cell and each eighth of the directions that normals point in: both sides of a wall stay apart.
    /// Points without a normal are left out.
    pub fn of(frame: &Frame, points: &[Point3], normals: &[nalgebra::Vector3<f32>]) -> Self {
        let mut order: Vec<(u64, u32)> = points
            .par_iter()
            .zip(normals)
            .enumerate()
            .filter(|(_, (_, normal))| has_direction(normal))
            .map(|(index, (point, normal))| (bin(frame, point, normal), index as u32))
            .collect();
        order.par_sort_unstable();
        let starts: Vec<usize> = (0..order.len()).filter(|k| *k == 0 || order[*k].0 != order[k - 1].0).collect();
        let mean = |(k, start): (usize, &usize)| {
            let end = starts.get(k + 1).copied().unwrap_or(order.len());
            let (mut place, mut normal) = (nalgebra::Vector3::<f32>::zeros(), nalgebra::Vector3::<f32>::zeros());
            for (_, index) in &order[*start..end] {
                place += nalgebra::Vector3::from(frame.local(&points[*index as usize]));
                normal += normals[*index as usize];
            }
            let count = (end - start) as f32;
            Sample { place: (place / count).into(), normal: normal.normalize().into(), weight: count }
        };
        let samples: Vec<Sample> = starts.par_iter().enumerate().map(mean).collect();
        let mut keys: Vec<BlockKey> = Vec::new();
        let mut ranges: Vec<std::ops::Range<u32>> = Vec::new();
        for (k, start) in starts.iter().enumerate() {
            let block = order[*start].0 >> 12;
            if keys.last() != Some(&block) {
                keys.push(block);
                ranges.push(k as u32..k as u32);
            }
            if let Some(range) = ranges.last_mut() {
                range.end = k as u32 + 1;
            }
        }
        Samples { samples, blocks: Blocks::new(keys, ranges) }
    }

    /// Each of the points that these are the samples of, with its own.
    pub fn of_points<'a>(
        &'a self,
        frame: &'a Frame,
        points: &'a [Point3],
        normals: &'a [nalgebra::Vector3<f32>],
    ) -> impl Iterator<Item = (&'a Sample, Point3)> {
        let mut order: Vec<(u64, u32)> = points
            .iter()
            .zip(normals)
            .enumerate()
            .filter(|(_, (_, normal))| has_direction(normal))
            .map(|(index, (point, normal))| (bin(frame, point, normal), index as u32))
            .collect();
        order.sort_unstable();
        let mut at = 0;
        let numbered: Vec<(usize, u32)> = (0..order.len())
            .map(|k| {
                at += usize::from(k > 0 && order[k].0 != order[k - 1].0);
                (at, order[k].1)
            })
            .collect();
        numbered.into_iter().map(|(sample, point)| (&self.samples[sample], points[point as usize]))
    }
}
