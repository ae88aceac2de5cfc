//! Poses of a probe scored on the surface of a model, and the best of them laid onto it.

use nalgebra::SMatrix;
use rayon::prelude::*;

use super::pose::Pose;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::{Motion, Point3, Vector3, se3};
use visage_registration::least_squares::normal_equations::{NormalEquations, RIGID, SCALED};
use visage_registration::least_squares::pose_system::DAMPING;
use visage_registration::least_squares::robust_kernel::RobustKernel;
use visage_shape::descriptor::SampledShape;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Samples of the probe by which hypotheses are scored,
        scored: usize = 150,
        /// and by which the best are laid onto the surface, at first and at last.
        laid: usize = 400,
        settled: usize = 2000,
        /// How far a sample may be from the surface to say how far, in mean distances of the model from its centroid.
        reach: f64 = 0.25,
        /// Hypotheses that are laid onto the surface, and those of them that are laid at last.
        best: usize = 12,
        finalists: usize = 3,
        /// Search distances of the steps, in the same unit: at first, and at last.
        first: [f64; 10] = [0.4, 0.3, 0.25, 0.2, 0.17, 0.14, 0.12, 0.1, 0.09, 0.08],
        last: [f64; 14] = [0.1, 0.08, 0.07, 0.06, 0.05, 0.05, 0.05, 0.04, 0.04, 0.04, 0.03, 0.03, 0.03, 0.03],
        /// The least cosine of normals that belong together, of either side.
        facing: f64 = 0.5,
        /// One step changes the scale by this factor at most.
        scaling: f64 = 1.2,
        /// Poses within this of each other, in the same unit, are one.
        same: f64 = 0.02,
    }
}

/// What a probe is laid onto: a model's samples in units of its mean distance about its centroid.
pub struct Ground {
    indexed: IndexedPoints,
    normals: Vec<Vector3>,
    center: Point3,
    unit: f64,
}

/// A pose and how far the probe's samples are from the surface under it: a root mean square, as far as they are within reach.
pub type Scored = (f64, Pose);

impl Ground {
    pub fn new(model: &SampledShape) -> Ground {
        let (center, unit) = (model.whole[0].center, model.whole[0].size);
        let local = |p: &Point3| -> LocalPoint { ((p - center) / unit).cast::<f32>().into() };
        let points = model.points.iter().map(local).collect();
        Ground { indexed: IndexedPoints::new(points), normals: model.normals.clone(), center, unit }
    }

    /// The best of the hypotheses, laid onto the surface, best first. The scale stays if it `is_rigid`.
    pub fn laid(&self, probe: &SampledShape, hypotheses: Vec<Pose>, is_rigid: bool) -> Vec<Scored> {
        let few = spread(probe, TUNING.scored);
        let mut scored: Vec<Scored> =
            hypotheses.into_par_iter().map(|pose| (self.distance(&few, &pose), pose)).collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored.truncate(TUNING.best);
        let more = spread(probe, TUNING.laid);
        let laid = |(_, pose): Scored| {
            let pose = self.descended(&more, pose, &TUNING.first, is_rigid);
            (self.distance(&more, &pose), pose)
        };
        let finalists = distinct(scored.into_par_iter().map(laid).collect(), probe, TUNING.same * self.unit);
        let all = spread(probe, TUNING.settled);
        let settled = |(_, pose): Scored| {
            let pose = self.descended(&all, pose, &TUNING.last, is_rigid);
            (self.distance(&all, &pose), pose)
        };
        let mut settled: Vec<Scored> = finalists.into_par_iter().take(TUNING.finalists).map(settled).collect();
        settled.sort_by(|a, b| a.0.total_cmp(&b.0));
        settled
    }

    /// A pose laid onto the surface with this scale.
    pub fn laid_with_scale(&self, probe: &SampledShape, pose: &Pose, scale: f64) -> Pose {
        let center = probe.whole[0].center;
        let place = pose.point(&center);
        let rescaled = Pose { scale, ..*pose };
        let shift = place - rescaled.point(&center);
        let motion = Motion::from_parts((pose.motion.translation.vector + shift).into(), pose.motion.rotation);
        self.descended(&spread(probe, TUNING.settled), Pose { motion, ..rescaled }, &TUNING.last, true)
    }

    fn local(&self, p: &Point3) -> Point3 {
        Point3::from((p - self.center) / self.unit)
    }

