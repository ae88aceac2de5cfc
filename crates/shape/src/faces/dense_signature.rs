//! The dense signature: who is it? The height of the face over the plain standard, point by point.

use super::dense_fit::Placement;
use super::modes::Weights;
use super::similarity::Similarity;
use super::target::Target;
use super::template::{Shaped, TEMPLATE_POINTS, Template};
use visage_geometry::{Point3, Vector3};

/// Heights in steps of 0.1 mm on the standard, at the template's points; [`UNSEEN`] where there is no surface.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DenseSignature([i8; TEMPLATE_POINTS]);

/// Stands for a point where the model has no surface.
pub const UNSEEN: i8 = i8::MIN;
/// The height that 1 stands for, mm on the standard.
pub const STEP_MM: f64 = 0.1;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surface farther than this from the standard's is not the face's, mm on the standard.
        most_height_mm: f64 = 12.0,
        /// A point's height is the mean over the samples this near to its normal, mm on the standard.
        footprint_mm: f64 = 4.0,
        /// How often the plain standard is laid anew at most: a face must come to lie at the same place wherever its fit
        /// ended.
        settling_rounds: usize = 20,
        /// A step shorter than this, mm on the standard, is the last.
        settled_mm: f64 = 0.03,
        /// It stays where it is rather than grow more than this in all, or lose half of what it lay on: there is no face, or too
        /// little of one.
        most_growth: f64 = 1.3,
        /// Heights beyond this are hair, holes or what else stands on the face, mm on the standard. A face itself differs from
        /// the standard by up to 6 mm: with 4 here, two looks at one head could settle at different places.
        ordinary_mm: f64 = 8.0,
        /// Turns and growth are counted at this distance, mm on the standard: about half of the face.
        lever_mm: f64 = 40.0,
    }
}

/// Two signatures are compared with at least this share of the points seen by both.
pub const LEAST_COMMON: f64 = 0.4;
/// The greatest differences, which hair and holes make, are left out.
pub const KEPT_SHARE: f64 = 0.9;

impl DenseSignature {
    /// The signature of the face at `placement`.
    ///
    /// Heights are measured from the plain standard, laid as well as turn, place and size allow onto the standard as
    /// it was fitted, then onto the surface: what the fit deformed is part of what tells faces apart, where it happened
    /// to end is not.
    pub fn new(target: &Target, template: &Template, placement: &Placement) -> DenseSignature {
        let plain = template.shaped(&Weights::zeros(), TEMPLATE_POINTS);
        let fitted = template.shaped(&placement.weights, TEMPLATE_POINTS);
        let posed: Vec<Point3> = fitted.points.iter().map(|p| placement.pose.point(p)).collect();
        let heights = settled_heights(target, &plain, Similarity::of_points(&plain.points, &posed));
        let seen = heights.iter().flatten();
        let mean = seen.clone().sum::<f64>() / seen.count().max(1) as f64;
        let step =
            |height: &Option<f64>| height.map_or(UNSEEN, |h| ((h - mean) / STEP_MM).round().clamp(-127.0, 127.0) as i8);
        let mut steps = [UNSEEN; TEMPLATE_POINTS];
        for (slot, height) in steps.iter_mut().zip(&heights) {
            *slot = step(height);
        }
        DenseSignature(steps)
    }

    /// Its bytes, one a point.
    pub fn to_bytes(&self) -> [u8; TEMPLATE_POINTS] {
        self.0.map(|step| step as u8)
    }

    /// The inverse of [`DenseSignature::to_bytes`].
    pub fn from_bytes(bytes: [u8; TEMPLATE_POINTS]) -> DenseSignature {
        DenseSignature(bytes.map(|byte| byte as i8))
    }

    /// How much two faces differ: root mean square of the differences that are not among the greatest tenth, mm on the
    /// standard, their mean removed; `None` if too few points are seen on both.
    pub fn distance_mm(&self, other: &DenseSignature) -> Option<f64> {
        let pairs = self.0.iter().zip(&other.0).filter(|(a, b)| **a != UNSEEN && **b != UNSEEN);
        let mut differences: Vec<i32> = pairs.map(|(a, b)| i32::from(*a) - i32::from(*b)).collect();
        if (differences.len() as f64) < LEAST_COMMON * TEMPLATE_POINTS as f64 {
            return None;
        }
        let mean = f64::from(differences.iter().sum::<i32>()) / differences.len() as f64;
        differences.sort_by(|a, b| (f64::from(*a) - mean).abs().total_cmp(&(f64::from(*b) - mean).abs()));
        differences.truncate((KEPT_SHARE * differences.len() as f64).ceil() as usize);
        let squares: f64 = differences.iter().map(|d| (f64::from(*d) - mean).powi(2)).sum();
        Some(STEP_MM * (squares / differences.len() as f64).sqrt())
    }
}

