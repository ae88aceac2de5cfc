//! A scene ready to be looked at, and what the rays of a picture meet in it.

use rand::RngExt;
use rand::distr::Distribution;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::super::scenery::Scenery;
use super::super::texture::rough;
use super::super::tracer::Target;
use super::lens::Lens;
use visage_geometry::{Cloud, Motion, Point3, RangeGrid, Surface, Vector3};

/// A scene prepared for ray casting.
pub struct Stage {
    moving: Target,
    still: Option<Target>,
    /// Length of the spots of its surface.
    grain: f64,
    seed: u64,
}

/// A place of the sensor, and how the scene stands before it.
#[derive(Debug, Clone, Copy)]
pub struct Viewpoint {
    /// Sensor to world.
    pub pose_world: Motion,
    /// What turns with a turntable, to world.
    pub turn: Motion,
    /// How far the sensor moves during one scan.
    pub travel: Vector3,
}

/// What a ray meets.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// From the start of the ray.
    pub range: f64,
    /// Cosine of the angle between the ray, looked back along, and the surface's normal.
    pub cos_incidence: f64,
    /// The surface's normal; in the frame of what is scanned, if it is that.
    pub normal: Vector3,
    /// How bright the surface is, 0 to 1.
    pub albedo: f64,
    /// Whether it is what is scanned, not the background of a turntable.
    pub is_subject: bool,
}

impl Stage {
    /// Prepares a scene.
    pub fn new(scene: &Scenery, seed: u64) -> Self {
        let still = scene.still.as_ref().map(Target::new);
        Stage { moving: Target::new(&scene.mesh), still, grain: 0.22 * scene.extent, seed }
    }

    /// What a ray of the world meets first.
    pub fn first_hit(&self, turn: &Motion, start: Point3, way: Vector3) -> Option<Seen> {
        let (own_start, own_way) = (turn.inverse_transform_point(&start), turn.inverse_transform_vector(&way));
        let moving =
            self.moving.first_hit(own_start, own_way).map(|hit| (hit, own_start + own_way * hit.distance, true));
        let still = self.still.as_ref().and_then(|still| still.first_hit(start, way));
        let still = still.map(|hit| (hit, start + way * hit.distance, false));
        let (hit, place, is_subject) = match (moving, still) {
            (Some(a), Some(b)) if b.0.distance < a.0.distance => b,
            (a, b) => a.or(b)?,
        };
        let spot = rough(&Point3::from(place.coords / self.grain), 3, self.seed);
        let albedo = (0.5 + 0.6 * spot).clamp(0.02, 1.0);
        Some(Seen { range: hit.distance, cos_incidence: hit.cos_incidence, normal: hit.normal, albedo, is_subject })
    }

    /// Whether nothing stands between two places of the world; `slack` before the second one is not looked at.
    pub fn is_clear(&self, turn: &Motion, from: Point3, to: Point3, slack: f64) -> bool {
        let way = to - from;
        let length = way.norm();
        self.first_hit(turn, from, way / length).is_none_or(|seen| seen.range > length - slack)
    }
}

/// A sensor's picture: for each pixel what its ray meets.
pub struct Picture {
    /// The pixels.
    pub lens: Lens,
    /// What each meets.
    pub seen: Vec<Option<Seen>>,
}

impl Picture {
    /// Looks through a lens; `shift` is where in its pixel each ray goes and `moved` how far the sensor has travelled by
    /// then.
    pub fn of(
        stage: &Stage,
        view: &Viewpoint,
        lens: Lens,
        shift: impl Fn(usize) -> [f64; 2] + Sync,
        moved: impl Fn(usize) -> f64 + Sync,
    ) -> Self {
        let look = |pixel: usize| {
            let (start, way) = lens.ray(pixel, shift(pixel));
            let start = view.pose_world * start + view.travel * moved(pixel);
            stage.first_hit(&view.turn, start, view.pose_world * way)
        };
        Picture { lens, seen: (0..lens.pixels()).into_par_iter().map(look).collect() }
    }

    /// The middle of each pixel, from where the sensor stands.
    pub fn simple(stage: &Stage, view: &Viewpoint, lens: Lens) -> Self {
        Self::of(stage, view, lens, |_| [0.0; 2], |_| 0.0)
    }

