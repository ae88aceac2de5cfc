//! Things that are no face, and shapes with known truth for tests of registration.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use rand::distr::Distribution;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitSphere;

use super::implicit::{cut, ellipsoid, join, limb, ring};
use super::{Specimen, surface_nets};
use visage_geometry::{Bounds, Point3, Vector3};

pub use super::head::head_with_bumps;

/// A jug with a handle and a spout, its belly dented so that it registers in every direction; no face anywhere.
pub fn jug() -> Specimen {
    let field = |p: &Point3| {
        let around = p.z.atan2(p.x);
        let dents = 2.5 * (3.0 * around + 0.05 * p.y).sin() + 1.5 * (0.07 * p.y + 2.0 * around).cos();
        let mut jug = ellipsoid(p, [0.0, -25.0, 0.0], [72.0, 78.0, 66.0]) + dents;
        jug = join(jug, limb(p, [0.0, 30.0, 0.0], [4.0, 105.0, 0.0], 30.0, 40.0), 25.0);
        jug = join(jug, ring(p, [62.0, 30.0, 0.0], 42.0, 9.0), 10.0);
        jug = join(jug, limb(p, [-30.0, 70.0, 8.0], [-66.0, 112.0, 14.0], 16.0, 10.0), 14.0);
        jug = cut(jug, limb(p, [0.0, 60.0, 0.0], [4.0, 140.0, 0.0], 22.0, 32.0), 6.0);
        let (above_the_rim, below_the_foot) = (108.0 - p.y, p.y + 92.0);
        cut(cut(jug, above_the_rim, 4.0), below_the_foot, 6.0)
    };
    let bounds = Bounds { min: Point3::new(-90.0, -100.0, -80.0), max: Point3::new(122.0, 118.0, 80.0) };
    Specimen { mesh: surface_nets::mesh(&field, &bounds, 3.2), landmarks: BTreeMap::new() }
}

/// A smooth body without any symmetry, about 200 mm across, of about `triangles` triangles: a ball whose radius
/// swells and shrinks by low waves in random directions.
pub fn blob(seed: u64, triangles: usize) -> Specimen {
    const RADIUS: f64 = 90.0;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let waves: Vec<(Vector3, f64, f64)> = (0..12)
        .map(|n| {
            let direction: [f64; 3] = UnitSphere.sample(&mut rng);
            let frequency = 1.5 + 0.6 * f64::from(n);
            (Vector3::from(direction) * frequency, rng.random_range(0.0..TAU), RADIUS * 0.14 / frequency)
        })
        .collect();
    let field = |p: &Point3| {
        let distance = p.coords.norm();
        let direction = p.coords / distance.max(1e-9);
        let swell: f64 = waves.iter().map(|(wave, phase, height)| height * (wave.dot(&direction) + phase).cos()).sum();
        distance - RADIUS - swell
    };
    let reach = 1.6 * RADIUS;
    let bounds = Bounds { min: Point3::new(-reach, -reach, -reach), max: Point3::new(reach, reach, reach) };
    let area = 4.0 * PI * RADIUS * RADIUS * 1.05;
    let cell = (3.0 * area / triangles.max(100) as f64).sqrt();
    Specimen { mesh: surface_nets::mesh(&field, &bounds, cell), landmarks: BTreeMap::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Mesh;

    /// The mesh is closed within its box and holds `litres`.
    fn assert_sound(mesh: &Mesh, litres: std::ops::Range<f64>) {
        let volume = mesh.signed_volume_6() / 6.0 * 1e-6;
        assert!(litres.contains(&volume), "{volume} l");
        assert!(mesh.vertices.iter().flat_map(|v| v.iter()).all(|x| x.is_finite()));
    }

    #[test]
    fn objects_are_closed_and_wound_outward() {
        assert_sound(&jug().mesh, 0.8..3.0);
        assert_sound(&head_with_bumps().mesh, 3.0..7.0);
        for seed in 0..3 {
            assert_sound(&blob(seed, 5000).mesh, 2.0..5.0);
        }
    }

    #[test]
    fn blobs_have_the_triangles_asked_for_and_differ_by_seed() {
        for triangles in [2_000, 20_000] {
            let found = blob(5, triangles).mesh.faces.len() as f64;
            assert!((found / triangles as f64 - 1.0).abs() < 0.25, "{found} instead of {triangles}");
        }
        assert_ne!(blob(1, 2000).mesh, blob(2, 2000).mesh);
        assert_eq!(blob(1, 2000).mesh, blob(1, 2000).mesh);
    }
}
