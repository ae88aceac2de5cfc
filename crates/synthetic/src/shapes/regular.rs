//! Bodies with symmetries: a registration can be told apart from its turned copies by nothing.

use super::super::implicit::{cuboid, cut, ellipsoid, frustum, limb, ring};
use super::{Dice, meshed};
use visage_geometry::{Mesh, Point3};

/// A ball.
pub fn sphere(dice: &mut Dice) -> Mesh {
    let radius = dice.about(80.0);
    meshed(dice, move |p| ellipsoid(p, [0.0; 3], [radius; 3]), [90.0; 3])
}

/// A cylinder with round ends.
pub fn capsule(dice: &mut Dice) -> Mesh {
    let (half, radius) = (dice.about(60.0), dice.about(40.0));
    meshed(dice, move |p| limb(p, [0.0, -half, 0.0], [0.0, half, 0.0], radius, radius), [46.0, 114.0, 46.0])
}

/// A ring.
pub fn torus(dice: &mut Dice) -> Mesh {
    let (radius, tube) = (dice.about(70.0), dice.about(26.0));
    meshed(dice, move |p| ring(p, [0.0; 3], radius, tube), [110.0, 110.0, 32.0])
}

/// A hollow body of revolution with a narrow neck.
pub fn vase(dice: &mut Dice) -> Mesh {
    let (belly, neck, wave) = (dice.about(54.0), dice.about(26.0), dice.about(0.045));
    let field = move |p: &Point3| {
        let radius = |height: f64| neck + (belly - neck) * (0.5 + 0.5 * (wave * (height + 30.0)).cos());
        let across = p.x.hypot(p.z);
        // the profile is steeper than a distance
        let outer = (0.8 * (across - radius(p.y.clamp(-90.0, 90.0)))).max(p.y.abs() - 90.0);
        let inner = (0.8 * (across - radius(p.y.clamp(-90.0, 90.0)) + 8.0)).max(-80.0 - p.y).max(p.y - 110.0);
        cut(outer, inner, 3.0)
    };
    meshed(dice, field, [64.0, 94.0, 64.0])
}

/// A cylinder with flat ends.
pub fn cylinder(dice: &mut Dice) -> Mesh {
    let (half, radius) = (dice.about(80.0), dice.about(48.0));
    meshed(dice, move |p| frustum(p, [0.0, -half, 0.0], [0.0, half, 0.0], radius, radius), [56.0, 92.0, 56.0])
}

/// A cone with a flat base.
pub fn cone(dice: &mut Dice) -> Mesh {
    let (half, radius) = (dice.about(80.0), dice.about(66.0));
    meshed(dice, move |p| frustum(p, [0.0, -half, 0.0], [0.0, half, 0.0], radius, 8.0), [76.0, 92.0, 76.0])
}

/// A cube.
pub fn cube(dice: &mut Dice) -> Mesh {
    let half = dice.about(62.0);
    meshed(dice, move |p| cuboid(p, [0.0; 3], [half; 3]), [71.0; 3])
}

/// A hexagonal prism with a bore.
pub fn nut(dice: &mut Dice) -> Mesh {
    let (across, half, bore) = (dice.about(76.0), dice.about(34.0), dice.about(40.0));
    let field = move |p: &Point3| {
        let side = |k: u32| {
            let (sine, cosine) = (std::f64::consts::FRAC_PI_3 * f64::from(k)).sin_cos();
            (p.x * cosine + p.z * sine).abs() - across
        };
        let prism = side(0).max(side(1)).max(side(2)).max(p.y.abs() - half);
        prism.max(bore - p.x.hypot(p.z))
    };
    meshed(dice, field, [102.0, 42.0, 102.0])
}

/// A square plate.
pub fn plate(dice: &mut Dice) -> Mesh {
    let (half, thick) = (dice.about(82.0), dice.about(5.0));
    meshed(dice, move |p| cuboid(p, [0.0; 3], [half, thick, half]), [94.0, 8.0, 94.0])
}
