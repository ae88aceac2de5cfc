//! A standing person: a smooth body of limbs with a head that has a face.

use super::super::head::{Proportions, head};
use super::super::implicit::{ellipsoid, join, limb};
use super::super::shapes::Dice;
use super::super::solids::{append, moved, scaled};
use super::super::surface_nets;
use super::set_down;
use visage_geometry::{Bounds, Mesh, Motion, Point3};

/// Edge of the grid cells, metres.
const CELL: f64 = 0.02;

/// The person `seed`: arms a little apart, weight on one leg, looking along z. Metres, y up, feet at 0.
pub fn body(seed: u64) -> Mesh {
    let mut dice = Dice::new(seed ^ 0xb0d1, 1.0);
    let (shoulder, hip, belly) = (dice.about(0.185), dice.about(0.10), dice.about(0.125));
    let arms = [dice.between(0.1, 0.45), dice.between(0.1, 0.45)];
    let reach = [dice.between(-0.05, 0.22), dice.between(-0.05, 0.22)];
    let (stride, lean) = (dice.between(-0.1, 0.1), dice.between(-0.03, 0.03));
    let field = move |p: &Point3| {
        let mut body = ellipsoid(p, [lean, 1.22, 0.0], [shoulder * 0.95, 0.24, 0.115]);
        body = join(body, ellipsoid(p, [0.5 * lean, 1.0, 0.01], [belly * 1.15, 0.17, belly * 0.9]), 0.08);
        body = join(body, ellipsoid(p, [0.0, 0.88, -0.015], [hip * 1.7, 0.13, 0.125]), 0.08);
        body = join(body, limb(p, [lean - shoulder, 1.38, 0.0], [lean + shoulder, 1.38, 0.0], 0.055, 0.055), 0.05);
        body = join(body, limb(p, [lean, 1.4, -0.01], [lean, 1.5, 0.0], 0.058, 0.054), 0.04);
        for (side, (arm, reach)) in [-1.0, 1.0].into_iter().zip(arms.into_iter().zip(reach)) {
            let start = [lean + side * shoulder, 1.37, 0.0];
            let elbow = [start[0] + side * 0.29 * arm.sin(), 1.37 - 0.29 * arm.cos(), 0.3 * reach];
            let hand = [elbow[0] + side * 0.25 * (0.6 * arm).sin(), elbow[1] - 0.25 * arm.cos(), elbow[2] + reach];
            body = join(body, limb(p, start, elbow, 0.052, 0.04), 0.03);
            body = join(body, limb(p, elbow, hand, 0.04, 0.028), 0.02);
            let palm = [hand[0], hand[1] - 0.06, hand[2] + 0.02];
            body = join(body, ellipsoid(p, palm, [0.022, 0.075, 0.042]), 0.02);
            let step = side * stride;
            let (knee, ankle) = ([side * hip * 1.1, 0.5, 0.6 * step + 0.02], [side * hip * 1.2, 0.1, step]);
            body = join(body, limb(p, [side * hip, 0.86, 0.0], knee, 0.09, 0.06), 0.04);
            body = join(body, limb(p, knee, ankle, 0.058, 0.04), 0.03);
            body = join(body, ellipsoid(p, [ankle[0], 0.04, ankle[2] + 0.06], [0.05, 0.04, 0.13]), 0.03);
        }
        body
    };
    let bounds = Bounds { min: Point3::new(-0.62, -0.04, -0.35), max: Point3::new(0.62, 1.62, 0.55) };
    let mut person = surface_nets::mesh(&field, &bounds, CELL);
    let mut skull = scaled(&head(&Proportions::of(dice.number())).mesh, 1e-3);
    skull = moved(&skull, &Motion::translation(lean, 1.58, 0.015));
    append(&mut person, &skull);
    set_down(&scaled(&person, dice.between(0.92, 1.08)))
}
