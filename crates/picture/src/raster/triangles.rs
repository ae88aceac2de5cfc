//! Triangles: which samples they cover, and how they look there.

use rayon::prelude::*;

use super::bands::{Covering, Look, Rect, Samples, key};
use super::vector::{cross, dot, minus, times, unit};
use super::{Grid, Scene};
use crate::camera::Camera;
use crate::color::{PLAIN, Tables};

/// Corners lie on a grid of so many places to a sample, so that two triangles that share an edge share no sample and leave none.
const FRACTIONS: f32 = 16.0;
/// Corners farther out are brought nearer: products of places stay within 64 bits.
const FARTHEST: f32 = 1e6;
/// A normal between those of the corners that is farther than this from the triangle's own (a cosine) belongs to an edge.
const EDGE: f32 = 0.7;

/// A corner on the picture.
#[derive(Debug, Clone, Copy, Default)]
struct Corner {
    /// Places on the fine grid.
    x: i32,
    y: i32,
    nearness: f32,
    normal: [f32; 3],
}

/// The triangles of a scene, placed.
pub(super) struct Triangles<'a> {
    faces: &'a [[u32; 3]],
    /// The corners in the axes of the picture.
    views: Vec<[f32; 3]>,
    corners: Vec<Corner>,
    /// The light of each corner, if they have colours.
    lights: Option<Vec<[f32; 3]>>,
    plain: [f32; 3],
}

/// The difference of two places, twice the area.
#[inline]
fn area2(a: &Corner, b: &Corner, c: &Corner) -> i64 {
    let [ux, uy] = [i64::from(b.x - a.x), i64::from(b.y - a.y)];
    let [vx, vy] = [i64::from(c.x - a.x), i64::from(c.y - a.y)];
    ux * vy - uy * vx
}

impl<'a> Triangles<'a> {
    pub(super) fn new(scene: &Scene<'a>, camera: &Camera, grid: Grid) -> Triangles<'a> {
        let views: Vec<[f32; 3]> = scene.points.par_iter().with_min_len(4096).map(|p| camera.view(p)).collect();
        let mut normals = vec![[0f32; 3]; views.len()];
        for face in scene.faces {
            let Some([a, b, c]) = corners_of(face, &views) else { continue };
            let normal = cross(minus(b, a), minus(c, a));
            for corner in face {
                let sum = &mut normals[*corner as usize];
                (0..3).for_each(|axis| sum[axis] += normal[axis]);
            }
        }
        let fine = grid.fine as f64;
        let place = |(view, normal): (&[f32; 3], &[f32; 3])| {
            let placed = camera.placed(*view);
            let on_grid = |x: f64| ((x * fine) as f32).clamp(-FARTHEST, FARTHEST);
            let [x, y] = placed.at.map(on_grid).map(|x| (x * FRACTIONS).round() as i32);
            Corner { x, y, nearness: placed.nearness as f32, normal: unit(*normal).unwrap_or([0.0; 3]) }
        };
        let corners = views.par_iter().zip(&normals).with_min_len(4096).map(place).collect();
        let tables = Tables::new();
        let lights = scene.colors.map(|colors| colors.iter().map(|color| tables.light(*color)).collect());
        Triangles { faces: scene.faces, views, corners, lights, plain: tables.light(PLAIN) }
    }

    #[inline]
    fn corners(&self, thing: usize) -> Option<[&Corner; 3]> {
        let [a, b, c] = self.faces.get(thing)?;
        let corner = |index: &u32| self.corners.get(*index as usize);
        Some([corner(a)?, corner(b)?, corner(c)?])
    }
}

#[inline]
fn corners_of(face: &[u32; 3], views: &[[f32; 3]]) -> Option<[[f32; 3]; 3]> {
    let view = |index: u32| views.get(index as usize).copied();
    Some([view(face[0])?, view(face[1])?, view(face[2])?])
}

impl Covering for Triangles<'_> {
    fn len(&self) -> usize {
        self.faces.len()
    }

    #[inline]
    fn rect(&self, thing: usize) -> Option<Rect> {
        let [a, b, c] = self.corners(thing)?;
        let ([left, right], [top, bottom]) = (ends(a.x, b.x, c.x), ends(a.y, b.y, c.y));
        // samples lie in the middle of their cells
        let (before, after) = (|x: i32| (x + 7).div_euclid(16), |x: i32| (x - 8).div_euclid(16));
        let rect = Rect { left: before(left), right: after(right), top: before(top), bottom: after(bottom) };
        (rect.left <= rect.right && rect.top <= rect.bottom).then_some(rect)
    }