    /// The ranges of what isn't seen at a larger angle than this, degrees.
    pub fn ranges(&self, grazing_deg: f64) -> Vec<Option<f64>> {
        let least = grazing_deg.to_radians().cos();
        self.seen.iter().map(|seen| seen.filter(|s| s.cos_incidence >= least).map(|s| s.range)).collect()
    }

    /// A neighbouring pixel's range, if the surface breaks off between them: they differ by more than `step` of the smaller.
    pub fn beyond_edge(&self, pixel: usize, step: f64) -> Option<f64> {
        let range = self.seen[pixel]?.range;
        let far = |other: usize| Some(self.seen[other]?.range).filter(|r| (r - range).abs() > step * r.min(range));
        self.lens.neighbours(pixel).find_map(far)
    }

    /// At edges, with probability `share`, a range between that of both sides.
    pub fn mix_edges(&self, ranges: &mut [Option<f64>], step: f64, share: f64, rng: &mut ChaCha8Rng) {
        for (pixel, range) in ranges.iter_mut().enumerate() {
            if let (Some(near), Some(far)) = (*range, self.beyond_edge(pixel, step))
                && rng.random_bool(share)
            {
                *range = Some(near + (far - near) * rng.random_range(0.0..0.8));
            }
        }
    }

    /// The points of the pixels that have a range, with the picture's grid if it is kept.
    pub fn surface(&self, ranges: &[Option<f64>], has_grid: bool) -> Surface {
        let mut points = Vec::new();
        let mut pixels = vec![RangeGrid::EMPTY; ranges.len()];
        for (pixel, range) in ranges.iter().enumerate() {
            let Some(range) = range else { continue };
            let (start, way) = self.lens.ray(pixel, [0.0; 2]);
            pixels[pixel] = points.len() as u32;
            points.push(start + way * *range);
        }
        let grid = has_grid.then_some(RangeGrid { columns: self.lens.columns, rows: self.lens.rows, pixels });
        Surface { cloud: Cloud::from_points(points), faces: Vec::new(), grid, sensor: None }
    }

    /// How bright the pixels are that have a range.
    pub fn brightness(&self, ranges: &[Option<f64>]) -> Vec<f64> {
        let bright = |(seen, range): (&Option<Seen>, &Option<f64>)| range.map(|_| seen.map_or(0.5, |s| s.albedo));
        self.seen.iter().zip(ranges).filter_map(bright).collect()
    }
}

/// Colours of a surface of this brightness, with the camera's noise.
pub fn colours(brightness: &[f64], rng: &mut ChaCha8Rng) -> Vec<[u8; 3]> {
    let mut noise = || 5.0 * normal(rng);
    brightness.iter().map(|b| [230.0 * b, 60.0 + 140.0 * b, 210.0 - 120.0 * b].map(|c| (c + noise()) as u8)).collect()
}

/// A draw from the standard normal distribution.
pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Walls to test sensors on.
#[cfg(test)]
pub(super) mod walls {
    use rand::SeedableRng;

    use super::super::lens::Projection;
    use super::*;
    use crate::scenery::Layout;
    use crate::solids::{sheet, together};
    use visage_geometry::Mesh;

    /// A wall seen from the origin along z: at depth z, with these bounds across.
    pub fn wall(x: [f64; 2], half_height: f64, z: f64) -> Mesh {
        let h = half_height;
        sheet([[x[1], -h, z], [x[0], -h, z], [x[0], h, z], [x[1], h, z]])
    }

    pub fn stage(walls: impl IntoIterator<Item = Mesh>) -> Stage {
        let mesh = together(walls);
        let extent = mesh.bounds().map_or(1.0, |bounds| bounds.diagonal());
        let center = Point3::origin();
        let scene = Scenery { mesh, still: None, layout: Layout::Around, extent, center, half_length: extent };
        Stage::new(&scene, 3)
    }

    /// A picture of six thousand pixels.
    pub fn lens() -> Lens {
        Lens::of(Projection::Pinhole { half_width: 0.4, half_height: 0.3 }, 6_000.0)
    }

    pub fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(1)
    }

    /// At the origin.
    pub fn view() -> Viewpoint {
        Viewpoint { pose_world: Motion::identity(), turn: Motion::identity(), travel: Vector3::zeros() }
    }
}