/// How high the surface stands over each point of the plain standard, laid so that the heights are least.
fn settled_heights(target: &Target, plain: &Shaped, mut pose: Similarity) -> Vec<Option<f64>> {
    let seen = |heights: &[Option<f64>]| heights.iter().flatten().count();
    let sizes = pose.scale / TUNING.most_growth..=pose.scale * TUNING.most_growth;
    let mut heights = heights_over(target, plain, &pose);
    for _ in 0..TUNING.settling_rounds {
        let Some(step) = settling_step(plain, &heights) else { break };
        pose = step.applied_to(&pose);
        // asked first: what shrinks to less than nothing can't be laid anywhere
        if !sizes.contains(&pose.scale) {
            break;
        }
        let next = heights_over(target, plain, &pose);
        if 2 * seen(&next) < seen(&heights) {
            break;
        }
        heights = next;
        if step.unknowns.norm() < TUNING.settled_mm {
            break;
        }
    }
    heights
}

/// How high the surface stands over each point.
fn heights_over(target: &Target, plain: &Shaped, pose: &Similarity) -> Vec<Option<f64>> {
    plain.points.iter().zip(&plain.normals).map(|(p, n)| height(target, pose, p, n)).collect()
}

/// How the plain standard is to be moved about its centre: turn, shift and growth, each as what it moves at
/// `TUNING.lever_mm`, mm on the standard.
struct Step {
    center: Point3,
    unknowns: nalgebra::SVector<f64, 7>,
}

impl Step {
    fn applied_to(&self, pose: &Similarity) -> Similarity {
        let rotation = pose.motion.rotation;
        let turn = rotation * self.unknowns.fixed_rows::<3>(0).into_owned() / TUNING.lever_mm;
        let shift = rotation * self.unknowns.fixed_rows::<3>(3).into_owned() * pose.scale;
        pose.nudged(&self.center, &turn, &Vector3::repeat(1.0 + self.unknowns[6] / TUNING.lever_mm), &shift)
    }
}

/// One Gauss-Newton step towards the pose over which the heights are least; `None` if they don't determine it.
fn settling_step(plain: &Shaped, heights: &[Option<f64>]) -> Option<Step> {
    let center = Point3::from(plain.points.iter().map(|p| p.coords).sum::<Vector3>() / plain.points.len() as f64);
    let mut matrix = nalgebra::SMatrix::<f64, 7, 7>::zeros();
    let mut right = nalgebra::SVector::<f64, 7>::zeros();
    for ((point, normal), height) in plain.points.iter().zip(&plain.normals).zip(heights) {
        let Some(height) = height else { continue };
        let arm = (point - center) / TUNING.lever_mm;
        let turn = arm.cross(normal);
        let row = nalgebra::SVector::<f64, 7>::from_iterator(
            turn.iter().chain(normal.iter()).copied().chain([arm.dot(normal)]),
        );
        let weight = (1.0 + (height / TUNING.ordinary_mm).powi(2)).powi(-2);
        matrix += row * row.transpose() * weight;
        right += row * (weight * height);
    }
    Some(Step { center, unknowns: matrix.cholesky()?.solve(&right) })
}

