//! Sensors that are carried while they scan, their data merged. In the hand: a fragment of several depth frames whose poses
//! tremble, thinned to a grid. Aloft: parallel lines from above, in map coordinates rounded to float32.

use std::collections::BTreeMap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::depth_camera;
use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, normal};
use visage_geometry::{Cloud, Motion, Point3, Surface, Vector3};

/// Frames of a fragment.
pub const FRAMES: usize = 5;
/// How far frames are off their place, metres,
const TREMOR: f64 = 0.0015;
/// and radians.
const TREMOR_ANGLE: f64 = 0.0015;
/// Edge of the cells to which a fragment is thinned, metres.
const CELL: f64 = 0.008;
/// Standard deviation of heights from the air, metres.
const ALOFT: f64 = 0.1;
/// Where the map's origin is from the scene: east, north and up, metres.
const MAP: [f64; 3] = [499_400.0, 5_418_300.0, 240.0];
/// Seen at a larger angle to the normal a surface gives no point, degrees.
const GRAZING_DEG: f64 = 80.0;

/// Standard deviation of a point: in the hand that of a frame at this depth and the tremor; from the air that of heights
/// and the coordinates' rounding.
pub fn deviation(range: f64) -> f64 {
    if range < 10.0 { depth_camera::deviation(range).hypot(TREMOR + TREMOR_ANGLE * range) } else { ALOFT.hypot(0.3) }
}

/// A fragment, in the frame of the middle one of its frames.
pub fn fragment(stage: &Stage, frames: &[Viewpoint], lens: Lens, rng: &mut ChaCha8Rng) -> (Surface, Motion) {
    let pose_world = frames[frames.len() / 2].pose_world;
    let mut points = Vec::new();
    for view in frames {
        let (picture, ranges) = depth_camera::frame(stage, view, lens, rng);
        let mut off = |size: f64| Vector3::new(normal(rng), normal(rng), normal(rng)) * size;
        let tremor = Motion::new(off(TREMOR), off(TREMOR_ANGLE));
        let to_fragment = pose_world.inv_mul(&(view.pose_world * tremor));
        points.extend(picture.surface(&ranges, false).cloud.points.iter().map(|point| to_fragment * point));
    }
    (Surface { cloud: Cloud::from_points(thinned(&points)), ..Surface::default() }, pose_world)
}

/// The mean of the points of each cell.
fn thinned(points: &[Point3]) -> Vec<Point3> {
    let mut cells: BTreeMap<[i64; 3], (Vector3, f64)> = BTreeMap::new();
    for point in points {
        let cell = [0, 1, 2].map(|axis| (point[axis] / CELL).floor() as i64);
        let (sum, count) = cells.entry(cell).or_insert((Vector3::zeros(), 0.0));
        *sum += point.coords;
        *count += 1.0;
    }
    cells.into_values().map(|(sum, count)| Point3::from(sum / count)).collect()
}

/// A strip in map coordinates, east, north, up; and the map's frame in the world.
pub fn strip(stage: &Stage, view: &Viewpoint, lens: Lens, rng: &mut ChaCha8Rng) -> (Surface, Motion) {
    // pulses come at their own rhythm: up to half a pixel off
    let shifts: Vec<[f64; 2]> =
        (0..lens.pixels()).map(|_| [rng.random_range(-0.5..0.5), rng.random_range(-0.15..0.15)]).collect();
    let picture = Picture::of(stage, view, lens, |pixel| shifts[pixel], |_| 0.0);
    let world_from_map =
        Motion::rotation(Vector3::x() * -std::f64::consts::FRAC_PI_2) * Motion::translation(-MAP[0], -MAP[1], -MAP[2]);
    let map_from_view = world_from_map.inv_mul(&view.pose_world);
    let mut points = Vec::new();
    for (pixel, range) in picture.ranges(GRAZING_DEG).into_iter().enumerate() {
        let error = ALOFT * normal(rng);
        let is_lost = rng.random_bool(0.04);
        if let Some(range) = range.filter(|_| !is_lost) {
            let (start, way) = lens.ray(pixel, shifts[pixel]);
            points.push((map_from_view * (start + way * (range + error))).map(|x| f64::from(x as f32)));
        }
    }
    (Surface { cloud: Cloud::from_points(points), ..Surface::default() }, world_from_map)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::lens::Projection;
    use super::super::stage::walls::{stage, view, wall};
    use super::*;

    #[test]
    fn a_fragment_is_thinned_and_trembles() {
        let lens = Lens::of(Projection::Pinhole { half_width: 0.4, half_height: 0.3 }, 20_000.0);
        let frames = [view(); FRAMES];
        let (surface, pose) =
            fragment(&stage([wall([-2.0, 2.0], 2.0, 1.1)]), &frames, lens, &mut ChaCha8Rng::seed_from_u64(1));
        let errors: Vec<f64> = surface.cloud.points.iter().map(|p| (pose * p).z - 1.1).collect();
        let spread = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((0.3..1.5).contains(&(spread / deviation(1.1))), "{spread}");
        let cells: std::collections::BTreeSet<[i64; 3]> =
            surface.cloud.points.iter().map(|p| [0, 1, 2].map(|k| (p[k] / CELL).floor() as i64)).collect();
        assert_eq!(cells.len(), surface.cloud.len(), "one point a cell");
        assert!(surface.cloud.len() < lens.pixels() * FRAMES / 2);
    }

    #[test]
    fn a_strip_is_rounded_to_float32_in_map_coordinates() {
        let lens = Lens::of(Projection::Parallel { half_width: 100.0, half_height: 200.0 }, 3_000.0);
        let flat = wall([-300.0, 300.0], 300.0, 500.0);
        let (surface, world_from_map) = strip(&stage([flat]), &view(), lens, &mut ChaCha8Rng::seed_from_u64(1));
        assert!(surface.cloud.len() > 2_500);
        for p in &surface.cloud.points {
            assert!(p.iter().all(|x| f64::from(*x as f32) == *x));
            assert!(p.z.abs() < 1e4 || p.y > 5e6, "northings are large");
        }
        let off = |p: &Point3| ((world_from_map * p).z - 500.0).abs();
        assert!(surface.cloud.points.iter().all(|p| off(p) < 1.0), "rounded to half a metre");
        assert!(surface.cloud.points.iter().any(|p| off(p) > 0.15), "and not finer");
    }
}
