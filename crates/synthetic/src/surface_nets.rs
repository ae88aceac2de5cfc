//! The surface of a field as a mesh: naive surface nets (Gibson 1998), then each vertex moved onto the surface.
//!
//! One vertex a grid cell that the surface crosses, one quad a grid edge that it crosses. The mesh is closed where
//! the solid lies inside the box, and wound outward.

use rayon::prelude::*;

use super::implicit;
use visage_geometry::{Bounds, Mesh, Point3, Vector3};

/// Meshes the surface of `field` (negative inside) within `bounds` on a grid of cubic cells with edge `cell`.
///
/// The solid must not touch the border of `bounds`. A surface of area A gives about `3 A / cell^2` triangles.
pub fn mesh(field: &(impl Fn(&Point3) -> f64 + Sync), bounds: &Bounds, cell: f64) -> Mesh {
    let grid = Grid::new(bounds, cell);
    let samples = grid.sample(field);
    let (cells, mut vertices) = place_vertices(&grid, &samples);
    let faces = quads(&grid, &samples, &cells);
    vertices.par_iter_mut().for_each(|vertex| *vertex = onto_surface(field, *vertex, cell));
    Mesh { vertices, faces }
}

/// Sample points, x running fastest.
struct Grid {
    origin: Point3,
    cell: f64,
    /// Samples along x, y and z.
    size: [usize; 3],
}

/// No vertex in this cell.
const NONE: u32 = u32::MAX;

impl Grid {
    fn new(bounds: &Bounds, cell: f64) -> Self {
        let extent = bounds.max - bounds.min;
        let size = [0, 1, 2].map(|axis| (extent[axis] / cell).ceil() as usize + 1);
        Grid { origin: bounds.min, cell, size }
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn position(&self, [x, y, z]: [usize; 3]) -> Point3 {
        self.origin + Vector3::new(x as f64, y as f64, z as f64) * self.cell
    }

    /// All samples whose coordinates are below `size` minus `margin`.
    fn walk(&self, margin: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
        let [nx, ny, nz] = [0, 1, 2].map(|axis| self.size[axis].saturating_sub(margin[axis]));
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    }

    fn sample(&self, field: &(impl Fn(&Point3) -> f64 + Sync)) -> Vec<f64> {
        let [nx, ny, nz] = self.size;
        let row = |row: usize| (0..nx).map(move |x| [x, row % ny, row / ny]);
        (0..ny * nz).into_par_iter().flat_map_iter(|r| row(r).map(|at| field(&self.position(at)))).collect()
    }
}

fn moved(mut at: [usize; 3], axis: usize, by: usize) -> [usize; 3] {
    at[axis] += by;
    at
}

/// For each cell (named by its lowest corner) its vertex or [`NONE`], and the vertices: the mean of the places where
/// the cell's edges cross the surface.
fn place_vertices(grid: &Grid, samples: &[f64]) -> (Vec<u32>, Vec<Point3>) {
    let mut cells = vec![NONE; samples.len()];
    let mut vertices = Vec::new();
    for corner in grid.walk([1, 1, 1]) {
        let mut sum = Vector3::zeros();
        let mut crossings = 0;
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for (du, dv) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let start = moved(moved(corner, u, du), v, dv);
                let (a, b) = (samples[grid.index(start)], samples[grid.index(moved(start, axis, 1))]);
                if (a < 0.0) != (b < 0.0) {
                    let mut crossing = grid.position(start).coords;
                    crossing[axis] += grid.cell * a / (a - b);
                    sum += crossing;
                    crossings += 1;
                }
            }
        }
        if crossings > 0 {
            cells[grid.index(corner)] = vertices.len() as u32;
            vertices.push(Point3::from(sum / f64::from(crossings)));
        }
    }
    (cells, vertices)
}

/// Two triangles for every grid edge that crosses the surface, from the vertices of the four cells around it.
fn quads(grid: &Grid, samples: &[f64], cells: &[u32]) -> Vec<[u32; 3]> {
    let mut faces = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for start in grid.walk(moved([1, 1, 1], axis, 0)) {
            let leaves = samples[grid.index(start)] < 0.0;
            let enters = samples[grid.index(moved(start, axis, 1))] < 0.0;
            if leaves == enters || start[u] == 0 || start[v] == 0 {
                continue;
            }
            let cell = |du: usize, dv: usize| {
                let mut corner = start;
                corner[u] -= du;
                corner[v] -= dv;
                cells[grid.index(corner)]
            };
            let [a, b, c, d] = [cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)];
            debug_assert!([a, b, c, d].iter().all(|vertex| *vertex != NONE), "a crossed edge has four crossed cells");
            if leaves {
                faces.extend([[a, b, c], [a, c, d]]);
            } else {
                faces.extend([[a, c, b], [a, d, c]]);
            }
        }
    }
    faces
}

/// A few Newton steps along the gradient, each of at most half a cell.
fn onto_surface(field: &impl Fn(&Point3) -> f64, mut vertex: Point3, cell: f64) -> Point3 {
    for _ in 0..4 {
        let gradient = implicit::gradient(field, &vertex, 1e-3 * cell);
        // in a sharp groove the gradient of a blend is short: don't overshoot
        let step = gradient * (field(&vertex) / gradient.norm_squared().max(0.25));
        vertex -= step.cap_magnitude(0.5 * cell);
    }
    vertex
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn ball() -> Mesh {
        let field = |p: &Point3| implicit::ellipsoid(p, [0.3, 0.0, 0.0], [5.0, 5.0, 5.0]);
        mesh(&field, &Bounds { min: Point3::new(-6.0, -6.0, -6.0), max: Point3::new(6.5, 6.0, 6.0) }, 0.5)
    }

    #[test]
    fn a_ball_is_round_and_wound_outward() {
        let ball = ball();
        for vertex in &ball.vertices {
            assert!(((vertex - Point3::new(0.3, 0.0, 0.0)).norm() - 5.0).abs() < 1e-6);
        }
        let volume = ball.signed_volume_6() / 6.0;
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 125.0;
        assert!((volume / expected - 1.0).abs() < 0.01, "{volume} is not about {expected}");
        let triangles = 3.0 * 4.0 * std::f64::consts::PI * 25.0 / 0.25;
        assert!((ball.faces.len() as f64 / triangles - 1.0).abs() < 0.1, "{}", ball.faces.len());
    }

    #[test]
    fn every_edge_has_two_faces_that_run_along_it_in_opposite_directions() {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for [a, b, c] in ball().faces {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|balance| *balance == 0));
    }
}
