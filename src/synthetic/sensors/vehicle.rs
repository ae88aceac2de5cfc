//! A rotating lidar on a vehicle: rings far apart with points close together along them, all the way round, while the vehicle
//! rolls on; each point is written as if it had stood still.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::{Lens, Projection};
use super::stage::{Picture, Stage, Viewpoint, normal};
use crate::geometry::Surface;

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
