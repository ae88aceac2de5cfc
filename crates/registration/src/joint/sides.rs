//! From which side each view's surface was seen, read off the scans where nobody told.
//!
//! The axis is found by how densely points lie on the surface. A range scan looks the same from behind, but between it and
//! its scanner there was nothing: the rest of the object lies behind it.

use rayon::prelude::*;

use super::surfels::Surfels;
use crate::sensor::Sensor;
use visage_geometry::Motion;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Cells of a picture along an edge, at most.
        largest: usize = 48,
        /// How far before or behind a sheet something must lie, in edges, since starting poses are rough.
        apart: f32 = 1.0,
        /// Other views that are asked, at most.
        asked: usize = 32,
        /// The rest of the object is seen if so many times the sheet's surfels lie on one side of it,
        least: f64 = 0.1,
        /// and no more than this share of that on the other.
        other_side: f64 = 0.4,
        /// Seen more from the side than this cosine, the axis is too rough to tell.
        grazing: f64 = 0.25,
    }
}

type Vector = nalgebra::Vector3<f32>;

/// Turns the normals of views without sides towards the scanner, as far as that is clear; `few` are surfels of voxels of
/// `edge`, `all` the sets of surfels to turn. A view where it is not clear stays as it is.
pub fn find_sides(few: &[Surfels], edge: f64, poses: &[Motion], all: &mut [&mut [Surfels]]) {
    let asked: Vec<usize> = (0..few.len()).step_by(few.len().div_ceil(TUNING.asked)).collect();
    let sides: Vec<Option<Sensor>> = (0..few.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|view| (!few[view].has_side()).then(|| seen_from(few, edge as f32, poses, view, &asked)).flatten())
        .collect();
    for surfels in all {
        for (surfels, side) in surfels.iter_mut().zip(&sides) {
            if let Some(side) = side {
                surfels.turn_towards(side, TUNING.grazing);
            }
        }
    }
}

/// The side from which a view was seen; `None` if that is not clear.
fn seen_from(few: &[Surfels], edge: f32, poses: &[Motion], view: usize, asked: &[usize]) -> Option<Sensor> {
    let points = &few[view].indexed.points;
    let axis = few[view].viewing_axis();
    let all: Vec<Vector> = points.iter().map(|p| Vector::from(*p)).collect();
    let picture = Picture::new(&all, &axis, 1.5 * edge);
    let (mut before, mut behind) = (0, 0);
    for other in asked.iter().filter(|other| **other != view) {
        let motion = poses[view].inv_mul(&poses[*other]).cast::<f32>();
        for point in &few[*other].indexed.points {
            let Some((low, high, depth)) = picture.at(&(motion * nalgebra::Point3::from(*point)).coords) else {
                continue;
            };
            before += usize::from(depth > high + TUNING.apart * edge);
            behind += usize::from(depth < low - TUNING.apart * edge);
        }
    }
    let (more, less) = (before.max(behind) as f64, before.min(behind) as f64);
    let is_clear = more >= TUNING.least * points.len() as f64 && less <= TUNING.other_side * more;
    let axis = axis.cast::<f64>();
    is_clear.then_some(Sensor::Toward(if before > behind { -axis } else { axis }))
}

/// Two unit vectors square to `axis` and to each other.
fn square_to(axis: &Vector) -> (Vector, Vector) {
    let across = axis.cross(&Vector::ith(axis.iamin(), 1.0)).normalize();
    (across, axis.cross(&across))
}

/// The least and largest depth along an axis in each cell across it.
struct Picture {
    axes: [Vector; 3],
    corner: [f32; 2],
    inverse: f32,
    cells: [usize; 2],
    depths: Vec<(f32, f32)>,
    counts: Vec<u32>,
}

impl Picture {
    fn new(points: &[Vector], axis: &Vector, cell: f32) -> Self {
        let (across, upward) = square_to(axis);
        let axes = [across, upward, *axis];
        let ends = [0, 1].map(|k| {
            points.iter().map(|p| p.dot(&axes[k])).fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)))
        });
        let widest = ends.iter().map(|(low, high)| high - low).fold(0.0, f32::max);
        let inverse = 1.0 / cell.max(widest / (TUNING.largest - 1) as f32).max(f32::MIN_POSITIVE);
        let cells = ends.map(|(low, high)| (((high - low) * inverse) as usize + 1).min(TUNING.largest));
        let count = cells[0] * cells[1];
        let depths = vec![(f32::MAX, f32::MIN); count];
        let mut picture =
            Picture { axes, corner: ends.map(|(low, _)| low), inverse, cells, depths, counts: vec![0; count] };
        for point in points {
            if let Some((place, depth)) = picture.project(point) {
                let (low, high) = &mut picture.depths[place];
                (*low, *high) = (low.min(depth), high.max(depth));
                picture.counts[place] += 1;
            }
        }
        picture
    }

    fn project(&self, point: &Vector) -> Option<(usize, f32)> {
        let [x, y] = [0, 1].map(|k| ((point.dot(&self.axes[k]) - self.corner[k]) * self.inverse).floor());
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.cells[0] as f32 && y < self.cells[1] as f32;
        is_inside.then(|| (x as usize + self.cells[0] * y as usize, point.dot(&self.axes[2])))
    }

    /// The depths seen where a point is, and its own; `None` where nothing was seen.
    fn at(&self, point: &Vector) -> Option<(f32, f32, f32)> {
        let (place, depth) = self.project(point)?;
        let (low, high) = self.depths[place];
        (self.counts[place] > 0).then_some((low, high, depth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::View;
    use visage_geometry::{Cloud, Point3};

    /// The part of a ball of 50 mm that is seen from `toward`.
    fn cap(toward: f64) -> View {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let points = (0..6000).map(|k| {
            let z = 1.0 - (f64::from(k) + 0.5) / 3000.0;
            let (sine, cosine) = (golden * f64::from(k)).sin_cos();
            Point3::new((1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z) * 50.0
        });
        View::new(&Cloud::from_points(points.filter(|p| p.z * toward > 5.0).collect())).expect("a sound scan")
    }

    fn sided(views: &[View]) -> Vec<Surfels> {
        let mut surfels: Vec<Surfels> = views.iter().map(|view| Surfels::new(view, 5.0)).collect();
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        let seen = surfels.clone();
        find_sides(&seen, 5.0, &poses, &mut [&mut surfels]);
        surfels
    }

    #[test]
    fn halves_of_a_ball_were_seen_from_outside() {
        for (surfels, toward) in sided(&[cap(1.0), cap(-1.0)]).iter().zip([1.0, -1.0]) {
            let is_sided = surfels.is_sided.iter().filter(|is_sided| **is_sided).count();
            assert!(is_sided > surfels.is_sided.len() / 2, "{is_sided}");
            let is_right = |(normal, is_sided): (&[f32; 3], &bool)| !is_sided || normal[2] * toward > 0.0;
            assert!(surfels.normals.iter().zip(&surfels.is_sided).all(is_right));
        }
    }

    #[test]
    fn a_sheet_alone_has_no_side() {
        assert!(sided(&[cap(1.0), cap(1.0)]).iter().all(|surfels| !surfels.is_sided.contains(&true)));
    }
}
