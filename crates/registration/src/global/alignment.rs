//! A proposal refined on the surface: a few point-to-plane steps on surfels.

use super::coarse_view::CoarseView;
use crate::joint::normal_equations::{NormalEquations, RIGID};
use visage_geometry::{Motion, se3};

/// Search distances of the steps, in edges.
const REACHES: [f64; 6] = [3.0, 2.5, 2.0, 1.5, 1.2, 1.0];
/// Surfels that are moved, at most.
const SAMPLES: usize = 350;
/// Normals farther apart don't belong to one surface.
const LEAST_COSINE: f32 = 0.6;

/// Improves `i_from_j`, which maps view j's local frame into view i's.
pub fn align(i: &CoarseView, j: &CoarseView, i_from_j: &Motion, edge: f64) -> Motion {
    let step = j.inner.len().div_ceil(SAMPLES).max(1);
    let mut motion = *i_from_j;
    let mut last = vec![u32::MAX; j.inner.len()];
    for reach in REACHES {
        let reach = reach * edge;
        let moved_by = motion.cast::<f32>();
        let (rotation, shift) = (moved_by.rotation.to_rotation_matrix(), moved_by.translation.vector);
        let scale2 = (0.5 * reach as f32).powi(2);
        let mut sums = NormalEquations::<RIGID>::default();
        for (k, &index) in j.inner.iter().enumerate().step_by(step) {
            let index = index as usize;
            let moved = rotation * j.position(index) + shift;
            let nearest = i.indexed.nearest_from(&moved.into(), last[k], (reach * reach) as f32);
            last[k] = nearest.map_or(u32::MAX, |n| n.index);
            let Some(target) = nearest.map(|n| n.index as usize) else { continue };
            let Some((normal, residual)) = residual(i, target, &moved, &(rotation * j.normals[index])) else {
                continue;
            };
            sums.add(&normal.cast(), &moved.cast(), residual.into(), weight(residual, scale2));
        }
        let Some(twist) = sums.step() else { break };
        motion = se3::exp(&twist) * motion;
    }
    motion
}

/// Search distances of the steps onto a whole component, in edges.
const COMPONENT_REACHES: [f64; 3] = [1.5, 1.2, 1.0];
/// Surfels that are moved onto a component, at most.
const COMPONENT_SAMPLES: usize = 150;

/// Improves `pose`, which maps view j's local frame into a world in which the `others` stand at their poses.
pub fn align_onto(others: &[(&CoarseView, Motion)], j: &CoarseView, pose: &Motion, edge: f64) -> Motion {
    let step = j.inner.len().div_ceil(COMPONENT_SAMPLES).max(1);
    let mut pose = *pose;
    for reach in COMPONENT_REACHES.map(|reach| reach * edge) {
        let scale2 = (0.5 * reach as f32).powi(2);
        let mut sums = NormalEquations::<RIGID>::default();
        for (i, pose_i) in others {
            let motion = pose_i.inv_mul(&pose);
            if motion.translation.vector.norm() > i.radius + j.radius {
                continue;
            }
            let motion = motion.cast::<f32>();
            let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
            for index in j.inner.iter().step_by(step).map(|index| *index as usize) {
                let moved = rotation * j.position(index) + shift;
                let nearest = i.indexed.tree.nearest(&moved.into(), (reach * reach) as f32);
                let Some(target) = nearest.map(|n| n.index as usize) else { continue };
                let Some((normal, residual)) = residual(i, target, &moved, &(rotation * j.normals[index])) else {
                    continue;
                };
                let place = pose_i * nalgebra::Point3::from(moved.cast::<f64>());
                sums.add(&(pose_i * normal.cast::<f64>()), &place.coords, residual.into(), weight(residual, scale2));
            }
        }
        let Some(twist) = sums.step() else { break };
        pose = se3::exp(&twist) * pose;
    }
    pose
}

/// The mean normal of a moved surfel and the `target` that it is nearest to, and their distance along it; `None` on rims, and if
/// the normals don't agree.
fn residual(
    i: &CoarseView,
    target: usize,
    moved: &nalgebra::Vector3<f32>,
    normal_j: &nalgebra::Vector3<f32>,
) -> Option<(nalgebra::Vector3<f32>, f32)> {
    let normal_i = i.normals[target];
    if !i.is_inner[target] || normal_j.dot(&normal_i) < LEAST_COSINE {
        return None;
    }
    let normal = (normal_i + normal_j).normalize();
    Some((normal, normal.dot(&(moved - i.position(target)))))
}

/// Weight of a residual by Geman and McClure's kernel; `scale2` is the square of its scale.
fn weight(residual: f32, scale2: f32) -> f64 {
    let robust = scale2 / (scale2 + residual * residual);
    f64::from(robust * robust)
}