    fn distance(&self, samples: &[(Point3, Vector3)], pose: &Pose) -> f64 {
        let reach2 = TUNING.reach * TUNING.reach;
        let square = |(p, _): &(Point3, Vector3)| {
            let query: LocalPoint = self.local(&pose.point(p)).coords.cast::<f32>().into();
            self.indexed.tree.nearest(&query, reach2 as f32).map_or(reach2, |found| f64::from(found.distance2))
        };
        (samples.iter().map(square).sum::<f64>() / samples.len().max(1) as f64).sqrt()
    }

    /// Gauss-Newton steps onto the planes of the nearest samples, as far as normals agree.
    fn descended(&self, samples: &[(Point3, Vector3)], start: Pose, reaches: &[f64], is_rigid: bool) -> Pose {
        let mut pose = start;
        for reach in reaches {
            let kernel = RobustKernel::within(*reach);
            let (mut rigid, mut scaled) = (NormalEquations::<RIGID>::default(), NormalEquations::<SCALED>::default());
            for (p, n) in samples {
                let place = self.local(&pose.point(p));
                let query: LocalPoint = place.coords.cast::<f32>().into();
                let Some(found) = self.indexed.tree.nearest(&query, (reach * reach) as f32) else { continue };
                let normal = self.normals[found.index as usize];
                if pose.direction(n).dot(&normal).abs() < TUNING.facing {
                    continue;
                }
                let nearest = nalgebra::Vector3::from(self.indexed.points[found.index as usize]).cast::<f64>();
                let residual = normal.dot(&(place.coords - nearest));
                if is_rigid {
                    rigid.add(&normal, &place.coords, residual, kernel.weight(residual));
                } else {
                    scaled.add(&normal, &place.coords, residual, kernel.weight(residual));
                }
            }
            let step = if is_rigid { rigid.step().map(|twist| (twist, 0.0)) } else { scaled_step(scaled) };
            let Some((twist, growth)) = step else { break };
            pose = self.stepped(&pose, &twist, growth);
        }
        pose
    }

    /// A pose after a twist, and a growth about the centroid of the model.
    fn stepped(&self, pose: &Pose, twist: &se3::Twist, growth: f64) -> Pose {
        let factor = growth.exp().clamp(1.0 / TUNING.scaling, TUNING.scaling);
        let step = se3::exp(twist);
        // in the ground's frame the probe's origin lies at:
        let origin = self.local(&Point3::from(pose.motion.translation.vector));
        let moved = step * Point3::from(origin.coords * factor);
        let translation = self.center + moved.coords * self.unit;
        let motion = Motion::from_parts(translation.coords.into(), step.rotation * pose.motion.rotation);
        Pose { motion, scale: pose.scale * factor, ..*pose }
    }
}

/// The twist and the logarithm of the factor, about the origin, that bring a probe onto its ground; `None` if nothing holds them.
fn scaled_step(sums: NormalEquations<SCALED>) -> Option<(se3::Twist, f64)> {
    let block = sums.into_world(&Motion::identity(), 1.0);
    let damping = SMatrix::from_diagonal_element(DAMPING * block.information.trace() / SCALED as f64);
    let step = -(block.information + damping).cholesky()?.solve(&block.gradient);
    let is_sound = step.iter().all(|x| x.is_finite());
    is_sound.then(|| (step.fixed_rows::<RIGID>(0).into_owned(), step[SCALED - 1]))
}

/// Some samples of a probe, spread over it.
fn spread(probe: &SampledShape, count: usize) -> Vec<(Point3, Vector3)> {
    let step = (probe.points.len() / count.max(1)).max(1);
    let samples = probe.points.iter().copied().zip(probe.normals.iter().copied());
    samples.skip(step / 2).step_by(step).collect()
}

/// The poses, best first, without those that say the same as a better one.
fn distinct(mut scored: Vec<Scored>, probe: &SampledShape, same: f64) -> Vec<Scored> {
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<Point3> = spread(probe, 8).into_iter().map(|(p, _)| p).collect();
    let mut kept: Vec<Scored> = Vec::new();
    for (score, pose) in scored {
        let is_near = |other: &Pose| places.iter().all(|p| (pose.point(p) - other.point(p)).norm() < same);
        if !kept.iter().any(|(_, other)| is_near(other)) {
            kept.push((score, pose));
        }
    }
    kept
}
