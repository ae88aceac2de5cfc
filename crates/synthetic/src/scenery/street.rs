//! A street between house fronts, with cars, poles, trees and steps.

use super::super::shapes::Dice;
use super::super::solids::{cuboid, post, together};
use super::land::tree;
use super::{placed, placed_all};
use visage_geometry::Mesh;

/// Half of its length, metres.
pub const HALF_LENGTH: f64 = 60.0;

/// A street along z, and half the distance of its fronts.
pub fn street(dice: &mut Dice) -> (Mesh, f64) {
    let half = dice.about(10.0);
    let mut parts = vec![
        cuboid([-half - 12.0, -0.5, -1.2 * HALF_LENGTH], [half + 12.0, 0.0, 1.2 * HALF_LENGTH]),
        cuboid([-half, 0.0, -1.2 * HALF_LENGTH], [-half + 3.2, 0.15, 1.2 * HALF_LENGTH]),
        cuboid([half - 2.6, 0.0, -1.2 * HALF_LENGTH], [half, 0.15, 1.2 * HALF_LENGTH]),
    ];
    for side in [-1.0, 1.0] {
        fronts(dice, side, half, &mut parts);
        let mut z = -HALF_LENGTH + dice.between(0.0, 8.0);
        while z < HALF_LENGTH {
            let x = side * (half - dice.between(3.6, 4.6));
            match dice.number() % 4 {
                0 | 1 => parts.push(placed_all(car(dice), dice.between(-0.06, 0.06), [x, 0.0, z])),
                2 => parts.push(placed_all(tree(dice), 0.0, [side * (half - 1.6), 0.0, z])),
                _ => parts.push(post([side * (half - 1.0), 0.0, z], dice.between(3.0, 7.0), 0.09, 0.06)),
            }
            z += dice.between(4.5, 11.0);
        }
    }
    (together(parts), half)
}

/// A row of houses with gaps between some, their windows set in and their balconies out.
fn fronts(dice: &mut Dice, side: f64, half: f64, parts: &mut Vec<Mesh>) {
    let mut z = -1.1 * HALF_LENGTH;
    while z < 1.1 * HALF_LENGTH {
        let (long, high) = (dice.between(8.0, 17.0), dice.between(6.0, 15.0));
        let set_back = dice.between(0.0, 2.2);
        // from the front inward as if the street's axis were at x = 0 and the house on the right
        let block = |x0: f64, x1: f64, y: [f64; 2], z0: f64, z1: f64| {
            let (a, b) = (side * (half + set_back + x0), side * (half + set_back + x1));
            cuboid([a.min(b), y[0], z0], [a.max(b), y[1], z1])
        };
        parts.push(block(0.0, 9.0, [0.0, high], z, z + long));
        let (wide, gap) = (dice.between(1.0, 1.6), dice.between(2.2, 3.4));
        for floor in 0..(high / 3.0) as u32 {
            let low = 3.0 * f64::from(floor) + 0.9;
            let mut at = z + 0.5 * gap;
            while at + wide < z + long {
                // a frame around each window stands out, for a hole would need the wall cut
                let depth = if dice.number().is_multiple_of(5) { -1.1 } else { -0.12 };
                parts.push(block(depth, 0.0, [low - 0.15, low], at - 0.2, at + wide + 0.2));
                parts.push(block(-0.1, 0.0, [low, low + 1.4], at - 0.15, at));
                parts.push(block(-0.1, 0.0, [low, low + 1.4], at + wide, at + wide + 0.15));
                at += wide + gap;
            }
        }
        let steps = dice.between(z + 1.0, z + long - 2.0);
        parts.push(block(-1.2, 0.0, [0.0, 0.45], steps, steps + 1.6));
        z += long + if dice.number().is_multiple_of(3) { dice.between(2.0, 6.0) } else { 0.0 };
    }
}

/// Body, cabin and wheels, along z.
fn car(dice: &mut Dice) -> Vec<Mesh> {
    let (long, high) = (dice.between(1.8, 2.4), dice.between(0.5, 0.95));
    let mut parts = vec![
        cuboid([-0.85, 0.25, -long], [0.85, 0.85, long]),
        cuboid([-0.72, 0.85, -0.55 * long], [0.72, 0.85 + high, 0.62 * long]),
    ];
    for (x, z) in [(-0.8, -0.65), (0.8, -0.65), (-0.8, 0.65), (0.8, 0.65)] {
        let wheel = cuboid([-0.1, 0.0, -0.3], [0.1, 0.6, 0.3]);
        parts.push(placed(&wheel, 0.0, [x, 0.0, z * long]));
    }
    parts
}
