//! Views of a depth camera that goes around something large, with the camera's faults: noise that grows with depth,
//! quantised disparities, points between a near and a far surface, and a person who sways from view to view.

use std::f64::consts::TAU;

use rand::distr::Distribution;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::scanner::ScanSet;
use super::tracer::Target;
use visage_geometry::{Cloud, Mesh, Motion, Point3, RangeGrid, Surface, Vector3};

/// A depth camera and how it was used. Lengths are mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthCamera {
    /// From the camera to the middle of what it sees.
    pub distance: f64,
    /// Distance of neighbouring points there.
    pub resolution: f64,
    /// Standard deviation of the depth there; it grows with the square of the depth.
    pub noise: f64,
    /// Step of the depth there that the quantised disparity makes; it grows likewise.
    pub step: f64,
    /// The share of pixels beside an edge that show something between near and far.
    pub flying: f64,
    /// How far the upper end of what is seen sways between views.
    pub sway: f64,
}

impl Default for DepthCamera {
    /// A camera of the first kind of its sort, 2 m away.
    fn default() -> Self {
        DepthCamera { distance: 2000.0, resolution: 3.6, noise: 1.5, step: 2.0, flying: 0.3, sway: 0.0 }
    }
}

/// Surfaces seen at a larger angle than this to their normal give no point, degrees.
const GRAZING_DEG: f64 = 78.0;
/// A neighbouring pixel farther off in depth than this is beyond an edge, mm.
const EDGE: f64 = 30.0;
/// The share of the noise's variance that neighbouring pixels have in common, and how many pixels that goes.
const COMMON: f64 = 0.35;
const COMMON_PIXELS: std::ops::Range<f64> = 6.0..25.0;

/// Poses of `views` cameras on `turns` of a ring around `mesh` from `start` over `arc` radians; with more turns than
/// one the camera is held lower and higher in turn.
pub fn ring(mesh: &Mesh, camera: &DepthCamera, views: usize, turns: usize, (start, arc): (f64, f64)) -> Vec<Motion> {
    let Some(bounds) = mesh.bounds() else { return Vec::new() };
    let center = bounds.center();
    let height = bounds.max.y - bounds.min.y;
    let a_turn = views.div_ceil(turns.max(1)).max(1);
    let pose = |view: usize| {
        let azimuth = start + arc * (view % a_turn) as f64 / a_turn as f64;
        let turn = (view / a_turn) as f64;
        let lift = if turns > 1 { (turn / (turns - 1) as f64 - 0.5) * 0.5 * height } else { 0.12 * height };
        let level = Vector3::new(azimuth.sin(), 0.0, azimuth.cos()) * camera.distance;
        let sensor = center + level + Vector3::y() * lift;
        Motion::face_towards(&sensor, &center, &-Vector3::y())
    };
    (0..views).map(pose).collect()
}

/// The whole circle, from the front.
pub const ALL_AROUND: (f64, f64) = (0.0, TAU);

/// Scans `mesh` (wound outward) from these true poses. The same arguments give the same bits.
pub fn depth_views(mesh: &Mesh, poses: Vec<Motion>, camera: &DepthCamera, seed: u64) -> ScanSet {
    let target = Target::new(mesh);
    let Some(bounds) = mesh.bounds() else { return ScanSet { scans: Vec::new(), poses: Vec::new() } };
    let floor = bounds.min.y;
    let height = (bounds.max.y - floor).max(f64::MIN_POSITIVE);
    let scan = |(view, pose): (usize, &Motion)| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(view as u64);
        let sway = Vector3::new(normal(&mut rng), 0.2 * normal(&mut rng), normal(&mut rng)) * camera.sway;
        let bent = rng.random_range(1.0..2.0);
        let mut ranges = Ranges::cast(&target, pose, mesh, camera);
        ranges.disturb(camera, &mut rng);
        let swayed = |p: Point3| {
            let share = (((pose * p).y - floor) / height).clamp(0.0, 1.0);
            p + pose.rotation.inverse() * (sway * share.powf(bent))
        };
        ranges.surface(swayed)
    };
    let scans = poses.iter().enumerate().map(scan).collect();
    ScanSet { scans, poses }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A depth picture: z along the axis of each pixel that saw something.
struct Ranges {
    columns: usize,
    rows: usize,
    /// Tangent of the angle of a pixel, and the picture's corner in pixels from the axis.
    tangent: f64,
    corner: [f64; 2],
    depths: Vec<Option<f64>>,
}

impl Ranges {
    /// A picture that just holds the whole mesh.
    fn cast(target: &Target, pose: &Motion, mesh: &Mesh, camera: &DepthCamera) -> Ranges {
        let tangent = camera.resolution / camera.distance;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for vertex in &mesh.vertices {
            let p = pose.inverse_transform_point(vertex);
            for (axis, value) in [p.x, p.y].into_iter().enumerate() {
                low[axis] = low[axis].min((value / p.z / tangent).floor());
                high[axis] = high[axis].max((value / p.z / tangent).ceil());
            }
        }
        let [columns, rows] = [0, 1].map(|axis| (high[axis] - low[axis]) as usize + 1);
        let mut ranges = Ranges { columns, rows, tangent, corner: low, depths: Vec::new() };
        let sensor = Point3::from(pose.translation.vector);
        let least_cosine = GRAZING_DEG.to_radians().cos();
        let depth = |pixel: usize| {
            let ray = ranges.ray(pixel);
            let hit = target.first_hit(sensor, pose.rotation * ray.normalize())?;
            (hit.cos_incidence >= least_cosine).then(|| hit.distance / ray.norm())
        };
        ranges.depths = (0..columns * rows).into_par_iter().map(depth).collect();
        ranges
    }

