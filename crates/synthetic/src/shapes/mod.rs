//! Things of many kinds to scan, register and judge with an exact truth: smooth, sharp-edged, thin, hollow, and some
//! that their symmetry makes ambiguous.
//!
//! A shape is a recipe; with a seed it becomes a closed mesh some 150 to 250 mm across, about its frame's origin.
//! Every measure is off its usual size by up to some 12 %, so each seed is another instance.

mod angular;
mod hollow;
mod regular;
mod rounded;
mod sheets;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::scanner::{ScanSet, Scanner};
use super::{head, objects, surface_nets};
use visage_geometry::{Bounds, Mesh, Motion, Point3, Vector3};

/// What makes a shape easy or hard to register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Curved everywhere, no edges.
    Smooth,
    /// Flat faces and edges.
    Sharp,
    /// Two sides a few spacings apart.
    Thin,
    /// Cavities and parts that hide each other.
    Concave,
}

/// The motions that leave a shape as it is: no method can tell its views apart by them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// None (a mirror plane does not count: no motion mirrors).
    None,
    /// Some turns by a fraction of the circle.
    Turns,
    /// All turns about one axis.
    Axis,
    /// All turns.
    Sphere,
}

/// A recipe of the catalogue.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Its name, unique in the catalogue.
    pub name: &'static str,
    /// Its kind.
    pub kind: Kind,
    /// Its symmetry.
    pub symmetry: Symmetry,
    build: fn(&mut Dice) -> Mesh,
}

impl Shape {
    /// The closed surface of the instance `seed`, wound outward, mm.
    pub fn mesh(&self, seed: u64) -> Mesh {
        (self.build)(&mut Dice::new(seed, CELL))
    }

    /// The same, coarser or finer: meshed from grid cells with this edge, mm. Blobs and heads have a mesh of their own.
    pub fn mesh_of(&self, seed: u64, cell: f64) -> Mesh {
        (self.build)(&mut Dice::new(seed, cell))
    }

    /// Whether some motion leaves it as it is.
    pub fn is_symmetric(&self) -> bool {
        self.symmetry != Symmetry::None
    }
}

/// All shapes; those without symmetry come first.
pub fn catalogue() -> Vec<Shape> {
    use Kind::{Concave, Sharp, Smooth, Thin};
    use Symmetry::{Axis, None, Sphere, Turns};
    let shape = |name, kind, symmetry, build| Shape { name, kind, symmetry, build };
    vec![
        shape("blob", Smooth, None, |dice| objects::blob(dice.number(), 40_000).mesh),
        shape("head", Smooth, None, |dice| head::head(&head::Proportions::of(dice.number())).mesh),
        shape("pebble", Smooth, None, rounded::pebble),
        shape("bean", Smooth, None, rounded::bean),
        shape("animal", Smooth, None, rounded::animal),
        shape("figure", Smooth, None, rounded::figure),
        shape("teapot", Smooth, None, rounded::teapot),
        shape("bracket", Sharp, None, angular::bracket),
        shape("stepped_block", Sharp, None, angular::stepped_block),
        shape("gem", Sharp, None, angular::gem),
        shape("house", Sharp, None, angular::house),
        shape("crank", Sharp, None, angular::crank),
        shape("leaf", Thin, None, sheets::leaf),
        shape("shell", Thin, None, sheets::shell),
        shape("bowl", Thin, None, sheets::bowl),
        shape("propeller", Thin, None, sheets::propeller),
        shape("mug", Concave, None, hollow::mug),
        shape("coral", Concave, None, hollow::coral),
        shape("rope", Concave, None, hollow::rope),
        shape("bitten_ball", Concave, None, hollow::bitten_ball),
        shape("crate", Concave, None, hollow::open_crate),
        shape("sphere", Smooth, Sphere, regular::sphere),
        shape("capsule", Smooth, Axis, regular::capsule),
        shape("torus", Smooth, Axis, regular::torus),
        shape("vase", Concave, Axis, regular::vase),
        shape("cylinder", Sharp, Axis, regular::cylinder),
        shape("cone", Sharp, Axis, regular::cone),
        shape("cube", Sharp, Turns, regular::cube),
        shape("nut", Sharp, Turns, regular::nut),
        shape("plate", Thin, Turns, regular::plate),
    ]
}

