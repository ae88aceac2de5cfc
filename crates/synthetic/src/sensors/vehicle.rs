//! A rotating lidar on a vehicle: rings far apart with points close together along them, all the way round, while the vehicle
//! rolls on; each point is written as if it had stood still.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::{Lens, Projection};
use super::stage::{Picture, Stage, Viewpoint, normal};
use visage_geometry::Surface;

/// The lowest and highest ring, radians.
pub const LOW: f64 = -0.45;
/// The highest.
pub const HIGH: f64 = 0.22;
/// Rings.
pub const RINGS: usize = 32;
/// Standard deviation of the range, metres.
pub const NOISE: f64 = 0.015;
/// Nothing is seen nearer, metres,
const NEAR: f64 = 0.9;
/// or farther.
const FAR: f64 = 90.0;
const GRAZING_DEG: f64 = 86.0;

/// The rings with about this many points in all.
pub fn lens(pixels: f64) -> Lens {
    let columns = (pixels / RINGS as f64).round().clamp(400.0, 1800.0) as usize;
    Lens { projection: Projection::Sphere { low: LOW, high: HIGH }, columns, rows: RINGS }
}

/// One turn of the sensor; its pose is that in the middle of the turn.
pub fn scan(stage: &Stage, view: &Viewpoint, lens: Lens, has_intensity: bool, rng: &mut ChaCha8Rng) -> Surface {
    let time = |pixel: usize| ((pixel % lens.columns) as f64 + 0.5) / lens.columns as f64 - 0.5;
    let picture = Picture::of(stage, view, lens, |_| [0.0; 2], time);
    let mut ranges = picture.ranges(GRAZING_DEG);
    for range in &mut ranges {
        let error = NOISE * normal(rng);
        let is_lost = rng.random_bool(0.01);
        *range = range.filter(|r| (NEAR..FAR).contains(r) && !is_lost).map(|r| r + error);
    }
    let mut surface = picture.surface(&ranges, false);
    let strength = || picture.brightness(&ranges).iter().map(|b| (255.0 * b).round() as f32).collect();
    surface.cloud.intensities = has_intensity.then(strength);
    surface
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::stage::walls::{stage, view};
    use super::*;
    use crate::solids::hollow;
    use visage_geometry::Vector3;

    fn scanned(travel: Vector3) -> Surface {
        let room = hollow([-10.0, -4.0, -10.0], [10.0, 4.0, 10.0]);
        let view = Viewpoint { travel, ..view() };
        scan(&stage([room]), &view, lens(20_000.0), true, &mut ChaCha8Rng::seed_from_u64(1))
    }

    #[test]
    fn points_lie_on_rings_and_close_together_along_them() {
        let surface = scanned(Vector3::zeros());
        let mut rings = std::collections::BTreeSet::new();
        for p in &surface.cloud.points {
            let up = (-p.y).atan2(p.x.hypot(p.z));
            let ring = (HIGH - up) / (HIGH - LOW) * RINGS as f64 - 0.5;
            assert!((ring - ring.round()).abs() < 1e-6, "{ring}");
            rings.insert(ring.round() as i64);
        }
        assert_eq!(rings.len(), RINGS);
        let (along, across) = (std::f64::consts::TAU / lens(20_000.0).columns as f64, (HIGH - LOW) / RINGS as f64);
        assert!(2.0 * along < across);
        assert_eq!(surface.cloud.intensities.expect("strengths").len(), surface.cloud.points.len());
    }

    #[test]
    fn a_room_is_sheared_while_the_vehicle_rolls() {
        // the turn begins and ends at -z: at its left it began half a turn ago
        let side = |surface: &Surface, sign: f64| {
            let wall = surface.cloud.points.iter().filter(|p| p.x * sign > 9.0 && p.z.abs() < 2.0 && p.y.abs() < 1.0);
            let places: Vec<f64> = wall.map(|p| p.x.abs()).collect();
            places.iter().sum::<f64>() / places.len() as f64
        };
        let (still, rolling) = (scanned(Vector3::zeros()), scanned(Vector3::x() * 1.0));
        assert!((side(&still, 1.0) - 10.0).abs() < 0.01 && (side(&still, -1.0) - 10.0).abs() < 0.01);
        assert!((side(&rolling, 1.0) - 9.75).abs() < 0.05, "{}", side(&rolling, 1.0));
        assert!((side(&rolling, -1.0) - 9.75).abs() < 0.05, "{}", side(&rolling, -1.0));
    }
}
