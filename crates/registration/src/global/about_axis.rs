//! What turned before a scanner that stood still turned about one axis.
//!
//! A few hundred points that moved hold a free motion badly, and any two of their views fit in several ways. But a thing on a
//! turntable has one axis, which all its views share, and each view one angle about it. So axes are proposed, the angles are
//! tried one after the other for all pairs, and those are taken that all pairs together bear out best. Then axis and
//! angles are refined at once.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::agglomerative::Agglomeration;
use super::axis::{Axis, FREE};
use super::coarse_set::CoarseSet;
use super::component::Component;
use super::pair_hypothesis::PairHypothesis;
use super::verification::verify;
use crate::least_squares::robust_kernel::RobustKernel;
use crate::sensor::turning::Turning;
use crate::view_graph::all_pairs;
use visage_geometry::{Motion, Point3, Vector3};

/// Angles that are tried for a pair: as many parts of a whole turn.
const STEPS: usize = 72;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Free motions whose axes are tried, those that most speaks for.
        motions: usize = 150,
        /// A motion of a pair is a turn if it slides along its axis by less than this, in edges.
        slides: f64 = 4.0,
        /// The axis passes the middle of what moved within this share of its reach.
        aside: f64 = 1.0,
        /// Axes along what the background faces are tried at places so far apart, in the reach,
        grid_step: f64 = 0.12,
        /// so many to each side of the middle.
        grid_half: i32 = 4,
        /// Points of a view that are asked of an angle at first,
        first_samples: usize = 12,
        /// every so many angles,
        first_stride: usize = 2,
        /// of those next to it in the order of the scans: so many to either side,
        first_neighbours: usize = 2,
        /// and so many pairs in all.
        first_pairs: usize = 16,
        /// Points of all pairs together that are asked of an angle of the axes that are best then,
        samples: usize = 1200,
        /// and of a pair, at least and at most.
        pair_samples: [usize; 2] = [10, 40],
        /// How many these are, no two of them alike.
        seconds: usize = 12,
        /// Of them as many are refined.
        finalists: usize = 4,
        /// Search distances of the steps of the refinement, in spacings.
        reaches: [f64; 9] = [7.5, 6.0, 5.0, 4.0, 3.2, 2.5, 2.5, 2.5, 2.5],
        /// Points of all views in each other that take part in it, about,
        refined_samples: usize = 18_000,
        /// and of a view in another, at least and at most.
        view_samples: [usize; 2] = [40, 300],
        /// Normals farther apart than this cosine don't belong to one surface.
        least_cosine: f64 = 0.6,
        /// Points of a view that are asked when whole arrangements are compared.
        queried: usize = 200,
        /// Surfels of a view that are asked of two arrangements.
        surfels: usize = 400,
    }
}

/// For each pair what speaks for each angle: `turns[i][j][k]` for a turn of view j by k steps to where view i has it.
type Turns = Vec<Vec<[f64; STEPS]>>;

/// An axis and for each view how far the thing was turned about it.
#[derive(Debug, Clone)]
struct Turned {
    axis: Axis,
    angles: Vec<f64>,
    /// What speaks for it.
    score: f64,
}

impl Turned {
    /// Poses of the local frames with the thing at rest.
    fn local_poses(&self, turning: &Turning) -> Vec<Motion> {
        let views = self.angles.iter().zip(&turning.world_from_local);
        views.map(|(angle, world_from_local)| self.axis.turn(-angle) * world_from_local).collect()
    }
}

/// The views as one component that turned about an axis, if pictures and surfaces bear it out better than what was `found`
/// without one.
pub fn laid(turning: &Turning, hypotheses: &[PairHypothesis], edge: f64, found: &Agglomeration) -> Option<Component> {
    let views: Vec<usize> = (0..turning.views.len()).collect();
    let placed = |turned: Turned| Component {
        views: views.clone(),
        local_poses: turned.local_poses(turning),
        hypotheses: Vec::new(),
        search: 0,
    };
    let laid = search(turning, hypotheses, edge).into_iter().map(placed);
    let rated = laid.map(|component| (borne_out(turning, &component), component));
    let (score, component) = rated.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let without = found.components.first().map_or(0.0, |component| borne_out(turning, component));
    (score > without.max(0.0)).then_some(component)
}

