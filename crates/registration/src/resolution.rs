//! What registered scans can resolve: lengths below are noise, and say nothing for or against a pose.
//!
//! Laser scans are limited by their spacing. Depth cameras sample far more finely than they measure: their surfaces warp,
//! step and tremble by many spacings, and still lie where they belong. How much so shows where the views that fit best
//! lie on each other.

use rayon::prelude::*;

use crate::joint::surfels::Surfels;
use crate::outcome::Outcome;
use crate::view::View;
use crate::view::common_spacing;
use visage_geometry::Motion;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels of a pair whose distances are measured.
        samples: usize = 150,
        /// Fewer counterparts say nothing.
        least: usize = 20,
        /// Normals farther apart than this cosine don't belong to one surface.
        like: f32 = 0.8,
        /// The quantile of the pairs whose distances are taken: most may be wrong.
        best: f64 = 0.25,
        /// Median distances as standard deviations.
        normal: f64 = 1.4826,
    }
}

/// Surfaces that are the same lie within so many standard deviations.
pub const WITHIN: f64 = 1.5;

/// What the views resolve at the poses of `result`: their spacing, or what their best pairs lie apart if that is more.
pub fn resolution(views: &[View], result: &Outcome) -> f64 {
    let spacing = common_spacing(views);
    let Some(surfels) = &result.surfels else { return spacing };
    let mut apart: Vec<f64> = result
        .pairs
        .par_iter()
        .filter(|pair| result.placed[pair.i] && result.placed[pair.j])
        .filter_map(|pair| {
            let motion = result.local_poses[pair.i].inv_mul(&result.local_poses[pair.j]);
            let apart = apart(&surfels.views[pair.i], &surfels.views[pair.j], &motion, surfels.reach)?;
            Some(apart.hypot(views[pair.i].range_accuracy).hypot(views[pair.j].range_accuracy))
        })
        .collect();
    apart.sort_unstable_by(f64::total_cmp);
    let noise = apart.get((TUNING.best * apart.len() as f64) as usize).copied().unwrap_or(0.0);
    spacing.max(WITHIN * noise)
}

/// How far apart the surfels of two views lie along their normals, as a standard deviation.
fn apart(i: &Surfels, j: &Surfels, i_from_j: &Motion, reach: f64) -> Option<f64> {
    let motion = i_from_j.cast::<f32>();
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    let vector = |v: [f32; 3]| nalgebra::Vector3::from(v);
    let step = j.inner.len().div_ceil(TUNING.samples).max(1);
    let mut heights: Vec<f32> = j
        .inner
        .iter()
        .step_by(step)
        .filter_map(|&index| {
            let moved = rotation * vector(j.indexed.points[index as usize]) + shift;
            let target = i.indexed.tree.nearest(&moved.into(), (reach * reach) as f32)?.index as usize;
            let (normal_i, normal_j) = (vector(i.normals[target]), rotation * vector(j.normals[index as usize]));
            let cosine = normal_i.dot(&normal_j);
            let is_counterpart = i.is_inner[target] && cosine.abs() > TUNING.like;
            let mean = (normal_i + normal_j * cosine.signum()).normalize();
            is_counterpart.then(|| mean.dot(&(moved - vector(i.indexed.points[target]))).abs())
        })
        .collect();
    if heights.len() < TUNING.least {
        return None;
    }
    let middle = heights.len() / 2;
    Some(TUNING.normal * f64::from(*heights.select_nth_unstable_by(middle, f32::total_cmp).1))
}
