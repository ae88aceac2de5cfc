//! A laser line seen by a camera beside it: clean points on a grid, but nothing where the laser or the camera is shaded, where
//! the surface is dark, or where it is seen too much from the side.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, normal};
use visage_geometry::{Point3, Surface};

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

#[cfg(test)]
mod tests {
    use super::super::stage::walls::{lens, rng, stage, view, wall};
    use super::*;
    use crate::solids::moved;
    use visage_geometry::{Motion, RangeGrid, Vector3};

    #[test]
    fn what_the_laser_does_not_reach_is_missing_and_so_are_dark_and_grazing_parts() {
        let back = wall([-400.0, 400.0], 400.0, 600.0);
        // the laser stands at the right: a post shades the wall at its left
        let post = wall([-20.0, 20.0], 400.0, 300.0);
        let surface = scan(&stage([back, post]), &view(), lens(), true, &mut rng());
        let count = |from: f64, to: f64| {
            surface
                .cloud
                .points
                .iter()
                .filter(|p| p.z > 500.0 && p.y.abs() < 100.0 && (from..to).contains(&p.x))
                .count()
        };
        // the shade lies between -210 and -130 mm
        assert_eq!(count(-200.0, -140.0), 0, "in the shade");
        assert!(count(-120.0, -80.0) > 100 && count(80.0, 120.0) > 100, "beside it");
        let lit = surface.cloud.len() as f64 / lens().pixels() as f64;
        assert!((0.5..0.9).contains(&lit), "some parts are too dark: {lit}");
        let grid = surface.grid.expect("files of lasers have grids");
        assert_eq!(grid.pixels.iter().filter(|p| **p != RangeGrid::EMPTY).count(), surface.cloud.len());

        let turn = Motion::translation(0.0, 0.0, 600.0) * Motion::rotation(Vector3::y() * 1.1);
        let steep = moved(&wall([-400.0, 400.0], 400.0, 0.0), &turn);
        let surface = scan(&stage([steep]), &view(), lens(), true, &mut rng());
        let angle = |p: &Point3| (-p.coords.normalize().dot(&(turn * -Vector3::z()))).acos().to_degrees();
        let steepest = surface.cloud.points.iter().map(angle).fold(0.0, f64::max);
        assert!((GRAZING_DEG - 3.0..GRAZING_DEG + 0.5).contains(&steepest), "{steepest}");
    }
}
