//! The dense check: is the standard's surface really there? A trimmed, scaled point-to-plane ICP of the template,
//! started where a facial triangle puts it, then the residual of what a surface with a rim could show of it.

use super::modes::{MODES, Weights};
use super::similarity::Similarity;
use super::target::{Counterpart, Target};
use super::template::Template;
use visage_geometry::{Point3, Vector3};

/// Template points farther from the surface than this say no more than that it isn't there, mm.
pub const FAR_MM: f64 = 12.0;
/// The share of template points that the residual counts, and that a pose is first fitted to.
pub const KEPT_SHARE: f64 = 0.8;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Template and surface must look the same way at least this much (cosine).
        least_cosine: f64 = 0.3,
        /// A radian between the normals counts as much as this distance, mm: a nose-like lump in the right place has the wrong
        /// slopes.
        normal_lever_mm: f64 = 8.7,
        /// A point this far off, mm, most of it along the surface, beside a rim, is not seen rather than not there.
        unseen_mm: f64 = 2.5,
        /// This share of it along the surface.
        unseen_tangential: f64 = 0.6,
        /// Samples stand for the surface around them: a point that near along the surface, in spacings, is on it.
        sample_reach: f64 = 0.7,
        /// Below this share the residual is raised: what was not seen could not disagree.
        fully_observed: f64 = 0.85,
        /// With this weight a mode at one standard deviation costs as much as 1 mm over twenty independent points.
        mode_weight: f64 = 0.008,
        /// No face is farther from the mean than this, in standard deviations of a mode.
        most_weight: f64 = 3.0,
        /// One standard deviation of the logarithms of width, height and depth.
        proportion_spread: f64 = 0.08,
        /// What a unit of strain adds to the mean square residual, mm^2: 1 mm over twenty points, as in the fit.
        strain_mm2: f64 = 20.0 / 240.0,
        /// A step shorter than this (radians, logarithms, levers, standard deviations) is the last.
        settled: f64 = 2e-3,
    }
}

/// With a smaller share of the template seen there is no verdict.
pub const LEAST_OBSERVED: f64 = 0.5;

/// How well the standard's surface fits at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Where the standard lies in the model.
    pub pose: Similarity,
    /// How the face differs from the standard.
    pub weights: Weights,
    /// Root mean square difference (distance, and angle by a lever of 8.7 mm) of the best 80 % of the template points
    /// that could be seen, mm on the standard, with what the deformation costs added in squares; raised where little
    /// could be seen.
    pub residual_mm: f64,
    /// The share of template points that could be seen.
    pub observed: f64,
}

impl Fit {
    /// Where the deformed standard lies.
    pub fn placement(&self) -> Placement {
        Placement { pose: self.pose, weights: self.weights }
    }
}

/// How a pose is looked for.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// How many of the template's points take part.
    pub points: usize,
    /// The most steps.
    pub rounds: usize,
    /// The scale stays within this factor of the start's.
    pub most_growth: f64,
    /// The weight of keeping the standard's proportions: see [`PROPORTION_WEIGHT`].
    pub proportion_weight: f64,
    /// The share of template points, the nearest, that the pose is fitted to.
    pub kept_share: f64,
    /// The modes stay as they are in that many first steps.
    pub rigid_rounds: usize,
}

/// With this weight width, height and depth may differ from the standard's by some 8 % (one standard deviation)
/// before that costs as much as 1 mm over twenty independent points.
pub const PROPORTION_WEIGHT: f64 = 1.25;
/// With this weight proportions stay.
pub const RIGID_PROPORTIONS: f64 = 1e4;

/// Where the deformed standard lies: its pose, and the weights of its modes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Turn, place, scale and proportions.
    pub pose: Similarity,
    /// How the face differs from the standard.
    pub weights: Weights,
}