/// Whether the surfels speak for a component that was laid about an axis, too: they are asked where all views were `found` a
/// place without one. Pictures speak most for views that show the same, and of a thing that looks nearly the same
/// from two sides those are often not the right ones.
pub fn is_seconded(coarse_set: &CoarseSet, component: &Component, found: &Agglomeration) -> bool {
    let whole = found.components.first().filter(|found| found.views.len() == component.views.len());
    whole.is_none_or(|whole| by_surfels(coarse_set, component) > by_surfels(coarse_set, whole))
}

/// What the surfels of all pairs say of a component.
fn by_surfels(coarse_set: &CoarseSet, component: &Component) -> f64 {
    let CoarseSet { coarse_views, edge, .. } = *coarse_set;
    let pair = |(a, b): (usize, usize)| {
        let (i, j) = (component.views[a], component.views[b]);
        let i_from_j = component.local_poses[a].inv_mul(&component.local_poses[b]);
        let evidence = verify(&coarse_views[i], &coarse_views[j], &i_from_j, edge, TUNING.surfels);
        coarse_set.score(&PairHypothesis { i, j, i_from_j, evidence })
    };
    all_pairs(component.views.len()).map(pair).sum()
}

/// What pictures and surfaces of all pairs say of a component.
fn borne_out(turning: &Turning, component: &Component) -> f64 {
    let at_rest = |k: usize| component.local_poses[k] * turning.world_from_local[component.views[k]].inverse();
    let pair = |(a, b): (usize, usize)| {
        let motion = at_rest(a).inv_mul(&at_rest(b));
        turning.agreement(component.views[a], component.views[b], &motion, TUNING.queried)
    };
    all_pairs(component.views.len()).map(pair).sum()
}

