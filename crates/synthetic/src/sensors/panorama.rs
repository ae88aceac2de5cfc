//! A scanner on a tripod: a panorama over the full sphere but for the tripod below, precise, with mixed pixels at edges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, normal};
use visage_geometry::{Point3, Surface};

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

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::lens::Projection;
    use super::super::stage::walls::{stage, view};
    use super::*;
    use crate::solids::{cuboid, hollow};

    #[test]
    fn it_sees_all_but_the_tripod_and_mixes_pixels_at_edges() {
        let lens = Lens::of(Projection::Sphere { low: LOW, high: HIGH }, 10_000.0);
        let room = hollow([-4.0, -2.0, -4.0], [4.0, 2.0, 4.0]);
        let post = cuboid([-0.4, -2.0, 1.8], [0.4, 2.0, 2.0]);
        let surface = scan(&stage([room, post]), &view(), lens, true, &mut ChaCha8Rng::seed_from_u64(1));
        let up = |p: &Point3| (-p.y).atan2(p.x.hypot(p.z));
        assert!(surface.cloud.points.iter().all(|p| up(p) > LOW), "the tripod");
        assert!(surface.cloud.points.iter().any(|p| up(p) > 1.5), "straight up");
        assert!(surface.cloud.points.iter().any(|p| p.z < -3.5) && surface.cloud.points.iter().any(|p| p.x < -3.5));
        let mixed =
            surface.cloud.points.iter().filter(|p| (2.1..3.9).contains(&p.z) && p.x.abs() < 1.2 && p.y.abs() < 1.0);
        assert!(mixed.count() > 10);
        assert_eq!(surface.sensor, Some(Point3::origin()));
    }
}
