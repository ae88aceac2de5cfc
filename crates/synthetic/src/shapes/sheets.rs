//! Thin bodies: both sides lie a few spacings apart, so a view may be drawn onto the wrong one.

use super::super::implicit::{cut, ellipsoid, frustum, join, limb};
use super::{Dice, meshed};
use visage_geometry::{Mesh, Point3, Vector3};

/// Half the thickness of the sheets, mm. More than a cell, or the grid would miss them.
const HALF: f64 = 3.0;

/// A curled leaf with a stalk and an uneven outline.
pub fn leaf(dice: &mut Dice) -> Mesh {
    let (curl, twist) = (dice.about(0.0042), dice.between(0.001, 0.003));
    let (long, wide) = (dice.about(92.0), dice.about(54.0));
    let (lobes, phase) = (dice.between(4.0, 6.0), dice.between(0.0, 6.0));
    let field = move |p: &Point3| {
        let height = curl * p.x * p.x - 2.0 * twist * p.x * p.z + 0.5 * curl * p.z * p.z - 14.0;
        let slope = Vector3::new(2.0 * curl * p.x - 2.0 * twist * p.z, 0.0, curl * p.z - 2.0 * twist * p.x).norm();
        let sheet = (p.y - height).abs() / slope.hypot(1.0) - HALF;
        let around = p.z.atan2(p.x);
        let outline = (p.x / long).hypot(p.z / wide) - 1.0 - 0.13 * (lobes.round() * around + phase).sin();
        let blade = join_max(sheet, outline * 0.8 * wide, 3.0);
        join(blade, limb(p, [-long * 0.5, 6.0, 0.0], [-long - 24.0, 50.0, 8.0], 5.0, 6.0), 6.0)
    };
    meshed(dice, field, [136.0, 76.0, 78.0])
}

/// What both solids share, the edge rounded over a width `k`.
fn join_max(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, -b, k)
}

/// A piece of a dented hollow ball: both sides are seen.
pub fn shell(dice: &mut Dice) -> Mesh {
    let radius = dice.about(84.0);
    let dents: Vec<(Vector3, f64)> = (0..7).map(|_| (dice.direction() * radius, dice.between(9.0, 17.0))).collect();
    let tilt = dice.between(0.1, 0.4);
    let field = move |p: &Point3| {
        let dented = dents.iter().fold(p.coords.norm() - radius, |shell, (place, depth)| {
            let near = (-(p.coords - place).norm_squared() / (28.0f64 * 28.0)).exp();
            shell + 0.7 * depth * near
        });
        // the relief makes the field steeper than a distance
        let sheet = dented.abs() * 0.85 - HALF;
        join_max(sheet, tilt * p.x + 0.3 * tilt * p.y - p.z - 10.0, 3.0)
    };
    meshed(dice, field, [116.0, 116.0, 116.0])
}

/// A bowl with a wavy rim and a spout.
pub fn bowl(dice: &mut Dice) -> Mesh {
    let radii = [dice.about(94.0), dice.about(72.0), dice.about(84.0)];
    let (wave, phase) = (dice.between(5.0, 10.0), dice.between(0.0, 6.0));
    let field = move |p: &Point3| {
        let outer = ellipsoid(p, [0.0, 30.0, 0.0], radii);
        let inner = ellipsoid(p, [0.0, 30.0, 0.0], radii.map(|r| r - 2.0 * HALF));
        let spout = limb(p, [0.7 * radii[0], 6.0, 10.0], [radii[0] + 24.0, 34.0, 16.0], 18.0, 12.0);
        let groove = limb(p, [0.6 * radii[0], 14.0, 10.0], [radii[0] + 34.0, 44.0, 16.0], 14.0, 9.0);
        let around = p.z.atan2(p.x);
        let rim = p.y - 26.0 - wave * (3.0 * around + phase).sin() - 0.5 * wave * (2.0 * around).cos();
        let foot = frustum(p, [0.0, 34.0 - radii[1], 0.0], [0.0, 22.0 - radii[1], 0.0], 34.0, 38.0);
        let bowl = join(join(outer, spout, 6.0), foot, 4.0);
        cut(join_max(bowl, rim, 3.0), join(inner, groove, 6.0), 2.0)
    };
    meshed(dice, field, [136.0, 66.0, 100.0])
}

/// A hub with three blades of different length and pitch.
pub fn propeller(dice: &mut Dice) -> Mesh {
    let hub = dice.about(20.0);
    let blades: Vec<(f64, f64, f64)> = (0..3)
        .map(|k| (f64::from(k) * 2.1 + dice.between(-0.2, 0.2), dice.between(76.0, 108.0), dice.between(0.35, 0.9)))
        .collect();
    let field = move |p: &Point3| {
        let mut propeller = frustum(p, [0.0, 0.0, -26.0], [0.0, 0.0, 22.0], hub, 0.7 * hub);
        for (turn, length, pitch) in &blades {
            let (sine, cosine) = turn.sin_cos();
            let (along, across) = (p.x * cosine + p.y * sine, p.y * cosine - p.x * sine);
            // a flat blade, steep at the hub and flatter at its tip
            let angle = pitch * (1.3 - along / 130.0);
            let (width, height) = (across * angle.cos() + p.z * angle.sin(), p.z * angle.cos() - across * angle.sin());
            let outline = ((along - 0.5 * length) / (0.56 * length)).hypot(width / 27.0) - 1.0;
            propeller = join(propeller, join_max(height.abs() * 0.8 - HALF, 22.0 * outline, 3.0), 6.0);
        }
        propeller
    };
    meshed(dice, field, [118.0, 118.0, 40.0])
}
