//! What single scans of a surface would see, each in a few bytes: a scan finds its model by these.
//!
//! Of a scan's descriptor those numbers are kept that noise and the sparse rims of scans change least: distance from the axes and
//! silhouettes, in the frame of the principal axes. Normals of scans hide more than they tell.

use super::area_samples::AreaSamples;
use super::{FRAME_BYTES, MAPS, ShapeDescriptor, spectrum};
use visage_geometry::Vector3;

/// Bytes of a view.
pub const VIEW_BYTES: usize = 3 * 2 * spectrum::NUMBERS;

/// What is kept of a view.
pub type ViewCode = [u8; VIEW_BYTES];

/// Directions that a surface is seen from: the corners of a dodecahedron, so that every other is within 21 degrees of one.
pub const VIEWS: usize = 20;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The edge of a cell that hides what is behind its nearest sample, in mean distances from the centroid: some samples each.
        cell: f64 = 0.08,
        /// How far behind the nearest one in its cell a sample may be, in the same unit: surface at a slant.
        behind: f64 = 0.16,
        /// Scanners see nothing of surface that is nearly along their sight: the least cosine.
        grazing: f64 = 0.15,
        /// With fewer samples a view tells nothing.
        least: usize = 100,
        /// What a step of a silhouette counts, in steps of the distance from the axis: scans differ in it least.
        silhouette: u8 = 2,
    }
}

/// The place of the silhouette among the maps of an axis.
const SILHOUETTE: usize = 3;
/// Cells along an edge of the window that samples are seen in; what is beyond it is seen in its outermost cells.
const CELLS: usize = 96;

/// What is kept of a view, by its bytes in the frame of the principal axes.
pub(super) fn code(frame: &[u8; FRAME_BYTES]) -> ViewCode {
    let mut code = [0; VIEW_BYTES];
    for (to, from) in code.chunks_exact_mut(2 * spectrum::NUMBERS).zip(frame.chunks_exact(MAPS * spectrum::NUMBERS)) {
        let (radius, silhouette) = to.split_at_mut(spectrum::NUMBERS);
        radius.copy_from_slice(&from[..spectrum::NUMBERS]);
        let silhouettes = &from[SILHOUETTE * spectrum::NUMBERS..][..spectrum::NUMBERS];
        silhouette.iter_mut().zip(silhouettes).for_each(|(to, from)| *to = from.saturating_mul(TUNING.silhouette));
    }
    code
}

/// How far two views are apart: 0 for the same.
pub fn view_distance(a: &ViewCode, b: &ViewCode) -> f64 {
    ShapeDescriptor::in_units(f64::from(super::squared(a, b)).sqrt())
}

/// The directions, each of unit length.
pub(super) fn directions() -> [Vector3; VIEWS] {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    std::array::from_fn(|k| {
        let sign = |bit: usize| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let corner = match k {
            0..8 => Vector3::new(sign(0), sign(1), sign(2)),
            _ => {
                let (long, short) = (sign(0) * golden, sign(1) / golden);
                match (k - 8) / 4 {
                    0 => Vector3::new(0.0, short, long),
                    1 => Vector3::new(short, long, 0.0),
                    _ => Vector3::new(long, 0.0, short),
                }
            }
        };
        corner.normalize()
    })
}

/// The samples that are seen from afar in a direction; `None` if there are too few.
pub(super) fn seen_from(samples: &AreaSamples, direction: &Vector3) -> Option<AreaSamples> {
    let across = direction.cross(&Vector3::ith(direction.iamin(), 1.0)).normalize();
    let up = direction.cross(&across);
    let cell = |along: f64| (along / TUNING.cell + 0.5 * CELLS as f64).clamp(0.0, CELLS as f64 - 1.0) as usize;
    let place = |p: &Vector3| CELLS * cell(p.dot(&up)) + cell(p.dot(&across));
    let mut nearest = vec![f64::NEG_INFINITY; CELLS * CELLS];
    for point in &samples.points {
        let slot = &mut nearest[place(point)];
        *slot = slot.max(point.dot(direction));
    }
    let is_seen = |point: &Vector3, normal: &Vector3| {
        normal.dot(direction).abs() > TUNING.grazing && point.dot(direction) > nearest[place(point)] - TUNING.behind
    };
    let seen = samples.points.iter().zip(&samples.normals).filter(|(point, normal)| is_seen(point, normal));
    let (points, normals): (Vec<Vector3>, Vec<Vector3>) = seen.unzip();
    if points.len() < TUNING.least { None } else { AreaSamples::of_part(points, normals) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::curvature::tests::sphere;

    #[test]
    fn directions_are_spread_evenly() {
        let directions = directions();
        let nearest = |d: &Vector3| directions.iter().filter(|o| *o != d).map(|o| d.dot(o)).fold(-1.0, f64::max);
        assert!(directions.iter().all(|d| (nearest(d) - 5f64.sqrt() / 3.0).abs() < 1e-9));
    }

    #[test]
    fn of_a_ball_the_near_half_is_seen() {
        let samples = AreaSamples::of_mesh(&sphere(3.0, 4), 20_000).expect("it has an area");
        let seen = seen_from(&samples, &Vector3::z()).expect("it is large");
        let share = seen.points.len() as f64 / 20_000.0;
        // all but the rim, of which a little more is hidden by what is before it in its cell
        let seen = 0.5 * (1.0 - TUNING.grazing);
        assert!((seen - 0.05..=seen).contains(&share), "{share}");
    }

    #[test]
    fn what_tells_nothing_is_no_view() {
        let samples = AreaSamples::of_mesh(&sphere(3.0, 2), 90).expect("it has an area");
        assert!(seen_from(&samples, &Vector3::z()).is_none());
    }
}