/// Moves the template onto the surface by trimmed point-to-plane steps; with `search.mode_weight` it is deformed too.
pub fn fit_pose(target: &Target, template: &Template, start: &Placement, search: &Search) -> Placement {
    let mut now = *start;
    let rest = template.shaped(&Weights::zeros(), search.points);
    let middle = Point3::from(rest.points.iter().map(|p| p.coords).sum::<Vector3>() / rest.points.len().max(1) as f64);
    for round in 0..search.rounds {
        let Some(mut step) = pose_step(target, template, search, &middle, &now, round) else { break };
        let turn = step.fixed_rows::<3>(0).into_owned();
        let growth = step.fixed_rows::<3>(3).map(|g| 1.0 + g.clamp(-0.2, 0.2));
        let shift = step.fixed_rows::<3>(6).into_owned() * lever(&now.pose);
        let grown = now.pose.nudged(&middle, &turn, &growth, &shift);
        let allowed = grown.scale.clamp(start.pose.scale / search.most_growth, start.pose.scale * search.most_growth);
        let cut = allowed / grown.scale;
        now.pose = grown.nudged(&middle, &Vector3::zeros(), &Vector3::repeat(cut), &Vector3::zeros());
        // at the limit of size the same step would be taken, and undone, over and over
        step.fixed_rows_mut::<3>(3).add_scalar_mut(cut - 1.0);
        now.weights =
            (now.weights + step.fixed_rows::<MODES>(9)).map(|w| w.clamp(-TUNING.most_weight, TUNING.most_weight));
        if round >= search.rigid_rounds && step.norm() < TUNING.settled {
            break;
        }
    }
    now
}

/// The length, in the model's unit, that makes shifts comparable with angles and growth.
fn lever(pose: &Similarity) -> f64 {
    50.0 * pose.scale
}

/// Turn, growth along the standard's axes, shift in levers, weights of the modes.
const UNKNOWNS: usize = 9 + MODES;
type Unknowns = nalgebra::SVector<f64, UNKNOWNS>;

/// One Gauss-Newton step; `None` if too little is near.
fn pose_step(
    target: &Target,
    template: &Template,
    search: &Search,
    middle: &Point3,
    now: &Placement,
    round: usize,
) -> Option<Unknowns> {
    let pose = &now.pose;
    let shaped = template.shaped(&now.weights, search.points);
    let reach = FAR_MM * pose.scale;
    let mut pairs: Vec<Pair> = (0..shaped.points.len())
        .filter_map(|k| {
            let (point, normal) = (pose.point(&shaped.points[k]), pose.normal(&shaped.normals[k]));
            Some((k, point, target.counterpart(&point, &normal, reach, TUNING.least_cosine)?))
        })
        .collect();
    trim(&mut pairs, (search.kept_share * search.points as f64) as usize);
    if pairs.len() * 3 < search.points {
        return None;
    }
    let (center, unit) = (pose.point(middle), lever(pose));
    let mut matrix = nalgebra::SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity() * 1e-6 * pairs.len() as f64;
    let mut right = Unknowns::zeros();
    for (k, point, counterpart) in &pairs {
        let n = counterpart.normal;
        let inward = pose.motion.rotation.inverse() * n;
        let turning = ((point - center) / unit).cross(&n);
        let stretched = (pose.scale / unit) * pose.stretch;
        let growing = inward.component_mul(&(shaped.points[*k] - middle).component_mul(&stretched));
        let mut row = Unknowns::zeros();
        row.fixed_rows_mut::<3>(0).copy_from(&turning);
        row.fixed_rows_mut::<3>(3).copy_from(&growing);
        row.fixed_rows_mut::<3>(6).copy_from(&n);
        let along = inward.component_mul(&stretched);
        for (mode, motion) in template.motions(*k).iter().enumerate() {
            row[9 + mode] = motion.dot(&along);
        }
        matrix.syger(1.0, &row, &row, 1.0);
        right.axpy(n.dot(&(counterpart.point - point)) / unit, &row, 1.0);
    }
    // the prior: the logarithms of the three factors should be equal
    let weight = search.proportion_weight;
    for axis in 0..3 {
        for other in 0..3 {
            matrix[(3 + axis, 3 + other)] += weight * (f64::from(u8::from(axis == other)) - 1.0 / 3.0);
        }
        right[3 + axis] -= weight * pose.stretch[axis].ln();
    }
    for mode in 0..MODES {
        let weight = if round < search.rigid_rounds { RIGID_PROPORTIONS } else { TUNING.mode_weight };
        matrix[(9 + mode, 9 + mode)] += weight;
        right[9 + mode] -= weight * now.weights[mode];
    }
    Some(matrix.cholesky()?.solve(&right))
}

/// A template point by its number, where it is posed, and what lies opposite.
type Pair = (usize, Point3, Counterpart);

/// Keeps the nearest `count`, and all that are as near as the last of them, in their order.
fn trim(pairs: &mut Vec<Pair>, count: usize) {
    if (1..pairs.len()).contains(&count) {
        let mut squares: Vec<f64> = pairs.iter().map(|(_, _, counterpart)| counterpart.squared).collect();
        let (_, &mut farthest, _) = squares.select_nth_unstable_by(count - 1, f64::total_cmp);
        pairs.retain(|(_, _, counterpart)| counterpart.squared <= farthest);
    }
}

