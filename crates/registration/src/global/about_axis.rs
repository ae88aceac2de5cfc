//! What turned before a scanner that stood still turned about one axis.
//!
//! A few hundred points that moved hold a free motion badly, and any two of their views fit in several ways. But a thing on a
//! turntable has one axis, which all its views share, and each view one angle about it. So axes are proposed, the angles are
//! tried one after the other for all pairs, and those are taken that all pairs together bear out best. Then axis and
//! angles are refined at once.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::agglomerative::Agglomeration;
use super::axis::Axis;
use super::coarse_set::CoarseSet;
use super::component::Component;
use super::pair_hypothesis::PairHypothesis;
use super::turned::{Turned, refined};
use super::verification::verify;
use crate::sensor::turning::Turning;
use crate::view_graph::all_pairs;
use visage_geometry::Vector3;

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
        /// so many to each side of the middle,
        grid_half: i32 = 3,
        /// and as the scanner sees it from so many before the middle to so many behind it.
        grid_behind: [i32; 2] = [-2, 7],
        /// An axis is along what the background faces within this cosine.
        along: f64 = 0.99,
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
        /// Points of a view that are asked when whole arrangements are compared.
        queried: usize = 200,
        /// Surfels of a view that are asked of two arrangements.
        surfels: usize = 400,
    }
}

/// For each pair what speaks for each angle: `turns[i][j][k]` for a turn of view j by k steps to where view i has it.
type Turns = Vec<Vec<[f64; STEPS]>>;

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

/// Whether pictures and surfels together speak for a component that was laid about an axis: surfels are asked as well where all views
/// were `found` a place without one. Pictures speak most for views that show the same, and of a thing that looks nearly the
/// same from two sides those are often not the right ones; surfels speak for what was laid by them. `pictures` is what pictures say.
pub fn is_seconded(
    coarse_set: &CoarseSet,
    pictures: impl Fn(&Component) -> f64,
    component: &Component,
    found: &Agglomeration,
) -> bool {
    let whole = found.components.first().filter(|found| found.views.len() == component.views.len());
    // pictures count both directions of a pair, surfels their mean
    let by_both = |component: &Component| 0.5 * pictures(component) + by_surfels(coarse_set, component);
    whole.is_none_or(|whole| by_both(component) > by_both(whole))
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
pub fn borne_out(turning: &Turning, component: &Component) -> f64 {
    let at_rest = |k: usize| component.local_poses[k] * turning.world_from_local[component.views[k]].inverse();
    let pair = |(a, b): (usize, usize)| {
        let motion = at_rest(a).inv_mul(&at_rest(b));
        turning.agreement(component.views[a], component.views[b], &motion, TUNING.queried)
    };
    all_pairs(component.views.len()).map(pair).sum()
}

/// The best axes with the angles of all views about them, refined.
///
/// Things mostly turn on what they stand on, so axes along what the background faces have seats of their own: by a few points
/// alone some wrong free motion always looks better.
fn search(turning: &Turning, hypotheses: &[PairHypothesis], edge: f64) -> Vec<Turned> {
    let Proposed { along, free } = proposed(turning, hypotheses, edge);
    let share = if along.is_empty() { 1 } else { 2 };
    let slack = 0.5 * TUNING.grid_step * turning.reach;
    let mut finalists = best_axes(turning, &along, slack, TUNING.seconds / share, TUNING.finalists / share);
    finalists.extend(best_axes(turning, &free, 0.0, TUNING.seconds / share, TUNING.finalists / share));
    let settled = |turned: &Turned| {
        // a better axis may have other angles
        let again = assembled(turning, &refined(turning, turned).axis, 0.0);
        refined(turning, &again)
    };
    finalists.par_iter().with_max_len(1).map(settled).collect()
}

/// Of some axes the best with the angles of all views about them: `seconds` are looked at closely, `count` are kept. Axes may be off by
/// `slack`, a length.
fn best_axes(turning: &Turning, axes: &[Axis], slack: f64, seconds: usize, count: usize) -> Vec<Turned> {
    let n = turning.views.len();
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
                .map(|angle| turning.agreement_within(i, j, &axis.turn(angle), TUNING.first_samples, slack))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        pairs.iter().map(best).sum()
    };
    let mut rated: Vec<(f64, Axis)> = axes.par_iter().with_max_len(1).map(|axis| (quick(axis), *axis)).collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<Axis> = Vec::new();
    for (_, axis) in rated {
        if kept.len() < seconds && !kept.iter().any(|other| other.is_like(&axis, turning.reach)) {
            kept.push(axis);
        }
    }
    let mut turned: Vec<Turned> = kept.par_iter().with_max_len(1).map(|axis| assembled(turning, axis, slack)).collect();
    turned.sort_by(|a, b| b.score.total_cmp(&a.score));
    turned.truncate(count);
    turned
}