    #[inline]
    fn cover(&self, thing: usize, samples: &mut Samples) {
        let Some([a, b, c]) = self.corners(thing) else { return };
        let area = area2(a, b, c);
        // seen from behind it is drawn all the same
        let (b, c, area) = if area < 0 { (c, b, -area) } else { (b, c, area) };
        let rect = self.rect(thing).and_then(|rect| rect.within(samples.columns, samples.first, samples.rows));
        let Some(rect) = rect.filter(|_| area > 0) else { return };
        let edges = [Edge::new(b, c), Edge::new(c, a), Edge::new(a, b)];
        let mut row = edges.each_ref().map(|edge| edge.at(rect.left, rect.top));
        let per_area = 1.0 / area as f32;
        let nears = [a.nearness, b.nearness, c.nearness];
        let (least, most) =
            (nears.iter().copied().fold(f32::INFINITY, f32::min), nears.iter().copied().fold(0.0, f32::max));
        let step_x: [i64; 3] = edges.each_ref().map(|edge| edge.step_x);
        for y in rect.top..=rect.bottom {
            let start = (y as usize - samples.first) * samples.columns;
            let mut at = row;
            for x in rect.left..=rect.right {
                if (at[0] | at[1] | at[2]) >= 0 {
                    // the edges that lean on a sample are moved by one: no matter for depth
                    let near = (at[0] as f32 * nears[0] + at[1] as f32 * nears[1] + at[2] as f32 * nears[2]) * per_area;
                    let key = key(near.max(least).min(most), thing as u32);
                    let sample = &mut samples.keys[start + x as usize];
                    *sample = (*sample).max(key);
                }
                (0..3).for_each(|k| at[k] += step_x[k]);
            }
            (0..3).for_each(|k| row[k] += edges[k].step_y);
        }
    }

    fn look(&self, thing: usize, at: [f32; 2]) -> Look {
        let nothing = Look { normal: [0.0, 0.0, 1.0], light: self.plain, is_inside: false };
        let Some(([a, b, c], face)) = self.corners(thing).zip(self.faces.get(thing)) else { return nothing };
        let area = area2(a, b, c);
        // y goes down on the picture: what turns right there is seen from inside
        let side = if area > 0 { -1.0 } else { 1.0 };
        let own = corners_of(face, &self.views).and_then(|[a, b, c]| unit(cross(minus(b, a), minus(c, a))));
        let own = own.map_or(nothing.normal, |own| times(own, side));
        let shares = shares([a, b, c], at.map(|x| x * FRACTIONS), area as f32);
        let smooth = unit(mixed(shares, [a.normal, b.normal, c.normal])).map(|normal| times(normal, side));
        let normal = smooth.filter(|normal| dot(*normal, own) >= EDGE).unwrap_or(own);
        let lights = self.lights.as_ref().and_then(|lights| corners_of(face, lights));
        let light = lights.map_or(self.plain, |lights| mixed(shares, lights));
        Look { normal, light, is_inside: area > 0 }
    }
}

/// How much each corner counts at a place; the nearest place of the triangle if it is outside.
#[inline]
fn shares([a, b, c]: [&Corner; 3], [x, y]: [f32; 2], area: f32) -> [f32; 3] {
    let of = |from: &Corner, to: &Corner| {
        let [fx, fy] = [from.x as f32, from.y as f32];
        ((to.x as f32 - fx) * (y - fy) - (to.y as f32 - fy) * (x - fx)) / area
    };
    let shares = [of(b, c), of(c, a), of(a, b)].map(|share| share.clamp(0.0, 1.0));
    let sum: f32 = shares.iter().sum();
    if sum > 0.0 { shares.map(|share| share / sum) } else { [1.0 / 3.0; 3] }
}

#[inline]
fn mixed(shares: [f32; 3], of: [[f32; 3]; 3]) -> [f32; 3] {
    std::array::from_fn(|k| shares[0] * of[0][k] + shares[1] * of[1][k] + shares[2] * of[2][k])
}

/// The least and the greatest.
#[inline]
fn ends(a: i32, b: i32, c: i32) -> [i32; 2] {
    [a.min(b).min(c), a.max(b).max(c)]
}

/// An edge: positive on its inner side.
struct Edge {
    from: [i64; 2],
    along: [i64; 2],
    /// What a sample to the right or below adds.
    step_x: i64,
    step_y: i64,
    /// Of two triangles that share an edge, one has the samples that lie on it.
    bias: i64,
}

impl Edge {
    #[inline]
    fn new(from: &Corner, to: &Corner) -> Edge {
        let along = [i64::from(to.x - from.x), i64::from(to.y - from.y)];
        let owns = along[1] < 0 || (along[1] == 0 && along[0] > 0);
        let from = [i64::from(from.x), i64::from(from.y)];
        Edge { from, along, step_x: -along[1] * 16, step_y: along[0] * 16, bias: i64::from(!owns) }
    }

    /// At the middle of a sample.
    #[inline]
    fn at(&self, x: i32, y: i32) -> i64 {
        let [px, py] = [i64::from(x) * 16 + 8 - self.from[0], i64::from(y) * 16 + 8 - self.from[1]];
        self.along[0] * py - self.along[1] * px - self.bias
    }
}