/// How high the surface stands over a point of the standard, along its normal, mm on the standard.
fn height(target: &Target, pose: &Similarity, point: &Point3, normal: &Vector3) -> Option<f64> {
    let (foot, direction) = (pose.point(point), pose.normal(normal));
    let near = target.counterpart(&foot, &direction, TUNING.most_height_mm * pose.scale, 0.3)?;
    // the surface over the foot: the samples near the normal's line at about the nearest sample's height
    let guess = foot + direction * direction.dot(&(near.point - foot));
    let (mut sum, mut weights) = (0.0, 0.0);
    let footprint = TUNING.footprint_mm * pose.scale;
    target.grid.for_each_within(&guess, footprint, |sample, distance2| {
        let n = target.samples.normals[sample] * target.sign;
        let facing = n.dot(&direction);
        if facing > 0.3 {
            // where the sample's tangent plane meets the line
            let offset = target.samples.points[sample] - foot;
            let weight = target.samples.areas[sample] * facing * (1.0 - distance2 / (footprint * footprint)).powi(2);
            sum += weight * offset.dot(&n) / facing;
            weights += weight;
        }
    });
    (weights > 0.0).then(|| sum / weights / pose.scale).filter(|h| h.abs() <= TUNING.most_height_mm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::template;
    use crate::saliency::{CellGrid, Samples};
    use visage_geometry::Motion;

    fn example(bump: i8) -> DenseSignature {
        let mut steps = [0; TEMPLATE_POINTS];
        for (k, step) in steps.iter_mut().enumerate() {
            *step = if k % 2 == 0 { bump } else { -bump };
        }
        DenseSignature(steps)
    }

    #[test]
    fn distances_are_in_millimetres_and_a_shift_does_not_matter() {
        let (flat, wavy) = (example(0), example(10));
        assert_eq!(flat.distance_mm(&flat), Some(0.0));
        assert!((flat.distance_mm(&wavy).expect("all is seen") - 1.0).abs() < 1e-9);
        let raised = DenseSignature(flat.0.map(|s| s + 50));
        assert_eq!(flat.distance_mm(&raised), Some(0.0));
    }

    #[test]
    fn bytes_round_trip_and_unseen_points_do_not_count() {
        let mut steps = example(10).0;
        steps[..100].fill(UNSEEN);
        let partly = DenseSignature(steps);
        assert_eq!(DenseSignature::from_bytes(partly.to_bytes()), partly);
        assert_eq!(partly.distance_mm(&example(10)), Some(0.0));
        steps[..200].fill(UNSEEN);
        assert_eq!(DenseSignature(steps).distance_mm(&example(10)), None);
    }

    /// The built-in face with waves of 5 mm on it, as samples 3 mm apart.
    fn wavy_face() -> Samples {
        let mut samples = Samples { spacing: 3.0, ..Samples::default() };
        for k in 0..46 * 50 {
            let (x, y) = (f64::from(k % 46) * 3.0 - 67.5, f64::from(k / 46) * 3.0 - 50.0);
            let (point, normal) = template::at(x, y);
            samples.points.push(point + normal * (5.0 * (0.07 * x + 0.4).sin() * (0.06 * y).cos()));
            samples.normals.push(normal);
            samples.areas.push(9.0);
        }
        samples
    }

    #[test]
    fn where_the_fit_ended_does_not_matter() {
        let samples = wavy_face();
        let grid = CellGrid::new(&samples.points, 6.0);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        let signature = |scale: f64, motion: Motion| {
            let pose = Similarity { scale, stretch: Vector3::repeat(1.0), motion };
            DenseSignature::new(&target, template::face(), &Placement { pose, weights: Weights::zeros() })
        };
        let one = signature(1.0, Motion::identity());
        let shift = Vector3::new(0.0, -7.0, 3.0);
        let other = signature(1.12, Motion::new(shift, Vector3::new(0.08, 0.0, 0.0)));
        let apart = one.distance_mm(&other).expect("all is seen");
        assert!(apart < 0.1, "{apart}");
    }

    #[test]
    fn a_surface_that_holds_the_standard_nowhere_has_a_signature_all_the_same() {
        // a speck, a line of dots and a piece of a wall, each on the forehead
        let (forehead, normal) = template::at(0.0, 60.0);
        let along = |x: f64, y: f64| forehead + Vector3::new(x, y, 0.0);
        let speck = vec![forehead];
        let line = (0..60).map(|k| along(0.0, f64::from(k) - 30.0)).collect();
        let wall = (0..900).map(|k| along(f64::from(k % 30) * 2.0, f64::from(k / 30) * 2.0)).collect();
        for points in [speck, line, wall] {
            let mut samples = Samples { points, spacing: 2.0, ..Samples::default() };
            samples.normals = vec![normal; samples.points.len()];
            samples.areas = vec![4.0; samples.points.len()];
            let grid = CellGrid::new(&samples.points, 4.0);
            let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
            let pose = Similarity { scale: 1.0, stretch: Vector3::repeat(1.0), motion: Motion::identity() };
            let placement = Placement { pose, weights: Weights::zeros() };
            let signature = DenseSignature::new(&target, template::face(), &placement);
            assert!(signature.to_bytes().iter().any(|step| *step as i8 != UNSEEN), "it was near at the start");
        }
    }

    #[test]
    fn a_few_scattered_specks_end_no_program() {
        let plain = template::face().shaped(&Weights::zeros(), TEMPLATE_POINTS);
        for seed in 0..400u64 {
            let mut samples = Samples { spacing: 2.0, ..Samples::default() };
            for k in 0..9u64 {
                let number = (seed * 9 + k).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let point = (number >> 40) as usize % TEMPLATE_POINTS;
                let height = ((number >> 20) % 2000) as f64 / 100.0 - 10.0;
                samples.points.push(plain.points[point] + plain.normals[point] * height);
                samples.normals.push(plain.normals[point]);
                samples.areas.push(4.0);
            }
            let grid = CellGrid::new(&samples.points, 4.0);
            let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
            let pose = Similarity { scale: 1.0, stretch: Vector3::repeat(1.0), motion: Motion::identity() };
            DenseSignature::new(&target, template::face(), &Placement { pose, weights: Weights::zeros() });
        }
    }
}
