//! The last word on a join, at full resolution: like shapes lie near each other, only equal ones touch.

use crate::joint::normal_equations::NormalEquations;
use crate::quality::sharpness::NEAR;
use crate::view::View;
use visage_geometry::Motion;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::normals::{self, local_planes};
use visage_geometry::se3;

/// Points of a view that are laid on the other.
const SAMPLES: usize = 300;
/// A point has a counterpart if it lies no farther than this beside its nearest one, in spacings;
const BESIDE: f64 = 2.0;
/// it touches it if it lies no farther than this above or below.
const ON: f64 = 1.0;
/// it meets it if it lies no farther than this many times the noise of both scans,
const MEETING_NOISE: f64 = 3.0;
/// but this much, in spacings, is allowed in any case.
const MEETING: f64 = 0.2;
/// Search distances of the steps, in spacings; the first also covers what surfels left over.
const REACHES: [f64; 5] = [8.0, 6.0, 4.0, 3.0, 3.0];

/// How two views lie on each other at full resolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Maps view j's local frame into view i's, improved.
    pub i_from_j: Motion,
    /// Of the points of view j that lie near view i's surface, the share that touches it.
    pub touching: f64,
    /// The share that lies as near to it as the noise of the scans lets them.
    pub meeting: f64,
    /// Root mean square distance of those that touch, in the noise of both scans.
    pub rms_noise: f64,
}

/// How view j lies on view i; `None` if none of its points is near. `i_from_j` is improved first.
pub fn contact(i: &View, j: &View, i_from_j: &Motion, spacing: f64) -> Option<Contact> {
    let points = j.points();
    let samples: Vec<LocalPoint> = points.iter().step_by(points.len().div_ceil(SAMPLES).max(1)).copied().collect();
    let mut motion = *i_from_j;
    for reach in REACHES {
        let found = nearest(i, &samples, &motion, reach * spacing);
        let places: Vec<LocalPoint> = found.iter().map(|(_, target)| *target).collect();
        let planes = local_planes(&i.indexed, &places, normals::NEIGHBOURS);
        let mut sums = NormalEquations::default();
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
    let heights = heights(i, &samples, &motion, spacing);
    let noise = i.range_accuracy.hypot(j.range_accuracy).max(f64::MIN_POSITIVE);
    let within = |limit: f64| heights.iter().filter(|height| **height < limit).count() as f64;
    let touching = within(ON * spacing);
    let squares: f64 = heights.iter().filter(|height| **height < ON * spacing).map(|height| height * height).sum();
    let near = heights.len() as f64;
    (near > 0.0).then(|| Contact {
        i_from_j: motion,
        touching: touching / near,
        meeting: within((MEETING_NOISE * noise).max(MEETING * spacing)) / near,
        rms_noise: (squares / touching.max(1.0)).sqrt() / noise,
    })
}

/// Distances from the surface of the samples that have a counterpart.
fn heights(view: &View, samples: &[LocalPoint], motion: &Motion, spacing: f64) -> Vec<f64> {
    let found = nearest(view, samples, motion, NEAR * spacing);
    let places: Vec<LocalPoint> = found.iter().map(|(_, target)| *target).collect();
    let planes = local_planes(&view.indexed, &places, normals::NEIGHBOURS);
    let height = |((moved, target), plane): (&(nalgebra::Vector3<f64>, LocalPoint), &normals::LocalPlane)| {
        let offset = moved - nalgebra::Vector3::from(*target).cast::<f64>();
        let height = nalgebra::Vector3::from(plane.normal).cast::<f64>().dot(&offset).abs();
        // a point that lies beside its nearest one lies beyond a rim: it has no counterpart
        (offset.norm_squared() - height * height < (BESIDE * spacing).powi(2)).then_some(height)
    };
    found.iter().zip(&planes).filter_map(height).collect()
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
