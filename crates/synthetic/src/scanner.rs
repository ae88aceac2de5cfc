//! A virtual range scanner: one ray a pixel, the first hit on the mesh, noise along the ray.
//!
//! A scan is in the sensor's frame: the sensor is the origin, x to the right, y down, z forward.

use rand::SeedableRng;
use rand::distr::Distribution;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::tracer::Target;
use visage_geometry::{Cloud, Mesh, Motion, Point3, RangeGrid, Surface, Vector3};

/// What the scanner is like and where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scanner {
    /// Sensor positions on a ring around the object.
    pub views: usize,
    /// From the sensor to the middle of the object, mm.
    pub distance: f64,
    /// Distance of neighbouring points in the middle of the object, mm.
    pub resolution: f64,
    /// Standard deviation of the depth, mm.
    pub noise: f64,
    /// Surfaces seen at a larger angle than this to their normal give no point, degrees.
    pub grazing_angle: f64,
}

impl Default for Scanner {
    fn default() -> Self {
        Scanner { views: 8, distance: 600.0, resolution: 1.25, noise: 0.15, grazing_angle: 75.0 }
    }
}

/// What a scanner made of an object.
#[derive(Debug, Clone)]
pub struct ScanSet {
    /// One scan a view, in the sensor's frame, with its range grid.
    pub scans: Vec<Surface>,
    /// The true `pose_world` of each view: sensor frame to the object's frame.
    pub poses: Vec<Motion>,
}

impl Scanner {
    /// Scans `mesh` (wound outward) from all sides, beginning in front (+z) and going round towards +x. The noise is
    /// seeded: the same arguments give the same scans.
    pub fn scan_set(&self, mesh: &Mesh, seed: u64) -> ScanSet {
        let center = mesh.bounds().map_or(Point3::origin(), |bounds| bounds.center());
        let poses = (0..self.views).map(|view| self.pose(view, &center)).collect();
        self.scan_from(mesh, poses, seed)
    }

