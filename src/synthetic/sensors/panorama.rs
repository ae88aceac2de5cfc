//! A scanner on a tripod: a panorama over the full sphere but for the tripod below, precise, with mixed pixels at edges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, normal};
use crate::geometry::{Point3, Surface};

/// The lowest angle, radians: the tripod hides what is below.
pub const LOW: f64 = -1.05;
/// Straight up.
pub const HIGH: f64 = std::f64::consts::FRAC_PI_2;
/// Standard deviation of the range, metres.
pub const NOISE: f64 = 0.002;
const FAR: f64 = 60.0;
const GRAZING_DEG: f64 = 84.0;

/// One panorama, with grid and strength if files have them.
pub fn scan(stage: &Stage, view: &Viewpoint, lens: Lens, has_grid: bool, rng: &mut ChaCha8Rng) -> Surface {
    let picture = Picture::simple(stage, view, lens);
    let mut ranges = picture.ranges(GRAZING_DEG);
    picture.mix_edges(&mut ranges, 0.06, 0.35, rng);
    for range in &mut ranges {
        let error = NOISE * normal(rng);
        let is_lost = rng.random_bool(0.005);
        *range = range.filter(|r| *r < FAR && !is_lost).map(|r| r + error);
    }
    let mut surface = picture.surface(&ranges, has_grid);
    surface.sensor = has_grid.then(Point3::origin);
    let strength = || picture.brightness(&ranges).iter().map(|b| *b as f32).collect();
    surface.cloud.intensities = has_grid.then(strength);
    surface
}