/// The best axes with the angles of all views about them, refined.
fn search(turning: &Turning, hypotheses: &[PairHypothesis], edge: f64) -> Vec<Turned> {
    let n = turning.views.len();
    let axes = proposed(turning, hypotheses, edge);
    let near = |(i, j): &(usize, usize)| {
        let apart = (j - i).min(n + i - j);
        apart <= TUNING.first_neighbours
    };
    let pairs: Vec<(usize, usize)> = all_pairs(n).filter(near).collect();
    let pairs: Vec<(usize, usize)> =
        pairs.iter().step_by(pairs.len().div_ceil(TUNING.first_pairs).max(1)).copied().collect();
    let quick = |axis: &Axis| -> f64 {
        let best = |&(i, j): &(usize, usize)| {
            let angles = (0..STEPS).step_by(TUNING.first_stride).map(step_angle);
            angles
                .map(|angle| turning.agreement(i, j, &axis.turn(angle), TUNING.first_samples))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        pairs.iter().map(best).sum()
    };
    let mut rated: Vec<(f64, Axis)> = axes.par_iter().with_max_len(1).map(|axis| (quick(axis), *axis)).collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<Axis> = Vec::new();
    for (_, axis) in rated {
        if kept.len() < TUNING.seconds && !kept.iter().any(|other| other.is_like(&axis, turning.reach)) {
            kept.push(axis);
        }
    }
    let mut turned: Vec<Turned> = kept.par_iter().with_max_len(1).map(|axis| assembled(turning, axis)).collect();
    turned.sort_by(|a, b| b.score.total_cmp(&a.score));
    turned.truncate(TUNING.finalists);
    let settled = |turned: &Turned| {
        // a better axis may have other angles
        let again = assembled(turning, &refined(turning, turned).axis);
        refined(turning, &again)
    };
    turned.par_iter().with_max_len(1).map(settled).collect()
}

fn step_angle(step: usize) -> f64 {
    TAU * step as f64 / STEPS as f64
}

/// The axes of the pairs' free motions, and those along what the background faces.
fn proposed(turning: &Turning, hypotheses: &[PairHypothesis], edge: f64) -> Vec<Axis> {
    let of_pair = |hypothesis: &PairHypothesis| {
        let [world_i, world_j] = [hypothesis.i, hypothesis.j].map(|view| turning.world_from_local[view]);
        Axis::of(&(world_i * hypothesis.i_from_j * world_j.inverse()), TUNING.slides * edge)
    };
    let mut best: Vec<&PairHypothesis> = hypotheses.iter().collect();
    best.sort_by(|a, b| b.score().total_cmp(&a.score()).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut axes: Vec<Axis> = best.into_iter().take(TUNING.motions).filter_map(of_pair).collect();
    axes.retain(|axis| axis.distance(&Vector3::zeros()) < TUNING.aside * turning.reach);
    let step = TUNING.grid_step * turning.reach;
    for direction in &turning.facing {
        let middle = Axis { point: Vector3::zeros(), direction: *direction };
        let places = -TUNING.grid_half..=TUNING.grid_half;
        for (a, b) in places.clone().flat_map(|a| places.clone().map(move |b| (a, b))) {
            axes.push(middle.changed(&[f64::from(a) * step, f64::from(b) * step, 0.0, 0.0]));
        }
    }
    axes
}

/// All angles of all pairs about an axis, and of them those that all pairs together bear out best.
fn assembled(turning: &Turning, axis: &Axis) -> Turned {
    let n = turning.views.len();
    let mut turns: Turns = vec![vec![[0.0; STEPS]; n]; n];
    let [least, most] = TUNING.pair_samples;
    let samples = (TUNING.samples / all_pairs(n).count().max(1)).clamp(least, most);
    for (i, j) in all_pairs(n) {
        for step in 0..STEPS {
            let said = turning.agreement(i, j, &axis.turn(step_angle(step)), samples);
            turns[i][j][step] = said;
            turns[j][i][(STEPS - step) % STEPS] = said;
        }
    }
    let (score, steps) = (0..n)
        .map(|first| grown(&turns, first))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or_else(|| (0.0, Vec::new()));
    Turned { axis: *axis, angles: steps.into_iter().map(step_angle).collect(), score }
}

/// Angles, in steps, for all views: from a first one, each time the view that the others bear out best; then each once more
/// among all others as long as that betters it. And what speaks for them.
fn grown(turns: &Turns, first: usize) -> (f64, Vec<usize>) {
    let n = turns.len();
    let mut steps: Vec<Option<usize>> = vec![None; n];
    steps[first] = Some(0);
    let best = |steps: &[Option<usize>], view: usize| -> (f64, usize) {
        let at = |step: usize| -> f64 {
            let say = |other: usize| Some(turns[other][view][(steps[other]? + STEPS - step) % STEPS]);
            (0..n).filter(|other| *other != view).filter_map(say).sum()
        };
        (0..STEPS).map(|step| (at(step), step)).fold((f64::NEG_INFINITY, 0), |a, b| if b.0 > a.0 { b } else { a })
    };
    for _ in 1..n {
        let open = (0..n).filter(|view| steps[*view].is_none());
        let next = open.map(|view| (best(&steps, view), view)).max_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let Some(((_, step), view)) = next else { break };
        steps[view] = Some(step);
    }
    let mut is_better = true;
    while is_better {
        is_better = false;
        for view in 0..n {
            let (own, others) = (steps[view], best(&steps, view));
            let say = |other: usize| Some(turns[other][view][(steps[other]? + STEPS - own?) % STEPS]);
            let now: f64 = (0..n).filter(|other| *other != view).filter_map(say).sum();
            if others.0 > now + 1e-9 {
                (steps[view], is_better) = (Some(others.1), true);
            }
        }
    }
    let steps: Vec<usize> = steps.into_iter().map(|step| step.unwrap_or(0)).collect();
    let score = all_pairs(n).map(|(i, j)| turns[i][j][(steps[i] + STEPS - steps[j]) % STEPS]).sum();
    (score, steps)
}

/// Axis and angles drawn onto the surfaces together, by Gauss-Newton steps on the distances along both normals.
fn refined(turning: &Turning, start: &Turned) -> Turned {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::Fixture;
    use crate::global::verification::PairVotes;
    use crate::sensor::turning::balls;

    /// How far the poses of the views are off from how the thing was turned, at most, in degrees.
    fn off(turning: &Turning, component: &Component, direction: &Vector3, angles: &[f64]) -> f64 {
        let at_rest = |k: usize| component.local_poses[k] * turning.world_from_local[k].inverse();
        let error = |(i, j): (usize, usize)| {
            let right = balls::motion(turning, direction, [angles[i], angles[j]]);
            let found = at_rest(i).inv_mul(&at_rest(j));
            assert!((found.inv_mul(&right)).translation.vector.norm() < 0.1 * turning.reach);
            found.rotation.angle_to(&right.rotation).to_degrees()
        };
        all_pairs(angles.len()).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn what_turns_on_a_floor_needs_no_pair_that_finds_itself() {
        let (direction, angles) = (Vector3::y(), [0.0, 0.6, 1.5, 2.1, 5.0]);
        let turning = balls::turning(&direction, &angles);
        let laid = laid(&turning, &[], 2.0, &Agglomeration::default()).expect("it turns about the floor's normal");
        let off = off(&turning, &laid, &direction, &angles);
        assert!(off < 2.0, "{off}");
    }

    #[test]
    fn one_rough_motion_gives_the_axis_and_all_angles() {
        let (direction, angles) = (Vector3::new(0.5, 0.6, 0.4), [0.0, 0.6, 1.5, 2.1]);
        let mut turning = balls::turning(&direction, &angles);
        turning.facing.clear();
        let rough = Motion::new(Vector3::new(0.6, -0.4, 0.3), Vector3::new(0.03, -0.02, 0.03))
            * balls::motion(&turning, &direction, [angles[0], angles[1]]);
        let i_from_j = turning.world_from_local[0].inv_mul(&(rough * turning.world_from_local[1]));
        let hypothesis = PairHypothesis { i: 0, j: 1, i_from_j, evidence: PairVotes::default() };
        let laid = laid(&turning, &[hypothesis], 2.0, &Agglomeration::default()).expect("the axis is proposed");
        let off = off(&turning, &laid, &direction, &angles);
        assert!(off < 2.0, "{off}");
    }

    #[test]
    fn what_is_borne_out_better_without_an_axis_stays() {
        let (direction, angles) = (Vector3::y(), [0.0, 0.6, 1.5]);
        let mut turning = balls::turning(&direction, &angles);
        turning.facing.clear();
        let local_poses = angles
            .iter()
            .zip(&turning.world_from_local)
            .map(|(angle, pose)| balls::motion(&turning, &direction, [0.0, *angle]) * pose)
            .collect();
        let right = Component { views: vec![0, 1, 2], local_poses, hypotheses: Vec::new(), search: 0 };
        let found = Agglomeration { components: vec![right], ambiguous: vec![false; 3] };
        // an axis far from the true one
        let wrong = balls::motion(&turning, &Vector3::x(), [1.0, 0.0]);
        let i_from_j = turning.world_from_local[0].inv_mul(&(wrong * turning.world_from_local[1]));
        let hypothesis = PairHypothesis { i: 0, j: 1, i_from_j, evidence: PairVotes::default() };
        assert_eq!(laid(&turning, &[hypothesis], 2.0, &found), None);
    }

    #[test]
    fn surfels_are_asked_where_all_views_have_a_place_already() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let coarse_set = fixture.coarse_set();
        let right = |k: usize| fixture.i_from_j(0, k);
        let component = |local_poses: Vec<Motion>| {
            let views = (0..local_poses.len()).collect();
            Component { views, local_poses, hypotheses: Vec::new(), search: 0 }
        };
        let found = |component: Component| Agglomeration { components: vec![component], ambiguous: vec![false; 3] };
        let all = component((0..3).map(right).collect());
        let turned = component((0..3).map(|k| right(k) * Motion::rotation(Vector3::z() * (0.5 * k as f64))).collect());
        assert!(is_seconded(&coarse_set, &all, &found(turned.clone())));
        assert!(!is_seconded(&coarse_set, &turned, &found(all.clone())));
        assert!(is_seconded(&coarse_set, &turned, &found(component(all.local_poses[..2].to_vec()))), "one is open");
    }
}
