//! A proposal refined on the surface: a few point-to-plane steps on surfels.

use super::coarse_view::CoarseView;
use crate::least_squares::descent::descend;
use crate::least_squares::robust_kernel::RobustKernel;
use visage_geometry::Motion;

/// How far a start may be off, and how many surfels are worth their time.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Search distances of the steps, in edges.
    reaches: &'static [f64],
    /// Surfels that are moved, at most.
    samples: usize,
}

/// For a motion that two views alone propose: it may be off by some edges.
const PAIR: Effort = Effort { reaches: &[3.0, 2.5, 2.0, 1.5, 1.2, 1.0], samples: 350 };
/// For a place among several views, each of which says where it is: less is off, and more surfels find a counterpart.
const COMPONENT: Effort = Effort { reaches: &[1.5, 1.2, 1.0], samples: 150 };
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Normals farther apart don't belong to one surface.
        least_cosine: f32 = 0.6,
    }
}

/// Improves `i_from_j`, which maps view j's local frame into view i's.
pub fn align(i: &CoarseView, j: &CoarseView, i_from_j: &Motion, edge: f64) -> Motion {
    laid_on(&[(i, Motion::identity())], j, i_from_j, edge, &PAIR)
}

/// Improves `pose`, which maps view j's local frame into a world in which the `others` stand at their poses.
pub fn align_onto(others: &[(&CoarseView, Motion)], j: &CoarseView, pose: &Motion, edge: f64) -> Motion {
    laid_on(others, j, pose, edge, &COMPONENT)
}

fn laid_on(others: &[(&CoarseView, Motion)], j: &CoarseView, start: &Motion, edge: f64, effort: &Effort) -> Motion {
    let step = j.inner.len().div_ceil(effort.samples).max(1);
    // where each surfel's search in each other view ended in the last step
    let mut last = vec![u32::MAX; others.len() * j.inner.len()];
    descend(start, effort.reaches.iter().map(|reach| reach * edge), |pose, reach, sums| {
        let kernel = RobustKernel::within(reach as f32);
        for ((i, pose_i), last) in others.iter().zip(last.chunks_mut(j.inner.len().max(1))) {
            let motion = pose_i.inv_mul(pose);
            if motion.translation.vector.norm() > i.radius + j.radius + reach {
                continue;
            }
            let motion = motion.cast::<f32>();
            let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
            for (&index, last) in j.inner.iter().zip(last).step_by(step) {
                let index = index as usize;
                let moved = rotation * j.position(index) + shift;
                let nearest = i.indexed.nearest_from(&moved.into(), *last, (reach * reach) as f32);
                *last = nearest.map_or(u32::MAX, |n| n.index);
                let Some(target) = nearest.map(|n| n.index as usize) else { continue };
                let Some((normal, residual)) = residual(i, target, &moved, &(rotation * j.normals[index])) else {
                    continue;
                };
                let place = pose_i * nalgebra::Point3::from(moved.cast::<f64>());
                let weight = kernel.weight(residual).into();
                sums.add(&(pose_i * normal.cast::<f64>()), &place.coords, residual.into(), weight);
            }
        }
    })
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
    if !i.is_inner[target] || normal_j.dot(&normal_i) < TUNING.least_cosine {
        return None;
    }
    let normal = (normal_i + normal_j).normalize();
    Some((normal, normal.dot(&(moved - i.position(target)))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};

    #[test]
    fn a_start_some_edges_off_ends_on_the_surface() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let [i, j, k] = [0, 1, 2].map(|view| &fixture.coarse_views[view]);
        let start = fixture.i_from_j_off(0, 1, [1.5, -2.0, 1.0], [0.03, 0.0, -0.06]);
        let found = align(i, j, &start, EDGE);
        let (before, after) = (fixture.off(0, 1, &start), fixture.off(0, 1, &found));
        assert!(before > 0.8 * EDGE && after < 0.1 * EDGE, "{before} {after}");
        // among two views, in the frame of the first
        let others = [(i, Motion::identity()), (k, fixture.i_from_j(0, 2))];
        let start = fixture.i_from_j_off(0, 1, [0.5, 0.5, -0.5], [0.0, 0.02, 0.0]);
        let among = align_onto(&others, j, &start, EDGE);
        assert!(fixture.off(0, 1, &among) < 0.1 * EDGE, "{among}");
    }
}
