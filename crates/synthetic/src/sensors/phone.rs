//! A phone's lidar: few pixels, depth smoothed across edges so that these are rounded, noise in patches and from pixel to
//! pixel, nothing beyond a few metres. The origin of its files is not where it stood.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::super::texture::noise;
use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint, colours, normal};
use visage_geometry::{Motion, Point3, Surface};

/// Patches of depth that are off together: standard deviation in shares of the depth,
const PATCHES: f64 = 0.0025;
/// and that of single pixels.
const PIXELS: f64 = 0.0012;
/// Pixels of a patch.
const PATCH: f64 = 9.0;
/// Nothing is seen beyond, metres.
const FAR: f64 = 4.0;
/// Depths are smoothed over so many pixels to each side,
const SMOOTHED: isize = 2;
/// if they differ by less than this share.
const ONE_SURFACE: f64 = 0.2;
const GRAZING_DEG: f64 = 80.0;

/// Standard deviation of the depth.
pub fn deviation(depth: f64) -> f64 {
    depth * PATCHES.hypot(PIXELS)
}

/// One scan, and its frame in the world.
pub fn scan(stage: &Stage, view: &Viewpoint, lens: Lens, rng: &mut ChaCha8Rng) -> (Surface, Motion) {
    let picture = Picture::simple(stage, view, lens);
    let forward: Vec<f64> = (0..lens.pixels()).map(|pixel| lens.ray(pixel, [0.0; 2]).1.z).collect();
    let ranges = picture.ranges(GRAZING_DEG);
    let depths: Vec<Option<f64>> =
        ranges.iter().zip(&forward).map(|(range, forward)| range.map(|r| r * forward).filter(|z| *z < FAR)).collect();
    let patches: u64 = rng.random();
    let measured: Vec<Option<f64>> = (0..lens.pixels())
        .map(|pixel| {
            let depth = smoothed(&depths, &lens, pixel)?;
            let (column, row) = (pixel % lens.columns, pixel / lens.columns);
            // lattice noise has a standard deviation of about 0.4
            let place = Point3::new(column as f64 / PATCH, row as f64 / PATCH, 0.5);
            let error = PATCHES / 0.4 * noise(&place, patches) + PIXELS * normal(rng);
            Some(depth * (1.0 + error) / forward[pixel])
        })
        .collect();
    let mut surface = picture.surface(&measured, false);
    surface.cloud.colors = Some(colours(&picture.brightness(&measured), rng));
    let middle = surface.cloud.centroid().coords;
    surface.cloud.points.iter_mut().for_each(|point| *point -= middle);
    (surface, view.pose_world * Motion::translation(middle.x, middle.y, middle.z))
}

/// The mean of the depths around a pixel that may be of one surface with it, near ones counting more.
fn smoothed(depths: &[Option<f64>], lens: &Lens, pixel: usize) -> Option<f64> {
    let own = depths[pixel]?;
    let (column, row) = (pixel % lens.columns, pixel / lens.columns);
    let (mut sum, mut weights) = (0.0, 0.0);
    for down in -SMOOTHED..=SMOOTHED {
        for right in -SMOOTHED..=SMOOTHED {
            let at = (column.checked_add_signed(right), row.checked_add_signed(down));
            let (Some(column), Some(row)) = at else { continue };
            if column >= lens.columns || row >= lens.rows {
                continue;
            }
            if let Some(depth) = depths[row * lens.columns + column]
                && (depth - own).abs() < ONE_SURFACE * own
            {
                let weight = (-0.3 * (right * right + down * down) as f64).exp();
                sum += weight * depth;
                weights += weight;
            }
        }
    }
    Some(sum / weights)
}

#[cfg(test)]
mod tests {
    use super::super::stage::walls::{lens, rng, stage, view, wall};
    use super::*;

    #[test]
    fn edges_are_rounded_and_the_far_is_missing() {
        let walls = [wall([-4.0, 4.0], 4.0, 1.1), wall([-0.2, 0.2], 0.2, 1.0), wall([3.0, 9.0], 4.0, 6.0)];
        let (surface, pose) = scan(&stage(walls), &view(), lens(), &mut rng());
        let between = surface.cloud.points.iter().filter(|p| (1.03..1.07).contains(&(pose * *p).z)).count();
        assert!(between > 40, "{between} points on the slope of the edge");
        assert!(surface.cloud.centroid().coords.norm() < 1e-9, "the origin tells nothing of the sensor");
        let (nothing, _) = scan(&stage([wall([-9.0, 9.0], 9.0, 6.0)]), &view(), lens(), &mut rng());
        assert!(nothing.cloud.is_empty());
    }

    #[test]
    fn noise_comes_in_patches() {
        let (surface, pose) = scan(&stage([wall([-4.0, 4.0], 4.0, 2.0)]), &view(), lens(), &mut rng());
        let errors: Vec<f64> = surface.cloud.points.iter().map(|p| (pose * p).z - 2.0).collect();
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        let neighbours = errors.windows(2).map(|e| e[0] * e[1]).sum::<f64>() / errors.len() as f64;
        assert!((variance.sqrt() / deviation(2.0) - 1.0).abs() < 0.35, "{}", variance.sqrt());
        assert!(neighbours > 0.5 * variance, "neighbours are off together");
    }
}