/// From where a shape is scanned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coverage {
    /// From all sides, above and below too.
    Around,
    /// From a ring around the y axis, a little above and below.
    Ring,
    /// From the front half only, as a face is scanned: some 180 degrees of the ring.
    Front,
}

/// How a shape is scanned. The defaults are those of a desk scanner: 0.15 mm of noise, nothing seen at more than 75
/// degrees, what lies behind something else not seen either.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanOptions {
    /// From where.
    pub coverage: Coverage,
    /// About how many points a scan has, on average.
    pub points: usize,
    /// Standard deviation of the depth, mm.
    pub noise: f64,
    /// Surfaces seen at a larger angle than this to their normal give no point, degrees.
    pub grazing_angle: f64,
}

impl Default for ScanOptions {
    fn default() -> Self {
        ScanOptions { coverage: Coverage::Around, points: 10_000, noise: 0.15, grazing_angle: 75.0 }
    }
}

/// Scans the instance `seed` of `shape` from `views` places, each jittered and with the scanner rolled at random.
/// The same arguments give the same bits.
pub fn scan_set(shape: &Shape, views: usize, options: &ScanOptions, seed: u64) -> ScanSet {
    let mesh = shape.mesh(seed);
    let center = mesh.bounds().map_or(Point3::origin(), |bounds| bounds.center());
    let area: f64 = (0..mesh.faces.len()).map(|face| 0.5 * mesh.area_normal(face).norm()).sum();
    // a convex body shows a quarter of its area, on average over all directions
    let resolution = (0.25 * area / options.points.max(1) as f64).sqrt();
    let scanner =
        Scanner { views, distance: DISTANCE, resolution, noise: options.noise, grazing_angle: options.grazing_angle };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(u64::from(u32::MAX));
    let poses = (0..views).map(|view| pose(options.coverage, view, views, &center, &mut rng)).collect();
    scanner.scan_from(&mesh, poses, seed)
}

/// From the scanner to the middle of the shape, mm.
const DISTANCE: f64 = 600.0;
/// Places are off their regular arrangement by up to this angle, radians.
const JITTER: f64 = 0.12;

fn pose(coverage: Coverage, view: usize, views: usize, center: &Point3, rng: &mut ChaCha8Rng) -> Motion {
    let share = (view as f64 + 0.5) / views as f64;
    let (azimuth, elevation) = match coverage {
        // a Fibonacci lattice over the sphere
        Coverage::Around => (view as f64 * PI * (3.0 - 5f64.sqrt()), (1.0 - 2.0 * share).asin()),
        Coverage::Ring => (share * TAU, 0.25 * f64::from(view as u32 % 3) - 0.25),
        Coverage::Front => ((share - 0.5) * PI, 0.25 * f64::from(view as u32 % 3) - 0.25),
    };
    let mut jitter = || rng.random_range(-JITTER..JITTER);
    let (azimuth, elevation) = (azimuth + jitter(), (elevation + jitter()).clamp(-FRAC_PI_2, FRAC_PI_2));
    let outward = Vector3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
    let roll = Motion::rotation(Vector3::z() * rng.random_range(-PI..PI));
    let upright = if outward.y.abs() > 0.9 { Vector3::x() } else { -Vector3::y() };
    Motion::face_towards(&(center + outward * DISTANCE), center, &upright) * roll
}

/// What makes instances differ.
pub(super) struct Dice {
    rng: ChaCha8Rng,
    /// Edge of the grid cells from which the shape is meshed, mm.
    cell: f64,
}

impl Dice {
    pub(super) fn new(seed: u64, cell: f64) -> Self {
        Dice { rng: ChaCha8Rng::seed_from_u64(seed), cell }
    }

    pub(super) fn number(&mut self) -> u64 {
        self.rng.random()
    }

    pub(super) fn between(&mut self, least: f64, most: f64) -> f64 {
        self.rng.random_range(least..most)
    }

    /// A measure that is usually `usual`.
    pub(super) fn about(&mut self, usual: f64) -> f64 {
        usual * self.between(0.88, 1.12)
    }

