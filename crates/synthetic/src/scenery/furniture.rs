//! Rooms and what stands in them: tables with things on them, chairs, shelves, a turntable before a background.

use std::f64::consts::{PI, TAU};

use super::super::shapes::{Dice, catalogue};
use super::super::solids::{ball, cuboid, ground, hollow, post, scaled, sheet, together};
use super::super::texture::rough;
use super::{placed, placed_all, set_down, thing};
use visage_geometry::{Mesh, Point3};

/// A room and half of its shorter side.
pub fn room(dice: &mut Dice) -> (Mesh, f64) {
    let (x, z, high) = (dice.between(2.2, 2.9), dice.between(1.9, 2.6), dice.between(2.4, 2.9));
    let mut parts = vec![
        hollow([-x, 0.0, -z], [x, high, z]),
        // a chimney breast, a beam, skirting, pictures and a radiator under the window's sill
        cuboid([x - 0.35, 0.0, -0.7 * z], [x, high, -0.7 * z + dice.about(0.8)]),
        cuboid([-x, high - 0.22, -0.2], [x, high, 0.05]),
        cuboid([-x, 0.9, 0.1], [-x + 0.14, 1.0, 0.1 + dice.about(1.2)]),
        cuboid([-x, 0.1, 0.2], [-x + 0.1, 0.75, 0.2 + dice.about(0.9)]),
    ];
    // a wall reaches into the room, so that it is not seen whole from anywhere
    let (across, end) = (dice.between(-0.2, 0.2) * z, dice.between(-0.35, 0.0) * x);
    parts.push(cuboid([-x, 0.0, across], [end, high, across + 0.1]));
    for wall in [-1.0, 1.0] {
        let (at, wide) = (dice.between(-0.7, 0.3) * x, dice.between(0.4, 0.9));
        let (low, tall) = (dice.between(1.1, 1.4), dice.between(0.4, 0.7));
        let (a, b) = (wall * z, wall * (z - 0.05));
        parts.push(cuboid([at, low, f64::min(a, b)], [at + wide, low + tall, f64::max(a, b)]));
    }
    let spot = [dice.between(-0.4, 0.4) * x, 0.0, dice.between(-0.35, 0.35) * z];
    parts.push(placed(&laid_table(dice), dice.between(0.0, TAU), spot));
    for _ in 0..2 {
        let way = dice.between(0.0, TAU);
        let at = [spot[0] + 0.95 * way.cos(), 0.0, spot[2] + 0.95 * way.sin()];
        parts.push(placed_all(chair(dice), dice.between(0.0, TAU), at));
    }
    parts.push(placed_all(shelf(dice), 0.0, [dice.between(-0.5, 0.4) * x, 0.0, -z + 0.2]));
    parts.push(placed_all(sofa(dice), PI, [dice.between(-0.3, 0.3) * x, 0.0, z - 0.5]));
    parts.push(cuboid([-x, 0.0, -z], [-x + dice.about(0.5), dice.about(0.8), -z + dice.about(0.9)]));
    let corner = [x - 0.35, 0.0, z - 0.35];
    parts.push(post(corner, 1.5, 0.03, 0.03));
    parts.push(post([corner[0], 1.35, corner[2]], 0.35, 0.24, 0.13));
    (together(parts), x.min(z))
}

/// A table with some eight things on it.
pub fn laid_table(dice: &mut Dice) -> Mesh {
    let (x, z, high) = (dice.about(0.6), dice.about(0.42), dice.about(0.74));
    let mut parts = vec![cuboid([-x, high - 0.035, -z], [x, high, z])];
    for (side, end) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        parts.push(post([side * (x - 0.06), 0.0, end * (z - 0.06)], high - 0.03, 0.028, 0.03));
    }
    let shapes = catalogue();
    for k in 0..8 {
        let (column, row) = (k % 4, k / 4);
        let at = [
            x * (0.48 * f64::from(column) - 0.72 + dice.between(-0.06, 0.06)),
            high,
            z * (0.9 * f64::from(row) - 0.45 + dice.between(-0.12, 0.12)),
        ];
        // the first two of the catalogue are meshed finely whatever is asked
        let shape = shapes[2 + dice.number() as usize % (shapes.len() - 2)];
        let size = dice.between(0.8, 1.3) * 1e-3;
        let thing = set_down(&scaled(&shape.mesh_of(dice.number(), 7.0), size));
        parts.push(placed(&thing, dice.between(0.0, TAU), at));
    }
    together(parts)
}