fn step_angle(step: usize) -> f64 {
    TAU * step as f64 / STEPS as f64
}

/// Axes that are tried.
struct Proposed {
    /// Those along what the background faces.
    along: Vec<Axis>,
    /// Those of other free motions of pairs.
    free: Vec<Axis>,
}

fn proposed(turning: &Turning, hypotheses: &[PairHypothesis], edge: f64) -> Proposed {
    let of_pair = |hypothesis: &PairHypothesis| {
        let [world_i, world_j] = [hypothesis.i, hypothesis.j].map(|view| turning.world_from_local[view]);
        Axis::of(&(world_i * hypothesis.i_from_j * world_j.inverse()), TUNING.slides * edge)
    };
    let mut best: Vec<&PairHypothesis> = hypotheses.iter().collect();
    best.sort_by(|a, b| b.score().total_cmp(&a.score()).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut axes: Vec<Axis> = best.into_iter().take(TUNING.motions).filter_map(of_pair).collect();
    axes.retain(|axis| axis.distance(&Vector3::zeros()) < TUNING.aside * turning.reach);
    let is_along = |axis: &Axis| turning.facing.iter().any(|way| way.dot(&axis.direction).abs() > TUNING.along);
    let (mut along, free): (Vec<Axis>, Vec<Axis>) = axes.into_iter().partition(is_along);
    let step = TUNING.grid_step * turning.reach;
    for direction in &turning.facing {
        // only the near side of what turns was seen: the axis lies behind its middle
        let behind = -(turning.eye - direction * direction.dot(&turning.eye));
        let Some(behind) = behind.try_normalize(f64::MIN_POSITIVE) else { continue };
        let beside = direction.cross(&behind);
        let [nearest, farthest] = TUNING.grid_behind;
        for (a, b) in (nearest..=farthest).flat_map(|a| (-TUNING.grid_half..=TUNING.grid_half).map(move |b| (a, b))) {
            let point = behind * (f64::from(a) * step) + beside * (f64::from(b) * step);
            along.push(Axis { point, direction: *direction });
        }
    }
    Proposed { along, free }
}

/// All angles of all pairs about an axis that may be off by `slack`, and of them those that all pairs together bear out best.
fn assembled(turning: &Turning, axis: &Axis, slack: f64) -> Turned {
    let n = turning.views.len();
    let mut turns: Turns = vec![vec![[0.0; STEPS]; n]; n];
    let [least, most] = TUNING.pair_samples;
    let samples = (TUNING.samples / all_pairs(n).count().max(1)).clamp(least, most);
    for (i, j) in all_pairs(n) {
        for step in 0..STEPS {
            let said = turning.agreement_within(i, j, &axis.turn(step_angle(step)), samples, slack);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::Fixture;
    use crate::global::verification::PairVotes;
    use crate::sensor::turning::balls;
    use visage_geometry::Motion;

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
    fn axes_are_tried_well_behind_the_near_side_that_was_seen() {
        let turning = balls::turning(&Vector3::y(), &[0.0, 0.7]);
        let behind = -turning.eye.normalize();
        let along = proposed(&turning, &[], 2.0).along;
        let (nearest, farthest) = along
            .iter()
            .filter(|axis| axis.direction.y.abs() > 0.999)
            .map(|axis| axis.point.dot(&behind) / turning.reach)
            .fold((0.0f64, 0.0f64), |(least, most), at| (least.min(at), most.max(at)));
        assert!(nearest < -0.15 && farthest > 0.7, "{nearest} to {farthest}");
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
        let silent = |_: &Component| 0.0;
        assert!(is_seconded(&coarse_set, silent, &all, &found(turned.clone())));
        assert!(!is_seconded(&coarse_set, silent, &turned, &found(all.clone())));
        assert!(
            is_seconded(&coarse_set, silent, &turned, &found(component(all.local_poses[..2].to_vec()))),
            "one is open"
        );
        let for_turned = |component: &Component| if *component == turned { 1e3 } else { 0.0 };
        assert!(is_seconded(&coarse_set, for_turned, &turned, &found(all.clone())), "pictures say so much more");
    }
}
