//! A carved figure, twice a person's height, on a stepped base.

use super::super::implicit::{ellipsoid, join, limb};
use super::super::shapes::Dice;
use super::super::solids::{append, cuboid, post};
use super::super::surface_nets;
use super::super::texture::rough;
use visage_geometry::{Bounds, Mesh, Point3};

/// Edge of the grid cells, metres.
const CELL: f64 = 0.045;
/// How high the base is, metres.
const BASE: f64 = 0.6;

/// A body that winds upward from lump to lump with arms and drapery, chisel marks all over; metres.
pub fn sculpture(dice: &mut Dice) -> Mesh {
    let lumps: Vec<([f64; 3], [f64; 3])> = (0..7)
        .map(|k| {
            let height = BASE + 0.25 + 0.36 * f64::from(k);
            let slim = 1.0 - 0.075 * f64::from(k);
            let off = [dice.between(-0.2, 0.2), dice.between(-0.05, 0.05), dice.between(-0.2, 0.2)];
            let radii = [dice.about(0.46), dice.about(0.36), dice.about(0.38)].map(|radius| radius * slim);
            ([off[0], height + off[1], off[2]], radii)
        })
        .collect();
    let arms: Vec<([f64; 3], [f64; 3], f64)> = (0..4)
        .map(|_| {
            let start = lumps[2 + dice.number() as usize % 4].0;
            let way = dice.direction();
            let end = [start[0] + 0.75 * way.x, start[1] + 0.55 * way.y.abs(), start[2] + 0.75 * way.z];
            (start, end, dice.between(0.09, 0.17))
        })
        .collect();
    let top = lumps[6].0;
    let face = dice.direction();
    let field = |p: &Point3| {
        let mut body = f64::INFINITY;
        for (center, radii) in &lumps {
            let lump = ellipsoid(p, *center, *radii);
            body = if body.is_finite() { join(body, lump, 0.2) } else { lump };
        }
        for (start, end, radius) in &arms {
            body = join(body, limb(p, *start, *end, *radius, 0.6 * radius), 0.08);
        }
        let nose = [top[0] + 0.3 * face.x, top[1] + 0.05, top[2] + 0.3 * face.z];
        join(body, limb(p, top, nose, 0.14, 0.06), 0.06)
    };
    let bounds = Bounds { min: Point3::new(-1.2, BASE - 0.35, -1.2), max: Point3::new(1.2, BASE + 3.5, 1.2) };
    let mut mesh = surface_nets::mesh(&field, &bounds, CELL);
    let normals = mesh.vertex_normals();
    let seed = dice.number();
    for (vertex, normal) in mesh.vertices.iter_mut().zip(&normals) {
        *vertex += normal * (0.035 * rough(&Point3::from(vertex.coords * 3.5), 3, seed));
    }
    append(&mut mesh, &cuboid([-0.95, 0.0, -0.8], [0.95, 0.3, 0.8]));
    append(&mut mesh, &cuboid([-0.75, 0.3, -0.62], [0.7, BASE, 0.66]));
    append(&mut mesh, &post([0.55, 0.3, 0.7], dice.about(0.5), 0.09, 0.07));
    mesh
}