/// The residual of a placement over the first `count` template points.
pub fn score(target: &Target, template: &Template, count: usize, placement: &Placement) -> Fit {
    let pose = &placement.pose;
    let shaped = template.shaped(&placement.weights, count);
    let mut squares = Vec::with_capacity(count);
    for (p, n) in shaped.points.iter().zip(&shaped.normals) {
        squares.extend(squared_mm(target, &pose.point(p), &pose.normal(n), pose.scale));
    }
    let observed = squares.len() as f64 / count as f64;
    squares.sort_by(f64::total_cmp);
    squares.truncate((KEPT_SHARE * squares.len() as f64).ceil() as usize);
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let strained = (mean + TUNING.strain_mm2 * strain(placement)).sqrt();
    let residual = if observed < LEAST_OBSERVED { FAR_MM } else { strained };
    let residual_mm = residual * (1.0 + 0.5 * (TUNING.fully_observed - observed).max(0.0));
    Fit { pose: *pose, weights: placement.weights, residual_mm, observed }
}

/// How far the placement is from the plain standard: the sum of squared standard deviations of proportions and modes.
fn strain(placement: &Placement) -> f64 {
    let stretch: f64 =
        placement.pose.stretch.iter().map(|factor| (factor.ln() / TUNING.proportion_spread).powi(2)).sum();
    stretch + placement.weights.norm_squared()
}

/// How far a posed template point is from the surface, in place and direction, squared mm on the standard; `None` if
/// a rim hides it.
fn squared_mm(target: &Target, point: &Point3, normal: &Vector3, scale: f64) -> Option<f64> {
    let radius = FAR_MM * scale;
    let near = target.counterpart(point, normal, radius, TUNING.least_cosine);
    let Some(near) = near.or_else(|| beyond(target, point, normal, radius)) else {
        return Some(FAR_MM * FAR_MM);
    };
    let offset = point - near.point;
    let height = offset.dot(&near.normal);
    let along = (offset.norm_squared() - height * height).max(0.0).sqrt();
    let distance = offset.norm() / scale;
    if distance > TUNING.unseen_mm && along > TUNING.unseen_tangential * offset.norm() && target.is_on_rim(near.sample)
    {
        return None;
    }
    let beside = (along - TUNING.sample_reach * target.samples.spacing).max(0.0);
    // 2 (1 - cos) is the squared angle
    let angle2 = 2.0 * (1.0 - near.normal.dot(normal));
    let place2 = (height * height + beside * beside) / (scale * scale);
    Some((place2 + TUNING.normal_lever_mm * TUNING.normal_lever_mm * angle2).min(FAR_MM * FAR_MM))
}

