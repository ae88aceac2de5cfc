//! Bodies of flat faces, edges and bores. Edges are rounded within a cell of the grid that they are meshed on.

use super::super::implicit::{below, cuboid, frustum};
use super::{Dice, meshed};
use visage_geometry::{Mesh, Point3, Vector3};

fn without(solid: f64, tool: f64) -> f64 {
    solid.max(-tool)
}

/// Two plates at right angles with a rib, a boss and bores of different sizes.
pub fn bracket(dice: &mut Dice) -> Mesh {
    let (long, high, wide) = (dice.about(82.0), dice.about(104.0), dice.about(46.0));
    let thick = dice.about(12.0);
    let (bore, boss, rib) = (dice.about(13.0), dice.about(22.0), dice.about(52.0));
    let field = move |p: &Point3| {
        let p = Point3::new(p.x, p.y + 50.0, p.z);
        let foot = cuboid(&p, [0.0, 0.0, 0.0], [long, thick, wide]);
        let wall = cuboid(&p, [-long + thick, 0.5 * high, 0.0], [thick, 0.5 * high + thick, wide]);
        let slope = Vector3::new(1.0, 1.0, 0.0).normalize();
        let rib = cuboid(&p, [-long + 50.0, 40.0, 12.0], [60.0, 60.0, 7.0]).max(below(
            &p,
            &slope,
            (rib - 0.45 * long) * slope.x + 12.0,
        ));
        let boss = frustum(&p, [30.0, 0.0, -14.0], [30.0, 34.0, -14.0], boss, boss);
        let solid = foot.min(wall).min(rib).min(boss);
        let solid = without(solid, frustum(&p, [30.0, -40.0, -14.0], [30.0, 60.0, -14.0], bore, bore));
        let solid = without(solid, frustum(&p, [60.0, -40.0, 24.0], [60.0, 60.0, 24.0], 9.0, 9.0));
        let across = [[-120.0, 0.75 * high, -16.0], [0.0, 0.75 * high, -16.0]];
        without(solid, frustum(&p, across[0], across[1], 15.0, 15.0))
    };
    meshed(dice, field, [98.0, 84.0, 56.0])
}

/// A milled block: steps, a pocket, a slot and a slanted corner.
pub fn stepped_block(dice: &mut Dice) -> Mesh {
    let (step, pocket, slot) = (dice.about(34.0), dice.about(26.0), dice.about(10.0));
    let (depth, slant) = (dice.about(30.0), dice.about(96.0));
    let field = move |p: &Point3| {
        let mut block = cuboid(p, [0.0; 3], [90.0, 50.0, 60.0]);
        block = without(block, cuboid(p, [70.0, 50.0, 0.0], [step, 30.0, 80.0]));
        block = without(block, cuboid(p, [-80.0, 40.0, 50.0], [30.0, 40.0, step]));
        block = without(block, cuboid(p, [-12.0, 60.0, -8.0], [pocket, depth, 0.8 * pocket]));
        block = without(block, cuboid(p, [0.0, -20.0, 60.0], [100.0, slot, 18.0]));
        let corner = Vector3::new(-1.0, -0.8, -1.2).normalize();
        block.max(below(p, &corner, slant))
    };
    meshed(dice, field, [92.0, 52.0, 62.0])
}

/// A ball cut by planes in random directions.
pub fn gem(dice: &mut Dice) -> Mesh {
    let faces: Vec<(Vector3, f64)> = (0..16).map(|_| (dice.direction(), dice.between(62.0, 86.0))).collect();
    let field = move |p: &Point3| {
        faces.iter().fold(p.coords.norm() - 98.0, |gem, (normal, height)| gem.max(below(p, normal, *height)))
    };
    meshed(dice, field, [98.0; 3])
}

/// A house with a gable roof, an annexe, a chimney and a porch.
pub fn house(dice: &mut Dice) -> Mesh {
    let (wall, annexe, chimney) = (dice.about(38.0), dice.about(34.0), dice.about(11.0));
    let (pitch, porch) = (dice.between(0.7, 1.1), dice.about(24.0));
    let field = move |p: &Point3| {
        let roof = |p: &Point3, ridge: f64| {
            let left = Vector3::new(0.0, 1.0, pitch).normalize();
            let right = Vector3::new(0.0, 1.0, -pitch).normalize();
            below(p, &left, ridge * left.y).max(below(p, &right, ridge * right.y))
        };
        let main = cuboid(p, [-10.0, 0.0, 0.0], [70.0, 70.0, wall]).max(roof(p, 66.0));
        let side = cuboid(p, [42.0, -30.0, 40.0], [26.0, annexe, 44.0]);
        let smoke = cuboid(p, [-46.0, 30.0, 16.0], [chimney, 52.0, 0.8 * chimney]);
        let house = main.min(side).min(smoke);
        without(house, cuboid(p, [-30.0, -50.0, -wall], [porch, 36.0, 20.0]))
    };
    meshed(dice, field, [82.0, 84.0, 88.0])
}

/// A shaft with two offset arms and a pin.
pub fn crank(dice: &mut Dice) -> Mesh {
    let (shaft, arm, pin) = (dice.about(20.0), dice.about(62.0), dice.about(16.0));
    let (throw, thick) = (dice.about(46.0), dice.about(11.0));
    let field = move |p: &Point3| {
        let round = |from: [f64; 3], to: [f64; 3], radius: f64| frustum(p, from, to, radius, radius);
        let mut crank = round([-110.0, 0.0, 0.0], [-10.0, 0.0, 0.0], shaft);
        crank = crank.min(cuboid(p, [-10.0, 0.5 * throw, 0.0], [thick, 0.5 * throw + 26.0, 24.0]));
        crank = crank.min(round([-10.0, throw, 4.0], [arm, throw, 4.0], pin));
        crank = crank.min(cuboid(p, [arm, 0.4 * throw, 10.0], [thick, 0.4 * throw + 24.0, 30.0]));
        crank = crank.min(round([arm, 0.0, 20.0], [arm + 36.0, 0.0, 20.0], 0.8 * shaft));
        let keyway = cuboid(p, [-84.0, shaft, 0.0], [20.0, 7.0, 6.0]);
        without(crank, keyway)
    };
    meshed(dice, field, [112.0, 80.0, 45.0])
}
