//! Which side is outside, over all of space: the indicator whose gradient is the samples' normals, on coarse grids.
//!
//! Poisson surface reconstruction (Kazhdan, Bolitho and Hoppe, SGP 2006), for the one thing that only a global solution
//! knows: the sign far from data.

use rayon::prelude::*;

use super::free_space::{IsFree, JUST_OUTSIDE};
use super::grid::corners;
use super::samples::Samples;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Nodes along the longest axis of the finest of these grids, about.
        most_nodes: i32 = 96,
        /// Sweeps on each grid; each begins with what the coarser one found.
        sweeps: usize = 24,
        /// Over-relaxation of the sweeps.
        omega: f32 = 1.6,
    }
}

/// Values on all nodes whose coordinates are multiples of `step`.
#[derive(Debug, Clone)]
pub struct Dense {
    /// Edge of its cells, in cells of the finest grid; a power of two.
    pub step: i32,
    size: [usize; 3],
    values: Vec<f32>,
}

impl Dense {
    fn zeros(step: i32, size: &[i32; 3]) -> Self {
        let size = size.map(|nodes| (nodes / step) as usize + 2);
        Dense { step, size, values: vec![0.0; size.iter().product()] }
    }

    #[inline]
    fn index(&self, node: [usize; 3]) -> usize {
        (node[2] * self.size[1] + node[1]) * self.size[0] + node[0]
    }

    /// Between the nodes, at a place in cells of the finest grid; the nearest value beyond the border.
    pub fn at(&self, place: &[f32; 3]) -> f32 {
        self.spread(place).map(|(index, weight)| weight * self.values[index]).into_iter().sum()
    }

    /// Puts the nodes inside that are in free space outside.
    pub fn keep_out(&mut self, is_free: &IsFree) {
        let ([columns, rows, _], step) = (self.size, self.step);
        self.values.par_chunks_mut(columns * rows).enumerate().for_each(|(z, slice)| {
            for (k, value) in slice.iter_mut().enumerate().filter(|(_, value)| **value < 0.0) {
                if is_free(&[k % columns, k / columns, z].map(|at| (at as i32 * step) as f32)) {
                    *value = JUST_OUTSIDE;
                }
            }
        });
    }

    /// Calls `visit` with the first node, in steps, of each edge along which the sign changes.
    pub fn for_each_crossed(&self, mut visit: impl FnMut([i32; 3])) {
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        for z in 0..self.size[2] {
            for y in 0..self.size[1] {
                for x in 0..self.size[0] {
                    let at = self.index([x, y, z]);
                    let is_crossed = (0..3).any(|axis| {
                        [x, y, z][axis] + 1 < self.size[axis]
                            && (self.values[at + strides[axis]] < 0.0) != (self.values[at] < 0.0)
                    });
                    if is_crossed {
                        visit([x, y, z].map(|x| x as i32));
                    }
                }
            }
        }
    }

    /// The nodes around a place with the weights by which it lies between them.
    fn spread(&self, place: &[f32; 3]) -> [(usize, f32); 8] {
        let mut low = [0usize; 3];
        let mut share = [0.0f32; 3];
        for axis in 0..3 {
            let at = (place[axis] / self.step as f32).clamp(0.0, (self.size[axis] - 1) as f32);
            low[axis] = (at as usize).min(self.size[axis] - 2);
            share[axis] = at - low[axis] as f32;
        }
        corners(&share)
            .map(|(offset, weight)| (self.index(std::array::from_fn(|axis| low[axis] + offset[axis])), weight))
    }
}

/// The side of each node: +1 outside, -1 deep inside, 0 on the surface that most samples lie on.
pub fn sides(samples: &Samples, size: &[i32; 3]) -> Dense {
    let longest = size.iter().copied().max().unwrap_or(1);
    // the levels that follow begin one step finer than this: of small grids, too, it is not the finest
    let mut step = 2;
    while longest / step > TUNING.most_nodes {
        step *= 2;
    }
    let mut steps = vec![step];
    while longest / step > 8 {
        step *= 2;
        steps.push(step);
    }
    let mut found: Option<Dense> = None;
    for step in steps.into_iter().rev() {
        let mut next = Dense::zeros(step, size);
        if let Some(coarser) = &found {
            refine(coarser, &mut next);
        }
        let right = divergence(samples, &next);
        for _ in 0..TUNING.sweeps {
            sweep(&mut next, &right);
        }
        found = Some(next);
    }
    let mut found = found.unwrap_or_else(|| Dense::zeros(1, size));
    let sum: f64 =
        samples.samples.par_iter().map(|sample| f64::from(found.at(&sample.place))).collect::<Vec<f64>>().iter().sum();
    let level = (sum / samples.samples.len().max(1) as f64) as f32;
    let scale = 1.0 / level.abs().max(f32::MIN_POSITIVE);
    found.values.iter_mut().for_each(|value| *value = ((*value - level) * scale).clamp(-1.0, 1.0));
    found
}

fn refine(coarser: &Dense, next: &mut Dense) {
    let [columns, rows, _] = next.size;
    let step = next.step;
    next.values.par_chunks_mut(columns * rows).enumerate().for_each(|(z, slice)| {
        for (k, value) in slice.iter_mut().enumerate() {
            *value = coarser.at(&[k % columns, k / columns, z].map(|at| (at as i32 * step) as f32));
        }
    });
}

/// The divergence of the samples' normals, scaled to the differences between neighbours.
fn divergence(samples: &Samples, grid: &Dense) -> Vec<f32> {
    let mut sums = vec![[0.0f32; 3]; grid.values.len()];
    for sample in &samples.samples {
        for (index, weight) in grid.spread(&sample.place) {
            sums[index].iter_mut().zip(&sample.normal).for_each(|(sum, normal)| *sum += weight * normal);
        }
    }
    let strides = [1, grid.size[0], grid.size[0] * grid.size[1]];
    let scale = 0.5 / (grid.step * grid.step) as f32;
    let mut right = vec![0.0f32; sums.len()];
    for z in 1..grid.size[2] - 1 {
        for y in 1..grid.size[1] - 1 {
            for x in 1..grid.size[0] - 1 {
                let at = grid.index([x, y, z]);
                let change: f32 =
                    (0..3).map(|axis| sums[at + strides[axis]][axis] - sums[at - strides[axis]][axis]).sum();
                right[at] = scale * change;
            }
        }
    }
    right
}

/// One sweep of successive over-relaxation, nodes of one colour after those of the other; the border stays 0.
fn sweep(grid: &mut Dense, right: &[f32]) {
    let [columns, rows, slices] = grid.size;
    let strides = [1, columns, columns * rows];
    for color in 0..2 {
        for z in 1..slices - 1 {
            for y in 1..rows - 1 {
                let first = 1 + (z + y + 1 + color) % 2;
                for x in (first..columns - 1).step_by(2) {
                    let at = (z * rows + y) * columns + x;
                    let around: f32 = strides.iter().map(|d| grid.values[at - d] + grid.values[at + d]).sum();
                    let wanted = (around - right[at]) / 6.0;
                    grid.values[at] += TUNING.omega * (wanted - grid.values[at]);
                }
            }
        }
    }
}