/// A thing with a plate under it, which turn, and the floor, wall and clutter behind, which do not.
pub fn turntable(dice: &mut Dice) -> (Mesh, Mesh) {
    let thing = thing(dice);
    let radius = thing.vertices.iter().map(|v| v.x.hypot(v.z)).fold(0.0, f64::max);
    let plate = post([0.0, -0.02, 0.0], 0.02, 1.2 * radius, 1.2 * radius);
    let (depth, side) = (2.2 * radius, 3.2 * radius);
    let mut still = vec![
        sheet([[-side, -0.03, side], [side, -0.03, side], [side, -0.03, -side], [-side, -0.03, -side]]),
        sheet([[-side, -0.03, -depth], [side, -0.03, -depth], [side, side, -depth], [-side, side, -depth]]),
    ];
    // half of the backgrounds are bare
    let clutter = 3 * (dice.number() % 2);
    for _ in 0..clutter {
        let x = dice.between(-2.2, 2.2) * radius;
        let half = dice.between(0.2, 0.5) * radius;
        let high = dice.between(0.5, 1.8) * radius;
        still.push(cuboid([x - half, -0.03, -depth], [x + half, high, -depth + 1.6 * half]));
    }
    if clutter > 0 {
        let round = dice.between(0.25, 0.45) * radius;
        still.push(post([1.9 * radius, -0.03, -1.2 * radius], 2.0 * round, round, 0.7 * round));
    }
    (together([thing, plate]), together(still))
}

/// Uneven ground with stones and posts about a thing of radius 1, whose place is left free.
pub fn yard(dice: &mut Dice) -> Mesh {
    let seed = dice.number();
    let height = |x: f64, z: f64| {
        let away = ((x.hypot(z) - 1.2) / 2.0).clamp(0.0, 1.0);
        0.25 * away * rough(&Point3::new(0.45 * x, 0.0, 0.45 * z), 3, seed) - 0.01
    };
    let mut parts = vec![ground(5.0, 40, height)];
    for k in 0..9 {
        let (way, far) = (0.7 * f64::from(k) + dice.between(-0.25, 0.25), dice.between(2.6, 4.4));
        let (x, z) = (far * way.cos(), far * way.sin());
        let at = [x, height(x, z) - 0.05, z];
        let size = dice.between(0.15, 0.5);
        parts.push(match k % 3 {
            0 => post(at, 4.0 * size, 0.06, 0.05),
            1 => placed(&cuboid([-size, 0.0, -0.6 * size], [size, 1.4 * size, 0.6 * size]), way, at),
            _ => ball(at, |way| size * (1.0 + 0.4 * rough(&Point3::from(way * 2.0), 2, seed + 1))),
        });
    }
    together(parts)
}

/// Seat, back and legs.
pub fn chair(dice: &mut Dice) -> Vec<Mesh> {
    let (half, high, back) = (dice.about(0.21), dice.about(0.45), dice.about(0.45));
    let mut parts = vec![
        cuboid([-half, high - 0.04, -half], [half, high, half]),
        cuboid([-half, high + 0.15, -half], [half, high + back, -half + 0.03]),
    ];
    for (x, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        parts.push(post([x * (half - 0.03), 0.0, z * (half - 0.03)], high - 0.03, 0.02, 0.02));
    }
    parts
}

/// Sides, boards, and books of many sizes.
pub fn shelf(dice: &mut Dice) -> Vec<Mesh> {
    let (half, high, deep) = (dice.about(0.5), dice.about(1.8), 0.15);
    let mut parts = vec![
        cuboid([-half - 0.03, 0.0, -deep], [-half, high, deep]),
        cuboid([half, 0.0, -deep], [half + 0.03, high, deep]),
        cuboid([-half, 0.0, -deep - 0.02], [half, high, -deep]),
    ];
    for board in 0..=4 {
        let y = high * f64::from(board) / 4.0;
        parts.push(cuboid([-half, y - 0.025, -deep], [half, y, deep]));
        let mut x = -half + dice.between(0.0, 0.3);
        while board < 4 && x < half - 0.1 {
            let (wide, tall) = (dice.between(0.02, 0.09), dice.between(0.14, 0.32));
            parts.push(cuboid([x, y, -deep], [x + wide, y + tall, dice.between(-0.04, 0.12)]));
            x += wide + if dice.number().is_multiple_of(4) { 0.15 } else { 0.003 };
        }
    }
    parts
}

/// Seat, back and arms with round cushions.
pub fn sofa(dice: &mut Dice) -> Vec<Mesh> {
    let half = dice.about(0.8);
    let cushion = |x: f64| ball([x, 0.55, 0.0], |way| 0.2 / (way.x.abs().max(way.y.abs()) + 0.4));
    vec![
        cuboid([-half, 0.08, -0.4], [half, 0.42, 0.4]),
        cuboid([-half, 0.42, -0.42], [half, dice.about(0.85), -0.2]),
        cuboid([-half - 0.16, 0.08, -0.4], [-half, 0.6, 0.4]),
        cuboid([half, 0.08, -0.4], [half + 0.16, 0.6, 0.4]),
        cushion(dice.between(-0.5, 0.0)),
        cushion(dice.between(0.2, 0.6)),
    ]
}
