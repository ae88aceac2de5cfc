//! A structured-light camera: depth in steps of disparity, noise that grows with its square, flying pixels at edges, a shadow
//! beside near things, nothing from surfaces seen too much from the side, frames cropped.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, colours, normal};
use visage_geometry::{Point3, Surface};

/// Focal length times baseline: disparity in pixels is this over the depth in metres.
const PIXEL_METRES: f64 = 33.0;
/// Disparities are multiples of this, pixels.
const STEP: f64 = 0.125;
/// Standard deviation of the disparity before it is rounded, pixels.
const NOISE: f64 = 0.06;
/// From the camera to the projector, metres.
const BASELINE: f64 = 0.075;
const GRAZING_DEG: f64 = 72.0;

/// Standard deviation of the depth: noise and rounding.
pub fn deviation(depth: f64) -> f64 {
    depth * depth / PIXEL_METRES * NOISE.hypot(STEP / 12f64.sqrt())
}

/// The depth that comes out for a true one.
pub fn measured(depth: f64, rng: &mut ChaCha8Rng) -> f64 {
    let disparity = PIXEL_METRES / depth + NOISE * normal(rng);
    PIXEL_METRES / ((disparity / STEP).round() * STEP).max(STEP)
}

/// The ranges of one frame, with all faults but the crop.
pub fn frame(stage: &Stage, view: &Viewpoint, lens: Lens, rng: &mut ChaCha8Rng) -> (Picture, Vec<Option<f64>>) {
    let picture = Picture::simple(stage, view, lens);
    let projector = view.pose_world * Point3::new(BASELINE, 0.0, 0.0);
    let mut ranges = picture.ranges(GRAZING_DEG);
    for (pixel, range) in ranges.iter_mut().enumerate() {
        let Some(at) = *range else { continue };
        let (start, way) = lens.ray(pixel, [0.0; 2]);
        let place = view.pose_world * (start + way * at);
        let is_lost = rng.random_bool(0.01) || !stage.is_clear(&view.turn, projector, place, 0.01 * at);
        *range = (!is_lost).then_some(at);
    }
    picture.mix_edges(&mut ranges, 0.04, 0.3, rng);
    for (pixel, range) in ranges.iter_mut().enumerate() {
        let forward = lens.ray(pixel, [0.0; 2]).1.z;
        *range = range.map(|at| measured(at * forward, rng) / forward);
    }
    (picture, ranges)
}

/// One scan; frames are cropped by a tenth or two at two sides.
pub fn scan(stage: &Stage, view: &Viewpoint, lens: Lens, has_colours: bool, rng: &mut ChaCha8Rng) -> Surface {
    let (picture, mut ranges) = frame(stage, view, lens, rng);
    let mut crop = |pixels: usize| {
        let size = ((1.0 - rng.random_range(0.0..0.2)) * pixels as f64) as usize;
        let first = rng.random_range(0..=pixels - size);
        first..first + size
    };
    let (columns, rows) = (crop(lens.columns), crop(lens.rows));
    for (pixel, range) in ranges.iter_mut().enumerate() {
        if !(columns.contains(&(pixel % lens.columns)) && rows.contains(&(pixel / lens.columns))) {
            *range = None;
        }
    }
    let mut surface = picture.surface(&ranges, false);
    surface.cloud.colors = has_colours.then(|| colours(&picture.brightness(&ranges), rng));
    surface
}

#[cfg(test)]
mod tests {
    use super::super::stage::walls::{lens, rng, stage, view, wall};
    use super::*;

    #[test]
    fn depths_come_in_steps_that_grow_with_their_square() {
        let surface = scan(&stage([wall([-2.0, 2.0], 2.0, 1.5)]), &view(), lens(), true, &mut rng());
        let steps: Vec<f64> = surface.cloud.points.iter().map(|p| PIXEL_METRES / p.z / STEP).collect();
        assert!(steps.iter().all(|step| (step - step.round()).abs() < 1e-6), "whole steps");
        let spread = |z: f64| {
            let surface = scan(&stage([wall([-9.0, 9.0], 9.0, z)]), &view(), lens(), true, &mut rng());
            let depths = surface.cloud.points.iter().map(|p| (p.z - z).powi(2));
            (depths.sum::<f64>() / surface.cloud.len() as f64).sqrt()
        };
        let (near, far) = (spread(1.53), spread(4.1));
        assert!((far / near / (4.1f64 / 1.53).powi(2) - 1.0).abs() < 0.35, "{near} {far}");
        assert!((near / deviation(1.53) - 1.0).abs() < 0.5, "{near}");
        assert_eq!(surface.cloud.colors.expect("colours").len(), surface.cloud.points.len());
    }

    #[test]
    fn pixels_fly_between_near_and_far_and_frames_are_cropped() {
        let walls = [wall([-2.0, 2.0], 2.0, 2.0), wall([-0.2, 0.2], 0.2, 1.0)];
        let surface = scan(&stage(walls), &view(), lens(), false, &mut rng());
        let flying = surface.cloud.points.iter().filter(|p| (1.1..1.85).contains(&p.z)).count();
        assert!(flying > 10, "{flying}");
        assert!(surface.cloud.len() < lens().pixels() * 97 / 100, "cropped");
    }
}
