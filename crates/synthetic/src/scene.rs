//! An object where people scan it: on a turntable or on the floor before a wall, with specks in the air. What of a scan
//! is the object is known point by point.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::scanner::{ScanSet, Scanner};
use super::solids::{append, moved, sheet};
use visage_geometry::{Mesh, Motion, Point3, Surface, Vector3};

/// What the object stands on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// Nothing: it floats, as the shapes do.
    None,
    /// A round plate that turns with the object before a scanner that stands still.
    Turntable,
    /// A floor that stays with the scanner while the object is turned on it.
    Floor,
    /// The same with a wall behind.
    FloorAndWall,
}

/// How a scene is scanned: the object turns about the upright axis (y), the scanner looks down at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneOptions {
    /// What the object stands on.
    pub ground: Ground,
    /// Turns of the object, evenly over the circle.
    pub views: usize,
    /// How far above the horizon the scanner stands, degrees.
    pub elevation: f64,
    /// Distance of neighbouring points in the middle of the object, mm.
    pub resolution: f64,
    /// Standard deviation of the depth, mm.
    pub noise: f64,
    /// Single specks in the air of each scan; a third as many come in a cluster.
    pub specks: usize,
}

impl Default for SceneOptions {
    fn default() -> Self {
        SceneOptions { ground: Ground::Turntable, views: 9, elevation: 30.0, resolution: 2.2, noise: 0.15, specks: 0 }
    }
}

/// Scans of a scene.
#[derive(Debug, Clone)]
pub struct SceneSet {
    /// The scans, and the true poses of the object: sensor frame to the object's frame.
    pub set: ScanSet,
    /// For each scan and point whether it is the object's; points nearer than [`CONTACT`] to the ground are not counted.
    pub is_object: Vec<Vec<bool>>,
}

/// From the scanner to the middle of the object, mm.
const DISTANCE: f64 = 600.0;
/// What is nearer to the ground than this is taken for ground, mm.
pub const CONTACT: f64 = 1.5;
/// Radius of the turntable, in that of the object's foot circle.
const TABLE: f64 = 1.35;
/// Height of the turntable, mm.
const THICKNESS: f64 = 8.0;
/// Half the side of the floor, in the radius of the object's foot circle.
const FLOOR: f64 = 2.2;

/// Scans `mesh` (wound outward), set down on its lowest point. The same arguments give the same bits.
pub fn scene_set(mesh: &Mesh, options: &SceneOptions, seed: u64) -> SceneSet {
    let (upright, radius) = set_down(mesh);
    let middle = Point3::new(0.0, upright.bounds().map_or(0.0, |bounds| bounds.center().y), 0.0);
    let elevation = options.elevation.to_radians();
    let eye = middle + Vector3::new(0.0, elevation.sin(), elevation.cos()) * DISTANCE;
    let sensor = Motion::face_towards(&eye, &middle, &-Vector3::y());
    let scanner = Scanner {
        views: 1,
        distance: DISTANCE,
        resolution: options.resolution,
        noise: options.noise,
        ..Scanner::default()
    };
    let mut scene = SceneSet { set: ScanSet { scans: Vec::new(), poses: Vec::new() }, is_object: Vec::new() };
    for view in 0..options.views {
        let turn = Motion::rotation(Vector3::y() * (TAU * view as f64 / options.views as f64));
        let mut things = moved(&upright, &turn);
        ground(options.ground, radius).into_iter().for_each(|part| append(&mut things, &part));
        let stream = seed.wrapping_mul(1000).wrapping_add(view as u64);
        let mut scans = scanner.scan_from(&things, vec![sensor], stream).scans;
        let Some(mut scan) = scans.pop() else { continue };
        let is_ground = |p: &Point3| {
            let place = sensor * p;
            options.ground != Ground::None
                && (place.y < CONTACT || (options.ground == Ground::FloorAndWall && place.z < CONTACT - FLOOR * radius))
        };
        let mut is_object: Vec<bool> = scan.cloud.points.iter().map(|p| !is_ground(p)).collect();
        strew(&mut scan, options.specks, radius, &mut ChaCha8Rng::seed_from_u64(stream));
        is_object.resize(scan.cloud.len(), false);
        scene.set.scans.push(scan);
        scene.set.poses.push(set_down_motion(mesh).inverse() * turn.inverse() * sensor);
        scene.is_object.push(is_object);
    }
    scene
}

/// Puts the middle of the mesh's box above the origin and its lowest point on y = 0.
fn set_down_motion(mesh: &Mesh) -> Motion {
    let shift = mesh.bounds().map_or_else(Vector3::zeros, |bounds| {
        let center = bounds.center();
        Vector3::new(-center.x, -bounds.min.y, -center.z)
    });
    Motion::translation(shift.x, shift.y, shift.z)
}

