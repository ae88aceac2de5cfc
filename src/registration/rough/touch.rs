//! The last word on a join, at full resolution: like shapes lie near each other, only equal ones touch.

use crate::geometry::Motion;
use crate::geometry::neighbours::LocalPoint;
use crate::geometry::normals::{self, local_planes};
use crate::geometry::se3;
use crate::registration::joint::normal_equations::PairSums;
use crate::registration::quality::NEAR;
use crate::registration::view::View;

/// Points of a view that are laid on the other.
const SAMPLES: usize = 300;
/// A point has a counterpart if it lies no farther than this beside its nearest one, in spacings;
const BESIDE: f64 = 2.0;
/// it touches it if it lies no farther than this above or below.
const ON: f64 = 1.0;
/// Search distances of the steps, in spacings; the first also covers what surfels left over.
const REACHES: [f64; 5] = [8.0, 6.0, 4.0, 3.0, 3.0];

/// Of the points of view j that lie near view i's surface when laid there, the share that touches it; `None` if none
/// is near. `motion_i_j` is improved first.
pub fn touching_share(i: &View, j: &View, motion_i_j: &Motion, spacing: f64) -> Option<f64> {
    let points = j.points();
    let samples: Vec<LocalPoint> = points.iter().step_by(points.len().div_ceil(SAMPLES).max(1)).copied().collect();
    let mut motion = *motion_i_j;
    for reach in REACHES {
        let found = nearest(i, &samples, &motion, reach * spacing);
        let places: Vec<LocalPoint> = found.iter().map(|(_, target)| *target).collect();
        let planes = local_planes(&i.indexed, &places, normals::NEIGHBOURS);
        let mut sums = PairSums::default();
        let scale2 = (0.5 * reach * spacing).powi(2);
        for ((moved, target), plane) in found.iter().zip(&planes) {
            let normal = nalgebra::Vector3::from(plane.normal).cast::<f64>();
            let residual = normal.dot(&(moved - nalgebra::Vector3::from(*target).cast::<f64>()));
            let robust = scale2 / (scale2 + residual * residual);
            sums.add(&normal, moved, residual, robust * robust);
        }
        let Some(twist) = sums.step() else { break };
        motion = se3::exp(&twist) * motion;
    }
    let found = nearest(i, &samples, &motion, NEAR * spacing);
    let places: Vec<LocalPoint> = found.iter().map(|(_, target)| *target).collect();
    let planes = local_planes(&i.indexed, &places, normals::NEIGHBOURS);
    let (mut near, mut touching) = (0usize, 0usize);
    for ((moved, target), plane) in found.iter().zip(&planes) {
        let offset = moved - nalgebra::Vector3::from(*target).cast::<f64>();
        let height = nalgebra::Vector3::from(plane.normal).cast::<f64>().dot(&offset).abs();
        // a point that lies beside its nearest one lies beyond a rim: it has no counterpart
        if offset.norm_squared() - height * height < (BESIDE * spacing).powi(2) {
            near += 1;
            touching += usize::from(height < ON * spacing);
        }
    }
    (near > 0).then(|| touching as f64 / near as f64)
}

/// The moved samples that have a point of the view within `reach`, with that point.
fn nearest(
    view: &View,
    samples: &[LocalPoint],
    motion: &Motion,
    reach: f64,
) -> Vec<(nalgebra::Vector3<f64>, LocalPoint)> {
    let reach2 = (reach * reach) as f32;
    samples
        .iter()
        .filter_map(|sample| {
            let moved = motion * nalgebra::Point3::from(nalgebra::Vector3::from(*sample).cast::<f64>());
            let near = view.indexed.tree.nearest(&moved.coords.cast::<f32>().into(), reach2)?;
            Some((moved.coords, view.points()[near.index as usize]))
        })
        .collect()
}
