//! Points as small discs: which samples they cover, and how they look there.

use rayon::prelude::*;

use super::bands::{Covering, Look, Rect, Samples, key};
use super::vector::{times, unit};
use super::{Grid, Scene};
use crate::camera::Camera;
use crate::color::{PLAIN, Tables};
use crate::image::Rgb;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals::{NEIGHBOURS, local_planes};

/// The radius of a disc in spacings: those of four neighbours of a square leave no hole between them.
const RADIUS: f64 = 0.8;
/// No disc is smaller, in samples: it would miss all of them.
const LEAST_RADIUS: f32 = 0.8;
/// No disc is larger, in shares of the picture's width.
const MOST_RADIUS: f32 = 0.02;

/// A point on the picture.
#[derive(Debug, Clone, Copy)]
struct Disc {
    /// In samples.
    x: f32,
    y: f32,
    radius: f32,
    nearness: f32,
}

/// The points of a scene, placed.
pub(super) struct Splats<'a> {
    discs: Vec<Disc>,
    normals: Vec<[f32; 3]>,
    /// Whether normals say which side is the outer one.
    is_oriented: bool,
    colors: Option<&'a [Rgb]>,
    tables: Tables,
}

impl<'a> Splats<'a> {
    pub(super) fn new(scene: &Scene<'a>, camera: &Camera, grid: Grid) -> Splats<'a> {
        let views: Vec<[f32; 3]> = scene.points.par_iter().with_min_len(4096).map(|p| camera.view(p)).collect();
        let fine = grid.fine as f32;
        let most = (MOST_RADIUS * grid.columns() as f32).max(LEAST_RADIUS);
        let disc = |view: &[f32; 3]| {
            let placed = camera.placed(*view);
            let nearness = placed.nearness as f32;
            let (_, pixels) = camera.depth_of(nearness);
            let radius = (RADIUS as f32 * scene.spacing as f32 * pixels * fine).clamp(LEAST_RADIUS, most);
            let [x, y] = placed.at.map(|x| (x as f32 * fine).clamp(-1e6, 1e6));
            Disc { x, y, radius: if radius.is_finite() { radius } else { LEAST_RADIUS }, nearness }
        };
        let discs = views.par_iter().with_min_len(4096).map(disc).collect();
        let normals = match scene.normals {
            Some(normals) => normals.par_iter().with_min_len(4096).map(|normal| camera.turned(normal)).collect(),
            None => normals_of(views),
        };
        let is_oriented = scene.normals.is_some();
        Splats { discs, normals, is_oriented, colors: scene.colors, tables: Tables::new() }
    }
}

/// Normals of points that come without.
fn normals_of(views: Vec<LocalPoint>) -> Vec<[f32; 3]> {
    let indexed = IndexedPoints::new(views);
    let planes = local_planes(&indexed, &indexed.points, NEIGHBOURS);
    planes.iter().map(|plane| plane.normal).collect()
}

impl Covering for Splats<'_> {
    fn len(&self) -> usize {
        self.discs.len()
    }

    #[inline]
    fn rect(&self, thing: usize) -> Option<Rect> {
        let disc = self.discs.get(thing)?;
        let ends =
            |middle: f32| [(middle - disc.radius - 0.5).ceil() as i32, (middle + disc.radius - 0.5).floor() as i32];
        let ([left, right], [top, bottom]) = (ends(disc.x), ends(disc.y));
        (left <= right && top <= bottom).then_some(Rect { left, right, top, bottom })
    }

    #[inline]
    fn cover(&self, thing: usize, samples: &mut Samples) {
        let Some(disc) = self.discs.get(thing) else { return };
        let rect = self.rect(thing).and_then(|rect| rect.within(samples.columns, samples.first, samples.rows));
        let Some(rect) = rect else { return };
        let key = key(disc.nearness, thing as u32);
        let radius2 = disc.radius * disc.radius;
        for y in rect.top..=rect.bottom {
            let start = (y as usize - samples.first) * samples.columns;
            let dy = y as f32 + 0.5 - disc.y;
            for x in rect.left..=rect.right {
                let dx = x as f32 + 0.5 - disc.x;
                if dx * dx + dy * dy <= radius2 {
                    let sample = &mut samples.keys[start + x as usize];
                    *sample = (*sample).max(key);
                }
            }
        }
    }

    fn look(&self, thing: usize, _at: [f32; 2]) -> Look {
        let normal = self.normals.get(thing).and_then(|normal| unit(*normal)).unwrap_or([0.0, 0.0, 1.0]);
        let is_away = normal[2] < 0.0;
        let color = self.colors.and_then(|colors| colors.get(thing)).copied().unwrap_or(PLAIN);
        Look {
            normal: if is_away { times(normal, -1.0) } else { normal },
            light: self.tables.light(color),
            // near the rim of a shape normals are too rough to tell
            is_inside: self.is_oriented && normal[2] < -0.3,
        }
    }
}
