//! A laser line seen by a camera beside it: clean points on a grid, but nothing where the laser or the camera is shaded, where
//! the surface is dark, or where it is seen too much from the side.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, normal};
use crate::geometry::{Point3, Surface};

/// Standard deviation of the range, mm.
pub const NOISE: f64 = 0.12;
/// From the camera to the laser, mm.
const BASELINE: f64 = 170.0;
/// Seen at a larger angle to the normal a surface gives no point, degrees.
const GRAZING_DEG: f64 = 68.0;
/// Darker surfaces than this give hardly a point.
const DARK: f64 = 0.2;

/// One scan, with its grid if files have it.
pub fn scan(stage: &Stage, view: &Viewpoint, lens: Lens, has_grid: bool, rng: &mut ChaCha8Rng) -> Surface {
    let picture = Picture::simple(stage, view, lens);
    let laser = view.pose_world * Point3::new(BASELINE, 0.0, 0.0);
    let mut ranges = picture.ranges(GRAZING_DEG);
    for (pixel, range) in ranges.iter_mut().enumerate() {
        let (Some(seen), Some(at)) = (picture.seen[pixel], *range) else { continue };
        let (start, way) = lens.ray(pixel, [0.0; 2]);
        let place = view.pose_world * (start + way * at);
        let is_lit = stage.is_clear(&view.turn, laser, place, 0.5);
        let is_missed = rng.random_bool(if seen.albedo < DARK { 0.9 } else { 0.01 });
        let error = NOISE * normal(rng);
        *range = (is_lit && !is_missed).then_some(at + error);
    }
    let mut surface = picture.surface(&ranges, has_grid);
    surface.sensor = has_grid.then(Point3::origin);
    surface
}