    /// A unit vector.
    pub(super) fn direction(&mut self) -> Vector3 {
        let z = self.between(-1.0, 1.0);
        let (sine, cosine) = self.between(0.0, TAU).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        Vector3::new(radius * cosine, radius * sine, z)
    }
}

/// Edge of the grid cells, mm.
const CELL: f64 = 2.5;

/// Meshes a solid that lies within half the extents given, about the origin.
fn meshed(dice: &Dice, field: impl Fn(&Point3) -> f64 + Sync, halves: [f64; 3]) -> Mesh {
    // off the round numbers at which flat faces lie: a sample exactly on a face is neither in nor out
    let margin = Vector3::repeat(dice.cell * 1.618);
    let half = Vector3::from(halves) + margin;
    surface_nets::mesh(&field, &Bounds { min: Point3::from(-half), max: Point3::from(half) }, dice.cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_closed_bodies_and_differ_by_seed() {
        for shape in catalogue() {
            let coarse = |seed| (shape.build)(&mut Dice::new(seed, 2.0 * CELL));
            let mesh = coarse(3);
            let litres = mesh.signed_volume_6() / 6.0 * 1e-6;
            assert!((0.02..6.0).contains(&litres), "{}: {litres} l", shape.name);
            let bounds = mesh.bounds().expect("it has vertices");
            assert!((110.0..450.0).contains(&bounds.diagonal()), "{}: {} mm", shape.name, bounds.diagonal());
            assert!((1_000..60_000).contains(&mesh.faces.len()), "{}: {} faces", shape.name, mesh.faces.len());
            assert!(mesh.vertices.iter().flat_map(|v| v.iter()).all(|x| x.is_finite()), "{}", shape.name);
            assert!(is_closed(&mesh), "{} touches its box", shape.name);
            assert!(mesh != coarse(4), "{}", shape.name);
        }
    }

    /// The area vectors of a closed surface add up to nothing.
    fn is_closed(mesh: &Mesh) -> bool {
        let normals = (0..mesh.faces.len()).map(|face| mesh.area_normal(face));
        let (sum, total) = normals.fold((Vector3::zeros(), 0.0), |(s, t), n| (s + n, t + n.norm()));
        sum.norm() < 1e-9 * total
    }

    #[test]
    fn names_are_unique_and_at_least_twenty_shapes_have_no_symmetry() {
        let shapes = catalogue();
        let names: std::collections::BTreeSet<&str> = shapes.iter().map(|shape| shape.name).collect();
        assert_eq!(names.len(), shapes.len());
        assert!(shapes.iter().filter(|shape| !shape.is_symmetric()).count() >= 20);
    }

    #[test]
    fn scans_have_about_the_points_asked_for_and_fit_the_surface() {
        let shapes = catalogue();
        for name in ["gem", "bowl"] {
            let shape = shapes.iter().find(|shape| shape.name == name).expect("it is in the catalogue");
            let options = ScanOptions { points: 1000, noise: 0.0, ..ScanOptions::default() };
            let set = scan_set(shape, 5, &options, 2);
            assert_eq!((set.scans.len(), set.poses.len()), (5, 5));
            let mean = set.scans.iter().map(|scan| scan.cloud.len()).sum::<usize>() / 5;
            assert!((500..2000).contains(&mean), "{name}: {mean} points a scan");
            let bounds = shape.mesh(2).bounds().expect("it has vertices");
            for (scan, pose) in set.scans.iter().zip(&set.poses) {
                for point in &scan.cloud.points {
                    let world = pose * point;
                    assert!((world.inf(&bounds.min) - bounds.min).norm() < 1e-6, "{name}: {world}");
                    assert!((world.sup(&bounds.max) - bounds.max).norm() < 1e-6, "{name}: {world}");
                }
            }
        }
    }

    #[test]
    fn coverage_says_from_where() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for view in 0..8 {
            let front = pose(Coverage::Front, view, 8, &Point3::origin(), &mut rng);
            assert!(front.translation.z > -0.15 * DISTANCE, "in front");
            let around = pose(Coverage::Around, view, 8, &Point3::origin(), &mut rng);
            let sight = around * Point3::new(0.0, 0.0, DISTANCE);
            assert!(sight.coords.norm() < 1e-6, "the scanner looks at the middle");
        }
    }
}