/// The nearest sample farther off than `radius`, if there is none of any direction inside: perhaps a rim's.
fn beyond(target: &Target, point: &Point3, normal: &Vector3, radius: f64) -> Option<Counterpart> {
    target.counterpart(point, normal, radius, -2.0).is_none().then_some(())?;
    [2.0, 4.0, 8.0]
        .into_iter()
        .find_map(|factor| target.counterpart(point, normal, factor * radius, TUNING.least_cosine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::template;
    use crate::saliency::{CellGrid, Samples};
    use visage_geometry::Motion;

    /// The built-in face as samples 3 mm apart, posed.
    fn posed(pose: &Similarity, keep: impl Fn(f64, f64) -> bool) -> Samples {
        let places = (0..38 * 34).map(|k| (f64::from(k % 38) * 3.0 - 55.5, f64::from(k / 38) * 3.0 - 29.0));
        let mut samples = Samples { spacing: 3.0 * pose.scale, ..Samples::default() };
        for (x, y) in places.filter(|&(x, y)| keep(x, y)) {
            let (point, normal) = template::at(x, y);
            samples.points.push(pose.point(&point));
            samples.normals.push(pose.normal(&normal));
            samples.areas.push(1.0);
        }
        samples
    }

    fn truth() -> Similarity {
        Similarity {
            scale: 0.02,
            stretch: Vector3::repeat(1.0),
            motion: Motion::new(Vector3::new(5.0, 1.0, -2.0), Vector3::new(0.5, -2.0, 0.3)),
        }
    }

    fn start() -> Similarity {
        let center = Point3::new(0.0, 20.0, 100.0);
        truth().nudged(
            &center,
            &Vector3::new(0.08, -0.1, 0.06),
            &Vector3::new(1.15, 1.08, 1.0),
            &Vector3::new(0.06, -0.04, 0.05),
        )
    }

    fn plain(pose: Similarity) -> Placement {
        Placement { pose, weights: Weights::zeros() }
    }

    fn search(points: usize, rounds: usize) -> Search {
        let (proportion_weight, kept_share) = (PROPORTION_WEIGHT, 0.95);
        Search { points, rounds, most_growth: 1.3, proportion_weight, kept_share, rigid_rounds: 3 }
    }

    #[test]
    fn a_disturbed_pose_finds_back() {
        let samples = posed(&truth(), |_, _| true);
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        let before = score(&target, template::face(), 300, &plain(start()));
        let found = fit_pose(&target, template::face(), &plain(start()), &search(300, 30));
        let after = score(&target, template::face(), 300, &found);
        assert!(before.residual_mm > 2.0 && after.residual_mm < 0.4, "{before:?} {after:?}");
        assert!((found.pose.scale / 0.02 - 1.0).abs() < 0.02);
        let nose = Point3::new(0.0, 4.0, 131.0);
        assert!((found.pose.point(&nose) - truth().point(&nose)).norm() < 0.02 * 2.0);
    }

    #[test]
    fn a_deformed_face_gives_its_weights_back() {
        let weights = Weights::from_fn(|mode, _| [1.2, -0.8, 0.5][mode.min(2)] * f64::from(u8::from(mode < 3)));
        let shaped = template::face().shaped(&weights, template::TEMPLATE_POINTS);
        // three hundred points 6 mm apart are sparse, but all of the face
        let samples = Samples {
            points: shaped.points.iter().map(|p| truth().point(p)).collect(),
            normals: shaped.normals.iter().map(|n| truth().normal(n)).collect(),
            areas: vec![1.0; shaped.points.len()],
            spacing: 6.0 * truth().scale,
        };
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        let [stiff, free] = [30, 3].map(|rigid_rounds| {
            let search = Search { rigid_rounds, ..search(300, 30) };
            score(&target, template::face(), 300, &fit_pose(&target, template::face(), &plain(truth()), &search))
        });
        assert!(free.residual_mm < 0.8 * stiff.residual_mm, "{} {}", free.residual_mm, stiff.residual_mm);
        assert!((0..3).all(|mode| free.weights[mode] * weights[mode] > 0.1), "{}", free.weights);
    }

    #[test]
    fn what_lies_beyond_a_rim_is_not_counted_against_it() {
        let samples = posed(&truth(), |x, _| x < 16.0);
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        let fit = score(&target, template::face(), 300, &plain(truth()));
        assert!((0.6..0.75).contains(&fit.observed) && fit.residual_mm < 1.0, "{fit:?}");
    }

    #[test]
    fn the_nearest_pairs_are_kept_with_their_ties_in_their_order() {
        let pair = |number: usize, squared: f64| {
            let (point, normal) = (Point3::origin(), Vector3::z());
            (number, point, Counterpart { sample: 0, point, normal, squared })
        };
        let squares = [4.0, 1.0, 3.0, 2.0, 3.0];
        let kept = |count: usize| {
            let mut pairs: Vec<Pair> = squares.iter().enumerate().map(|(k, &squared)| pair(k, squared)).collect();
            trim(&mut pairs, count);
            pairs.into_iter().map(|(number, ..)| number).collect::<Vec<_>>()
        };
        assert_eq!(kept(2), [1, 3]);
        assert_eq!(kept(3), [1, 2, 3, 4], "both of the third place");
        assert_eq!(kept(5), [0, 1, 2, 3, 4]);
        assert_eq!(kept(9), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn an_inside_out_surface_does_not_fit() {
        let samples = posed(&truth(), |_, _| true);
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: -1.0 };
        assert!(score(&target, template::face(), 300, &plain(truth())).residual_mm >= 8.0);
    }

    #[test]
    fn far_from_any_surface_nothing_moves() {
        let samples = posed(&truth(), |_, _| true);
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        let astray = plain(Similarity { motion: Motion::translation(900.0, 0.0, 0.0), ..truth() });
        assert_eq!(fit_pose(&target, template::face(), &astray, &search(90, 5)), astray);
        assert_eq!(score(&target, template::face(), 90, &astray).residual_mm, FAR_MM);
    }
}
