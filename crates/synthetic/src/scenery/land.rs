//! Hills with houses, walls and trees.

use super::super::shapes::Dice;
use super::super::solids::{ball, cuboid, ground, post, sheet, together};
use super::super::texture::rough;
use super::{placed, placed_all};
use visage_geometry::{Mesh, Point3};

/// Half the side of the land, metres.
pub const HALF: f64 = 100.0;

/// Land with some twenty houses and forty trees.
pub fn land(dice: &mut Dice) -> Mesh {
    let (seed, hills, slope) = (dice.number(), dice.about(9.0), dice.between(-0.06, 0.06));
    let height = |x: f64, z: f64| slope * (x + 0.4 * z) + hills * rough(&Point3::new(x / 55.0, 0.5, z / 55.0), 4, seed);
    let mut parts = vec![ground(HALF, 96, height)];
    for _ in 0..22 {
        let (x, z) = (dice.between(-0.92, 0.92) * HALF, dice.between(-0.92, 0.92) * HALF);
        let house = house(dice);
        parts.push(placed(&house, dice.between(0.0, 3.0), [x, height(x, z) - 1.0, z]));
    }
    for _ in 0..40 {
        let (x, z) = (dice.between(-0.95, 0.95) * HALF, dice.between(-0.95, 0.95) * HALF);
        parts.push(placed_all(tree(dice), 0.0, [x, height(x, z) - 0.3, z]));
    }
    together(parts)
}

/// Walls, a gable roof, an annexe and a chimney.
fn house(dice: &mut Dice) -> Mesh {
    let (x, z) = (dice.between(4.0, 9.0), dice.between(3.5, 6.0));
    let (eaves, ridge) = (dice.between(4.5, 8.0), dice.between(2.0, 4.0));
    let top = eaves + ridge;
    let gable = |x: f64| [[x, eaves, -z], [x, top, 0.0], [x, eaves, z]].map(Point3::from).to_vec();
    let reach = dice.between(2.0, 5.0);
    together([
        cuboid([-x, 0.0, -z], [x, eaves, z]),
        sheet([[-x, eaves, z], [x, eaves, z], [x, top, 0.0], [-x, top, 0.0]]),
        sheet([[x, eaves, -z], [-x, eaves, -z], [-x, top, 0.0], [x, top, 0.0]]),
        Mesh { vertices: gable(x), faces: vec![[0, 1, 2]] },
        Mesh { vertices: gable(-x), faces: vec![[0, 2, 1]] },
        cuboid([x, 0.0, -0.6 * z], [x + reach, 0.6 * eaves, 0.4 * z]),
        cuboid([-0.5 * x, eaves, 0.3 * z], [-0.5 * x + 0.9, top + 0.8, 0.3 * z + 0.9]),
    ])
}

/// A trunk with some crowns.
pub fn tree(dice: &mut Dice) -> Vec<Mesh> {
    let (trunk, crown) = (dice.between(2.0, 3.5), dice.between(1.2, 2.4));
    let mut parts = vec![post([0.0; 3], trunk + crown, 0.22, 0.14)];
    for _ in 0..4 {
        let way = dice.direction() * (0.6 * crown);
        let (seed, size) = (dice.number(), dice.between(0.55, 0.85) * crown);
        let center = [way.x, trunk + crown + way.y, way.z];
        parts.push(ball(center, |way| size * (1.0 + 0.3 * rough(&Point3::from(way * 2.5), 2, seed))));
    }
    parts
}
