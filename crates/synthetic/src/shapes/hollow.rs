//! Bodies with cavities, and with parts that hide each other.

use std::f64::consts::TAU;

use super::super::implicit::{cuboid, cut, ellipsoid, frustum, join, limb};
use super::{Dice, meshed};
use visage_geometry::{Mesh, Point3, Vector3};

/// A round mug; only its handle and a dent tell how it is turned.
pub fn mug(dice: &mut Dice) -> Mesh {
    let (radius, half, wall) = (dice.about(52.0), dice.about(62.0), dice.about(9.0));
    let (reach, grip) = (dice.about(42.0), dice.about(9.0));
    let dent = dice.between(0.0, TAU);
    let field = move |p: &Point3| {
        let mut mug = frustum(p, [0.0, -half, 0.0], [0.0, half, 0.0], 0.92 * radius, radius);
        let ends =
            [[radius - 3.0, 0.6 * half, 0.0], [radius + reach, 0.1 * half, 6.0], [radius - 5.0, -0.6 * half, 0.0]];
        mug = join(mug, limb(p, ends[0], ends[1], grip, grip), 6.0);
        mug = join(mug, limb(p, ends[1], ends[2], grip, grip), 6.0);
        let inside = radius - wall;
        mug = cut(mug, frustum(p, [0.0, wall - half, 0.0], [0.0, half + 20.0, 0.0], 0.9 * inside, inside), 3.0);
        let (sine, cosine) = dent.sin_cos();
        cut(mug, ellipsoid(p, [radius * cosine * 1.3, -20.0, radius * sine * 1.3], [24.0, 30.0, 24.0]), 4.0)
    };
    meshed(dice, field, [114.0, 74.0, 62.0])
}

/// Branches that divide, thinner from fork to fork.
pub fn coral(dice: &mut Dice) -> Mesh {
    let mut branches: Vec<(Vector3, Vector3, f64)> = Vec::new();
    let mut tips = vec![(Vector3::new(0.0, -80.0, 0.0), Vector3::y(), 19.0, 46.0)];
    for _ in 0..4 {
        let mut next = Vec::new();
        for (start, heading, radius, length) in tips {
            let end = start + heading * length;
            branches.push((start, end, radius));
            for _ in 0..2 {
                let heading = (heading + dice.direction() * 0.9 + Vector3::y() * 0.15).normalize();
                next.push((end, heading, radius * 0.72, dice.about(length * 0.9)));
            }
        }
        tips = next;
    }
    let field = move |p: &Point3| {
        branches.iter().fold(1e3, |coral, (a, b, radius)| {
            join(coral, limb(p, (*a).into(), (*b).into(), *radius, 0.8 * radius), 7.0)
        })
    };
    meshed(dice, field, [135.0, 135.0, 135.0])
}

/// A closed rope that winds about itself.
pub fn rope(dice: &mut Dice) -> Mesh {
    const PARTS: usize = 28;
    let (tube, squeeze) = (dice.about(13.0), dice.about(0.34));
    let phase = dice.between(0.0, TAU);
    let place = |k: usize| {
        let t = TAU * (k % PARTS) as f64 / PARTS as f64;
        let out = 62.0 * (1.0 + squeeze * (3.0 * t + phase).cos() + 0.12 * t.sin());
        [out * (2.0 * t).cos(), 34.0 * (3.0 * t + phase).sin() + 10.0 * t.cos(), out * (2.0 * t).sin()]
    };
    let places: Vec<[f64; 3]> = (0..=PARTS).map(place).collect();
    let field = move |p: &Point3| {
        places.windows(2).fold(1e3, |rope: f64, ends| rope.min(limb(p, ends[0], ends[1], tube, tube)))
    };
    meshed(dice, field, [118.0, 66.0, 118.0])
}

/// A ball with bites taken out of it, small and large.
pub fn bitten_ball(dice: &mut Dice) -> Mesh {
    let radius = dice.about(84.0);
    let bites: Vec<(Vector3, f64)> = (0..8)
        .map(|_| {
            let bite = dice.between(18.0, 44.0);
            (dice.direction() * (radius + dice.between(-0.1, 0.35) * bite), bite)
        })
        .collect();
    let field = move |p: &Point3| {
        bites
            .iter()
            .fold(p.coords.norm() - radius, |ball, (center, bite)| cut(ball, (p.coords - center).norm() - bite, 3.0))
    };
    meshed(dice, field, [96.0; 3])
}

/// An open box with a partition and things in it.
pub fn open_crate(dice: &mut Dice) -> Mesh {
    let wall = dice.about(9.0);
    let (split, ball, post) = (dice.between(-20.0, 10.0), dice.about(24.0), dice.about(15.0));
    let field = move |p: &Point3| {
        let outer = cuboid(p, [0.0; 3], [92.0, 44.0, 64.0]);
        let inner = cuboid(p, [0.0, 2.0 * wall, 0.0], [92.0 - 2.0 * wall, 44.0 + 0.5 * wall, 64.0 - 2.0 * wall]);
        let mut open = outer.max(-inner);
        open = open.min(cuboid(p, [split, -8.0, 0.0], [5.0, 30.0, 60.0]));
        open = open.min(ellipsoid(p, [50.0, -16.0, 12.0], [ball; 3]));
        open = open.min(frustum(p, [-56.0, -40.0, -18.0], [-56.0, 30.0, -10.0], post, 0.7 * post));
        open.max(-frustum(p, [-20.0, 0.0, 40.0], [-20.0, 0.0, 90.0], 18.0, 18.0))
    };
    meshed(dice, field, [94.0, 46.0, 66.0])
}