    /// Scans `mesh` (wound outward) from these true `poses_world`, whatever `views` says. A pose should look at the
    /// middle of the mesh's box from `distance`.
    pub fn scan_from(&self, mesh: &Mesh, poses: Vec<Motion>, seed: u64) -> ScanSet {
        let Some(bounds) = mesh.bounds() else {
            return ScanSet { scans: Vec::new(), poses: Vec::new() };
        };
        let target = Target::new(mesh);
        let half_width = 0.5 * bounds.diagonal();
        let scan = |(view, pose): (usize, &Motion)| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(view as u64);
            self.scan(&target, pose, half_width, &mut rng)
        };
        let scans = poses.iter().enumerate().map(scan).collect();
        ScanSet { scans, poses }
    }

    /// Where the sensor of a view stands and looks: on a ring round the y axis, in turn a little above and below.
    fn pose(&self, view: usize, center: &Point3) -> Motion {
        const ELEVATIONS_DEG: [f64; 4] = [0.0, 12.0, -8.0, 18.0];
        let azimuth = std::f64::consts::TAU * view as f64 / self.views as f64;
        let elevation = ELEVATIONS_DEG[view % ELEVATIONS_DEG.len()].to_radians();
        let outward = Vector3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        let sensor = center + outward * self.distance;
        // `face_towards` turns z to the viewing direction and keeps y near the given one: down, as in pictures
        Motion::face_towards(&sensor, center, &-Vector3::y())
    }

    /// One scan from `pose_world`, of a square field of view that holds `half_width` at the scanner's distance.
    fn scan(&self, target: &Target, pose_world: &Motion, half_width: f64, rng: &mut ChaCha8Rng) -> Surface {
        let side = (2.0 * half_width / self.resolution).ceil() as usize + 1;
        let step = self.resolution / self.distance;
        let middle = (side - 1) as f64 / 2.0;
        let sensor = Point3::from(pose_world.translation.vector);
        let cos_limit = self.grazing_angle.to_radians().cos();
        let direction = |pixel: usize| {
            let (column, row) = ((pixel % side) as f64 - middle, (pixel / side) as f64 - middle);
            Vector3::new(column * step, row * step, 1.0).normalize()
        };
        let range = |pixel: usize| {
            let ray = pose_world.rotation * direction(pixel);
            target.first_hit(sensor, ray).filter(|hit| hit.cos_incidence >= cos_limit).map(|hit| hit.distance)
        };
        let ranges: Vec<Option<f64>> = (0..side * side).into_par_iter().map(range).collect();

        let mut points = Vec::new();
        let mut pixels = vec![RangeGrid::EMPTY; ranges.len()];
        for (pixel, range) in ranges.into_iter().enumerate() {
            let Some(range) = range else { continue };
            let error: f64 = StandardNormal.sample(rng);
            pixels[pixel] = points.len() as u32;
            points.push(Point3::from(direction(pixel) * (range + self.noise * error)));
        }
        Surface {
            cloud: Cloud::from_points(points),
            faces: Vec::new(),
            grid: Some(RangeGrid { columns: side, rows: side, pixels }),
            sensor: Some(Point3::origin()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{implicit, surface_nets};
    use visage_geometry::Bounds;

    const RADIUS: f64 = 50.0;

    fn ball() -> Mesh {
        let field = |p: &Point3| implicit::ellipsoid(p, [0.0; 3], [RADIUS; 3]);
        let bounds = Bounds { min: Point3::new(-54.0, -54.0, -54.0), max: Point3::new(54.0, 54.0, 54.0) };
        surface_nets::mesh(&field, &bounds, 4.0)
    }

    #[test]
    fn true_poses_bring_every_scan_onto_the_object() {
        let scanner = Scanner { noise: 0.0, resolution: 3.0, ..Scanner::default() };
        let set = scanner.scan_set(&ball(), 0);
        assert_eq!((set.scans.len(), set.poses.len()), (8, 8));
        for (scan, pose) in set.scans.iter().zip(&set.poses) {
            assert!(scan.cloud.len() > 500, "{} points", scan.cloud.len());
            let toward_sensor = (pose * Point3::origin() - Point3::origin()).normalize();
            for point in &scan.cloud.points {
                assert!(point.z > 0.0, "the object lies before the sensor");
                let world = pose * point;
                assert!((world.coords.norm() - RADIUS).abs() < 0.2, "{world}");
                assert!(world.coords.dot(&toward_sensor) > 0.0, "only the near side is seen");
            }
        }
        // the first view looks along -z of the object, its y axis down
        assert!((set.poses[0] * Vector3::z() + Vector3::z()).norm() < 1e-9);
        assert!((set.poses[0] * Vector3::y() + Vector3::y()).norm() < 1e-9);
    }

    #[test]
    fn grazing_hits_are_dropped() {
        let scanner = Scanner { noise: 0.0, resolution: 2.0, grazing_angle: 60.0, views: 1, ..Scanner::default() };
        let set = scanner.scan_set(&ball(), 0);
        let widest = set.scans[0].cloud.points.iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max);
        let expected = RADIUS * 60f64.to_radians().sin();
        assert!((widest - expected).abs() < 5.0, "{widest} instead of about {expected}");
    }

    #[test]
    fn noise_is_seeded_and_has_the_size_asked_for() {
        let scanner = Scanner { noise: 0.5, resolution: 2.0, views: 2, ..Scanner::default() };
        let ball = ball();
        let noisy = scanner.scan_set(&ball, 1);
        let exact = Scanner { noise: 0.0, ..scanner }.scan_set(&ball, 1);
        assert_eq!(noisy.scans, scanner.scan_set(&ball, 1).scans);
        assert_ne!(noisy.scans, scanner.scan_set(&ball, 2).scans);
        let pairs = noisy.scans[1].cloud.points.iter().zip(&exact.scans[1].cloud.points);
        let squares: Vec<f64> = pairs.map(|(a, b)| (a - b).norm_squared()).collect();
        let deviation = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((deviation - 0.5).abs() < 0.05, "{deviation}");
    }

    #[test]
    fn the_grid_names_each_point_at_its_pixel() {
        let scanner = Scanner { resolution: 4.0, views: 1, ..Scanner::default() };
        let scan = &scanner.scan_set(&ball(), 3).scans[0];
        let grid = scan.grid.as_ref().expect("an organised scan");
        assert_eq!(grid.pixels.len(), grid.columns * grid.rows);
        let named: Vec<u32> = grid.pixels.iter().copied().filter(|pixel| *pixel != RangeGrid::EMPTY).collect();
        assert!(named.iter().copied().eq(0..scan.cloud.len() as u32), "row by row, each point once");
    }
}