    /// The way to a pixel, 1 along the axis.
    fn ray(&self, pixel: usize) -> Vector3 {
        let (column, row) = ((pixel % self.columns) as f64, (pixel / self.columns) as f64);
        Vector3::new((column + self.corner[0]) * self.tangent, (row + self.corner[1]) * self.tangent, 1.0)
    }

    fn disturb(&mut self, camera: &DepthCamera, rng: &mut ChaCha8Rng) {
        self.fly(camera.flying, rng);
        let waves: Vec<[f64; 3]> = (0..8)
            .map(|_| {
                let (direction, length) = (rng.random_range(0.0..TAU), rng.random_range(COMMON_PIXELS));
                [TAU / length * direction.cos(), TAU / length * direction.sin(), rng.random_range(0.0..TAU)]
            })
            .collect();
        for pixel in 0..self.depths.len() {
            let Some(depth) = self.depths[pixel] else { continue };
            let (column, row) = ((pixel % self.columns) as f64, (pixel / self.columns) as f64);
            // a sine's variance is a half: eight of them make four
            let common = 0.5 * waves.iter().map(|[x, y, phase]| (x * column + y * row + phase).sin()).sum::<f64>();
            let own = normal(rng);
            let growth = (depth / camera.distance).powi(2);
            let noisy = depth + camera.noise * growth * ((1.0 - COMMON).sqrt() * own + COMMON.sqrt() * common);
            // disparity is the inverse of depth: even steps of it are steps that grow with the square
            let disparity_step = camera.step / camera.distance.powi(2);
            let quantised = if disparity_step > 0.0 {
                1.0 / ((1.0 / noisy / disparity_step).round() * disparity_step)
            } else {
                noisy
            };
            self.depths[pixel] = Some(quantised);
        }
    }

    /// Moves some of the pixels beside an edge to between the near and the far side, or into the air behind a rim.
    fn fly(&mut self, share: f64, rng: &mut ChaCha8Rng) {
        let before = self.depths.clone();
        for pixel in 0..before.len() {
            let Some(depth) = before[pixel] else { continue };
            let beside =
                [pixel.checked_sub(1), Some(pixel + 1), pixel.checked_sub(self.columns), Some(pixel + self.columns)];
            let beyond = beside.into_iter().flatten().find_map(|other| match before.get(other)? {
                Some(far) if far - depth > EDGE => Some(far - depth),
                Some(_) => None,
                None => Some(2.0 * EDGE),
            });
            if let Some(gap) = beyond
                && rng.random_bool(share)
            {
                self.depths[pixel] = Some(depth + gap * rng.random_range(0.0..1.0f64).powi(2));
            }
        }
    }

    fn surface(&self, moved: impl Fn(Point3) -> Point3) -> Surface {
        let mut points = Vec::new();
        let mut pixels = vec![RangeGrid::EMPTY; self.depths.len()];
        for (pixel, depth) in self.depths.iter().enumerate() {
            let Some(depth) = depth else { continue };
            pixels[pixel] = points.len() as u32;
            points.push(moved(Point3::from(self.ray(pixel) * *depth)));
        }
        Surface {
            cloud: Cloud::from_points(points),
            faces: Vec::new(),
            grid: Some(RangeGrid { columns: self.columns, rows: self.rows, pixels }),
            sensor: Some(Point3::origin()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body;

    #[test]
    fn views_of_a_person_lie_on_the_person_but_for_their_faults() {
        let mesh = body::person(3).mesh;
        let camera = DepthCamera { resolution: 12.0, ..DepthCamera::default() };
        let poses = ring(&mesh, &camera, 4, 2, ALL_AROUND);
        let set = depth_views(&mesh, poses.clone(), &camera, 1);
        let clean = DepthCamera { noise: 0.0, step: 0.0, flying: 0.0, ..camera };
        let bare = depth_views(&mesh, poses, &clean, 1);
        let mut off: Vec<f64> = Vec::new();
        for (scan, without) in set.scans.iter().zip(&bare.scans) {
            assert!((2_000..9_000).contains(&scan.cloud.len()), "{} points", scan.cloud.len());
            assert_eq!(scan.cloud.len(), without.cloud.len());
            off.extend(scan.cloud.points.iter().zip(&without.cloud.points).map(|(p, q)| (p - q).norm()));
        }
        off.sort_by(f64::total_cmp);
        let at = |share: f64| off[(share * off.len() as f64) as usize];
        assert!((0.5..2.0).contains(&at(0.5)) && at(0.995) > 8.0, "{} {}", at(0.5), at(0.995));
        assert_eq!(set.scans[1].cloud, depth_views(&mesh, set.poses.clone(), &camera, 1).scans[1].cloud);
    }

    #[test]
    fn a_sway_moves_the_head_and_not_the_feet() {
        let mesh = body::headless(3).mesh;
        let still = DepthCamera { resolution: 15.0, noise: 0.0, step: 0.0, flying: 0.0, ..DepthCamera::default() };
        let poses = ring(&mesh, &still, 1, 1, ALL_AROUND);
        let scan = |camera: &DepthCamera| depth_views(&mesh, poses.clone(), camera, 5).scans.remove(0).cloud.points;
        let (still, swaying) = (scan(&still), scan(&DepthCamera { sway: 4.0, ..still }));
        let moved = |high: bool| {
            let of = still.iter().zip(&swaying).filter(|(p, _)| ((poses[0] * *p).y > 1000.0) == high);
            of.map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
        };
        assert!(moved(true) > 1.5 * moved(false) && moved(true) > 1.0, "{} {}", moved(true), moved(false));
    }
}
