//! Smooth bodies: no edges, some with hardly any relief.

use super::super::implicit::{cut, ellipsoid, join, limb, ring};
use super::{Dice, meshed};
use visage_geometry::{Mesh, Point3, Vector3};

/// An ellipsoid with shallow waves: little to hold on to.
pub fn pebble(dice: &mut Dice) -> Mesh {
    let radii = [dice.about(95.0), dice.about(70.0), dice.about(55.0)];
    let waves: Vec<(Vector3, f64)> = (0..5)
        .map(|_| {
            let length = dice.between(70.0, 130.0);
            (dice.direction() * (std::f64::consts::TAU / length), dice.between(0.0, 6.0))
        })
        .collect();
    let field = move |p: &Point3| {
        let relief: f64 = waves.iter().map(|(wave, phase)| (wave.dot(&p.coords) + phase).sin()).sum();
        ellipsoid(p, [0.0; 3], radii) + 1.2 * relief
    };
    meshed(dice, field, [115.0, 88.0, 72.0])
}

/// A bent tube of changing width.
pub fn bean(dice: &mut Dice) -> Mesh {
    let bend = dice.about(30.0);
    let lift = dice.about(18.0);
    let radii = [dice.about(26.0), dice.about(38.0), dice.about(30.0), dice.about(42.0)];
    let places = [[-75.0, bend, 0.0], [-28.0, -0.5 * bend, lift], [22.0, -0.6 * bend, -lift], [62.0, bend, 0.4 * lift]];
    let field = move |p: &Point3| {
        (0..3).fold(f64::INFINITY, |body, k| {
            let part = limb(p, places[k], places[k + 1], radii[k], radii[k + 1]);
            if body.is_finite() { join(body, part, 20.0) } else { part }
        })
    };
    meshed(dice, field, [116.0, 90.0, 72.0])
}

/// A body on four legs with a head, ears and a tail.
pub fn animal(dice: &mut Dice) -> Mesh {
    let (long, wide, leg) = (dice.about(62.0), dice.about(24.0), dice.about(62.0));
    let (head, neck, tail) = (dice.about(24.0), dice.about(40.0), dice.about(48.0));
    let step = [dice.between(-12.0, 12.0), dice.between(-12.0, 12.0), dice.between(-12.0, 12.0)];
    let field = move |p: &Point3| {
        let mut body = limb(p, [-long, 12.0, 0.0], [long, 16.0, 0.0], 30.0, 26.0);
        for (k, (x, z)) in [(-long, wide), (-long, -wide), (long, wide), (long, -wide)].into_iter().enumerate() {
            let swing = step[k % 3];
            body = join(body, limb(p, [x, 4.0, 0.7 * z], [x + swing, 4.0 - leg, z], 13.0, 9.0), 10.0);
        }
        body = join(body, limb(p, [long, 20.0, 0.0], [long + 16.0, 20.0 + neck, 4.0], 17.0, 13.0), 10.0);
        body = join(body, ellipsoid(p, [long + 26.0, 24.0 + neck, 6.0], [head * 1.2, head * 0.8, head * 0.75]), 8.0);
        for z in [-13.0, 21.0] {
            body = join(body, limb(p, [long + 14.0, 34.0 + neck, z], [long + 8.0, 58.0 + neck, z], 6.0, 4.0), 5.0);
        }
        join(body, limb(p, [-long - 10.0, 20.0, 0.0], [-long - 28.0, 20.0 + tail, -12.0], 8.0, 5.0), 8.0)
    };
    meshed(dice, field, [140.0, 118.0, 48.0])
}

/// A standing doll, one arm raised.
pub fn figure(dice: &mut Dice) -> Mesh {
    let (shoulder, hip, leg) = (dice.about(34.0), dice.about(22.0), dice.about(78.0));
    let (arm, raised, head) = (dice.about(56.0), dice.between(15.0, 50.0), dice.about(21.0));
    let stride = dice.between(6.0, 24.0);
    let field = move |p: &Point3| {
        let mut body = limb(p, [0.0, 36.0, 0.0], [0.0, -18.0, 2.0], 25.0, 21.0);
        body = join(body, limb(p, [-shoulder, 46.0, 0.0], [shoulder, 46.0, 0.0], 12.0, 12.0), 12.0);
        body = join(body, ellipsoid(p, [0.0, 92.0, 4.0], [head * 0.85, head, head * 0.95]), 6.0);
        body = join(body, limb(p, [0.0, 60.0, 0.0], [0.0, 84.0, 2.0], 10.0, 9.0), 6.0);
        body = join(body, limb(p, [shoulder, 46.0, 0.0], [shoulder + 0.8 * arm, 46.0 + raised, 20.0], 10.0, 8.0), 8.0);
        body = join(body, limb(p, [-shoulder, 46.0, 0.0], [-shoulder - 18.0, 46.0 - arm, 16.0], 10.0, 8.0), 8.0);
        body = join(body, limb(p, [hip * 0.7, -24.0, 0.0], [hip, -24.0 - leg, stride], 14.0, 10.0), 8.0);
        join(body, limb(p, [-hip * 0.7, -24.0, 0.0], [-hip, -24.0 - leg, -stride], 14.0, 10.0), 8.0)
    };
    meshed(dice, field, [100.0, 125.0, 55.0])
}

/// A dented belly with a spout, a handle and a lid.
pub fn teapot(dice: &mut Dice) -> Mesh {
    let radii = [dice.about(66.0), dice.about(54.0), dice.about(62.0)];
    let (dent, turns) = (dice.between(1.5, 3.0), dice.between(0.0, 6.0));
    let (handle, spout) = (dice.about(34.0), dice.about(46.0));
    let field = move |p: &Point3| {
        let around = p.z.atan2(p.x);
        let mut pot = ellipsoid(p, [0.0; 3], radii) + dent * (2.0 * around + 0.06 * p.y + turns).sin();
        pot = join(pot, ring(p, [radii[0] + 4.0, 4.0, 0.0], handle, 7.0), 8.0);
        pot = join(pot, limb(p, [-48.0, -6.0, 4.0], [-64.0 - 0.7 * spout, 14.0 + spout, 12.0], 17.0, 8.0), 12.0);
        pot = join(pot, ellipsoid(p, [0.0, radii[1] - 2.0, 0.0], [34.0, 12.0, 34.0]), 5.0);
        pot = join(pot, ellipsoid(p, [0.0, radii[1] + 14.0, 0.0], [10.0, 11.0, 10.0]), 4.0);
        cut(pot, p.y + 0.8 * radii[1], 5.0)
    };
    meshed(dice, field, [128.0, 90.0, 80.0])
}