/// The mesh set down, and the radius of the circle that holds it seen from above.
fn set_down(mesh: &Mesh) -> (Mesh, f64) {
    let mesh = moved(mesh, &set_down_motion(mesh));
    let radius = mesh.vertices.iter().map(|v| v.x.hypot(v.z)).fold(0.0, f64::max);
    (mesh, radius)
}

/// The parts of the ground about an object with this radius.
fn ground(ground: Ground, radius: f64) -> Vec<Mesh> {
    let half = FLOOR * radius;
    let floor = || sheet([[-half, 0.0, half], [half, 0.0, half], [half, 0.0, -half], [-half, 0.0, -half]]);
    let wall =
        || sheet([[-half, 0.0, -half], [half, 0.0, -half], [half, 2.0 * half, -half], [-half, 2.0 * half, -half]]);
    match ground {
        Ground::None => Vec::new(),
        Ground::Turntable => vec![disc(TABLE * radius)],
        Ground::Floor => vec![floor()],
        Ground::FloorAndWall => vec![floor(), wall()],
    }
}

/// A round plate with its top at y = 0 and a rim; its underside is never seen.
fn disc(radius: f64) -> Mesh {
    const SIDES: u32 = 72;
    let mut mesh = Mesh { vertices: vec![Point3::origin()], faces: Vec::new() };
    for side in 0..SIDES {
        let (sine, cosine) = (TAU * f64::from(side) / f64::from(SIDES)).sin_cos();
        mesh.vertices.push(Point3::new(radius * cosine, 0.0, radius * sine));
        mesh.vertices.push(Point3::new(radius * cosine, -THICKNESS, radius * sine));
        let (top, next) = (1 + 2 * side, 1 + 2 * ((side + 1) % SIDES));
        mesh.faces.extend([[0, next, top], [top, next, next + 1], [top, next + 1, top + 1]]);
    }
    mesh
}

/// Adds specks in the air around the object, far from everything that was seen, and a cluster of them.
fn strew(scan: &mut Surface, specks: usize, radius: f64, rng: &mut ChaCha8Rng) {
    let seen = scan.cloud.points.clone();
    let mut place = || {
        let side = |rng: &mut ChaCha8Rng| rng.random_range(-2.0 * radius..2.0 * radius);
        Point3::new(side(rng), side(rng), DISTANCE + side(rng))
    };
    let is_apart = |p: &Point3| seen.iter().all(|q| (p - q).norm() > 0.4 * radius);
    let mut apart = || (0..100).map(|_| place()).find(is_apart);
    let mut added: Vec<Point3> = (0..specks).filter_map(|_| apart()).collect();
    if let Some(middle) = apart() {
        added.extend(
            (0..specks / 3).map(|k| middle + Vector3::new((k % 4) as f64, (k / 4) as f64, 0.5 * (k % 3) as f64)),
        );
    }
    scan.cloud.points.extend(added);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects;

    #[test]
    fn poses_bring_the_objects_points_onto_it_and_the_ground_lies_below() {
        let mesh = objects::blob(4, 4_000).mesh;
        let bounds = mesh.bounds().expect("it has vertices");
        let coarse = SceneOptions { views: 3, resolution: 6.0, noise: 0.0, ..SceneOptions::default() };
        for ground in [Ground::None, Ground::Turntable, Ground::Floor, Ground::FloorAndWall] {
            let scene = scene_set(&mesh, &SceneOptions { ground, ..coarse }, 1);
            assert_eq!(scene.set.scans.len(), 3);
            for ((scan, pose), is_object) in scene.set.scans.iter().zip(&scene.set.poses).zip(&scene.is_object) {
                let count = is_object.iter().filter(|is| **is).count();
                assert!(count > 200, "{ground:?}: {count} points of the object");
                assert_eq!(count < is_object.len(), ground != Ground::None, "{ground:?}");
                for (point, _) in scan.cloud.points.iter().zip(is_object).filter(|(_, is)| **is) {
                    let place = pose * point;
                    let outside =
                        (place.inf(&bounds.min) - bounds.min).norm() + (place.sup(&bounds.max) - bounds.max).norm();
                    assert!(outside < 1e-6, "{ground:?}: {place}");
                }
            }
        }
    }

    #[test]
    fn specks_are_no_part_of_the_object() {
        let mesh = objects::blob(4, 4_000).mesh;
        let bare = SceneOptions { views: 2, resolution: 6.0, ground: Ground::None, ..SceneOptions::default() };
        let strewn = scene_set(&mesh, &SceneOptions { specks: 12, ..bare }, 1);
        let bare = scene_set(&mesh, &bare, 1);
        for (scan, without) in strewn.set.scans.iter().zip(&bare.set.scans) {
            assert_eq!(scan.cloud.len(), without.cloud.len() + 16);
        }
        assert!(strewn.is_object.iter().all(|scan| scan.iter().filter(|is| !**is).count() == 16));
    }
}
