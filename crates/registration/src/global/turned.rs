//! An axis with the angles of all views about it, drawn onto the surfaces.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::axis::{Axis, FREE};
use crate::least_squares::robust_kernel::RobustKernel;
use crate::sensor::turning::Turning;
use visage_geometry::{Motion, Point3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Search distances of the steps of the refinement, in spacings.
        reaches: [f64; 9] = [7.5, 6.0, 5.0, 4.0, 3.2, 2.5, 2.5, 2.5, 2.5],
        /// Points of all views in each other that take part in it, about,
        refined_samples: usize = 18_000,
        /// and of a view in another, at least and at most.
        view_samples: [usize; 2] = [40, 300],
        /// Normals farther apart than this cosine don't belong to one surface.
        least_cosine: f64 = 0.6,
    }
}

/// An axis and for each view how far the thing was turned about it.
#[derive(Debug, Clone)]
pub(super) struct Turned {
    /// The axis, in the world of what stands still.
    pub axis: Axis,
    /// For each view its angle, rad.
    pub angles: Vec<f64>,
    /// What speaks for it.
    pub score: f64,
}

impl Turned {
    /// Poses of the local frames with the thing at rest.
    pub fn local_poses(&self, turning: &Turning) -> Vec<Motion> {
        let views = self.angles.iter().zip(&turning.world_from_local);
        views.map(|(angle, world_from_local)| self.axis.turn(-angle) * world_from_local).collect()
    }
}

/// Axis and angles drawn onto the surfaces together, by Gauss-Newton steps on the distances along both normals.
pub(super) fn refined(turning: &Turning, start: &Turned) -> Turned {
    let n = turning.views.len();
    let mut turned = start.clone();
    for reach in TUNING.reaches.map(|reach| reach * turning.spacing) {
        let blocks: Vec<(DMatrix<f64>, DVector<f64>)> =
            (0..n).into_par_iter().with_max_len(1).map(|i| sums_onto(turning, &turned, i, reach)).collect();
        let unknowns = n + FREE;
        let (mut information, mut gradient) =
            (DMatrix::<f64>::zeros(unknowns, unknowns), DVector::<f64>::zeros(unknowns));
        for (block, right) in blocks {
            information += block;
            gradient += right;
        }
        // all angles together turn the whole, which changes nothing: the damping keeps them
        for k in 0..unknowns {
            information[(k, k)] += 1e-6 * information[(k, k)] + f64::MIN_POSITIVE;
        }
        let Some(step) = information.cholesky().map(|factor| factor.solve(&gradient)) else { break };
        turned.angles.iter_mut().zip(step.iter()).for_each(|(angle, change)| *angle -= change);
        turned.axis = turned.axis.changed(&[0, 1, 2, 3].map(|k| -step[n + k]));
    }
    turned
}

/// The normal equations of all other views' points on view i: of the angles, then of the axis.
fn sums_onto(turning: &Turning, turned: &Turned, i: usize, reach: f64) -> (DMatrix<f64>, DVector<f64>) {
    let n = turning.views.len();
    let (mut information, mut gradient) = (DMatrix::<f64>::zeros(n + FREE, n + FREE), DVector::<f64>::zeros(n + FREE));
    let kernel = RobustKernel::within(reach);
    let target = &turning.views[i];
    let [least, most] = TUNING.view_samples;
    let samples = (TUNING.refined_samples / (n * n)).clamp(least, most);
    let small = [1e-4 * turning.reach, 1e-4 * turning.reach, 1e-4, 1e-4];
    for j in (0..n).filter(|j| *j != i) {
        let angle = turned.angles[i] - turned.angles[j];
        let motion = turned.axis.turn(angle);
        let changed = |k: usize| {
            let mut by = [0.0; FREE];
            by[k] = small[k];
            turned.axis.changed(&by).turn(angle)
        };
        let changed = [0, 1, 2, 3].map(changed);
        let view = &turning.views[j];
        let step = view.indexed.points.len().div_ceil(samples).max(1);
        for (point, normal) in view.indexed.points.iter().zip(&view.normals).step_by(step) {
            let point: Point3 = nalgebra::Point3::from(*point).cast::<f64>();
            let place = motion * point;
            let near = target.indexed.tree.nearest(&place.coords.cast::<f32>().into(), (reach * reach) as f32);
            let Some(met) = near.map(|near| near.index as usize) else { continue };
            let (normal, other) = (motion.rotation * normal.cast::<f64>(), target.normals[met].cast::<f64>());
            if normal.dot(&other) < TUNING.least_cosine {
                continue;
            }
            let mean = (normal + other).normalize();
            let residual =
                mean.dot(&(place.coords - nalgebra::Vector3::from(target.indexed.points[met]).cast::<f64>()));
            let weight = kernel.weight(residual);
            let by_angle = mean.dot(&turned.axis.direction.cross(&(place.coords - turned.axis.point)));
            let by_axis = [0, 1, 2, 3].map(|k| mean.dot(&((changed[k] * point - place) / small[k])));
            let entries = [(i, by_angle), (j, -by_angle)];
            let entries: Vec<(usize, f64)> =
                entries.into_iter().chain(by_axis.into_iter().enumerate().map(|(k, by)| (n + k, by))).collect();
            for (row, a) in &entries {
                gradient[*row] += weight * a * residual;
                for (column, b) in &entries {
                    information[(*row, *column)] += weight * a * b;
                }
            }
        }
    }
    (information, gradient)
}
