//! What one scan of a surface would see: a scan finds its model by these.

use super::area_samples::AreaSamples;
use visage_geometry::Vector3;

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
    }
}

/// Cells along an edge of the window that samples are seen in; what is beyond it is seen in its outermost cells.
const CELLS: usize = 96;

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
