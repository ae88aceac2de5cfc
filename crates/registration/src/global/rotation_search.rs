//! Motions from single matches: two surfels that look alike fix all but the turn about their normal, and all turns are
//! tried. On flat sides and thin walls few of the matches are right, and no consensus finds those.

use nalgebra::{IsometryMatrix3, Rotation3, Unit, Vector3};

use super::coarse_view::CoarseView;
use super::consensus::alike;
use super::hypothesis_score::{HypothesisScorer, WITNESSES};
use super::matching::Match;
use visage_geometry::Motion;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Turns tried for each match: what half a step moves at the far end of a view, drawing it onto the surface makes good.
        turns: usize = 36,
        /// Surfels of one view that are queried first of a motion,
        first: usize = 16,
        /// so many of which must agree, and more than conflict;
        first_agree: f32 = 3.0,
        /// and those of both views that are queried then.
        second: usize = 48,
        /// A motion of this strength
        least_strength: f32 = 0.02,
        /// is among those, so many at most, that are refined on the surface.
        finalists: usize = 300,
        /// Tolerance along the normal before that, in edges,
        loose: f32 = 1.3,
        /// and after it.
        close: f32 = 0.6,
        /// Motions that differ by less than this, in edges, are one: before,
        same_loose: f64 = 2.5,
        /// and after.
        same_close: f64 = 2.0,
    }
}

/// At most `count` motions (view j's local frame to view i's) that a match proposes and the surfaces bear out best, the
/// best first, no two of them alike.
pub fn rotation_search(
    i: &HypothesisScorer,
    j: &HypothesisScorer,
    matches: &[Match],
    edge: f64,
    count: usize,
) -> Vec<Motion> {
    let radius = j.coarse_view.radius;
    let turns = matches.iter().flat_map(|m| all_turns(i.coarse_view, j.coarse_view, m));
    let found = turns.filter_map(|motion| Some((strength_of_turn(i, j, &motion, edge as f32)?, motion.cast::<f64>())));
    let finalists = distinct(
        found.map(|(strength, m)| (strength, as_motion(&m))),
        radius,
        TUNING.same_loose * edge,
        TUNING.finalists,
    );
    let refined = finalists.iter().map(|motion| {
        let motion = j.refined(i, motion, edge as f32);
        (strength(i, j, &as_matrix(&motion), edge as f32, WITNESSES, TUNING.close), motion)
    });
    distinct(refined.filter(|(strength, _)| *strength > 0.0), radius, TUNING.same_close * edge, count)
}

/// The motions that bring the surfels of a match and their normals onto each other.
fn all_turns(i: &CoarseView, j: &CoarseView, m: &Match) -> impl Iterator<Item = IsometryMatrix3<f32>> {
    let (place_i, normal_i) = (i.position(m.of_i as usize), i.normals[m.of_i as usize]);
    let (place_j, normal_j) = (j.position(m.of_j as usize), j.normals[m.of_j as usize]);
    let axis = Unit::new_normalize(normal_i);
    let level = Rotation3::rotation_between(&normal_j, &normal_i)
        .unwrap_or_else(|| Rotation3::from_axis_angle(&perpendicular(&axis), std::f32::consts::PI));
    (0..TUNING.turns).map(move |turn| {
        let angle = turn as f32 * std::f32::consts::TAU / TUNING.turns as f32;
        let rotation = Rotation3::from_axis_angle(&axis, angle) * level;
        IsometryMatrix3::from_parts((place_i - rotation * place_j).into(), rotation)
    })
}

/// How much speaks for a turn; `None` if too little does. Most are done with after a few surfels.
fn strength_of_turn(
    i: &HypothesisScorer,
    j: &HypothesisScorer,
    motion: &IsometryMatrix3<f32>,
    edge: f32,
) -> Option<f32> {
    let first = j.look(0..TUNING.first, i, motion, edge, TUNING.loose * edge);
    if first.agree < TUNING.first_agree || first.agree < first.conflict {
        return None;
    }
    Some(strength(i, j, motion, edge, TUNING.second, TUNING.loose)).filter(|strength| *strength > TUNING.least_strength)
}

/// The lesser of what both views say.
fn strength(
    i: &HypothesisScorer,
    j: &HypothesisScorer,
    motion: &IsometryMatrix3<f32>,
    edge: f32,
    queried: usize,
    tolerance: f32,
) -> f32 {
    let there = j.look(0..queried, i, motion, edge, tolerance * edge).strength();
    if there > 0.0 {
        there.min(i.look(0..queried, j, &motion.inverse(), edge, tolerance * edge).strength())
    } else {
        0.0
    }
}

/// The `count` strongest, no two of them alike; of equals the one that came first.
fn distinct(found: impl Iterator<Item = (f32, Motion)>, radius: f64, tolerance: f64, count: usize) -> Vec<Motion> {
    let mut found: Vec<(f32, Motion)> = found.collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<Motion> = Vec::new();
    for (_, motion) in found {
        if kept.len() == count {
            break;
        }
        if !kept.iter().any(|other| alike(other, &motion, radius, tolerance)) {
            kept.push(motion);
        }
    }
    kept
}

fn perpendicular(axis: &Vector3<f32>) -> Unit<Vector3<f32>> {
    let mut least = Vector3::zeros();
    least[axis.iamin()] = 1.0;
    Unit::new_normalize(axis.cross(&least))
}

fn as_motion(motion: &IsometryMatrix3<f64>) -> Motion {
    Motion::from_parts(motion.translation, nalgebra::UnitQuaternion::from_rotation_matrix(&motion.rotation))
}

fn as_matrix(motion: &Motion) -> IsometryMatrix3<f32> {
    let motion = motion.cast::<f32>();
    IsometryMatrix3::from_parts(motion.translation, motion.rotation.to_rotation_matrix())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Sensor;
    use crate::view::View;
    use visage_geometry::{Cloud, Point3};

    const EDGE: f64 = 3.0;

    #[test]
    fn one_right_match_among_wrong_ones_is_enough() {
        let bumpy = |x: f64, y: f64| 6.0 * (x / 7.0).sin() * (y / 9.0).cos() + 0.06 * x * (y / 20.0).sin();
        let window = |from: f64| {
            let places = (0..3600).map(|k| (from + f64::from(k % 60), f64::from(k / 60)));
            let points: Vec<Point3> = places.map(|(x, y)| Point3::new(x, y, bumpy(x, y))).collect();
            View::new(&Cloud::from_points(points)).expect("a sheet can be used")
        };
        let views = [window(0.0), window(25.0)];
        let [i, j] = [0, 1].map(|k| CoarseView::new(&views[k], EDGE, Some(Sensor::Toward(nalgebra::Vector3::z()))));
        let truth = Motion::from(nalgebra::Translation3::from(views[1].center - views[0].center));
        let nearest = |coarse_view: &CoarseView, place: nalgebra::Vector3<f64>| {
            let place = place.cast::<f32>();
            let distance = |k: &&u32| (coarse_view.position(**k as usize) - place).norm();
            *coarse_view.inner.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("surfels")
        };
        let mut matches: Vec<Match> =
            (0..20).map(|k| Match { of_i: i.inner[7 * k], of_j: j.inner[5 * k + 100], ratio: 1.0 }).collect();
        let of_j = nearest(&j, nalgebra::Vector3::new(-12.0, 3.0, 0.0));
        let of_i = nearest(&i, (truth * Point3::from(j.position(of_j as usize).cast::<f64>())).coords);
        matches.push(Match { of_i, of_j, ratio: 1.0 });
        let found =
            rotation_search(&HypothesisScorer::new(&i, EDGE), &HypothesisScorer::new(&j, EDGE), &matches, EDGE, 5);
        assert!(found.iter().any(|motion| alike(motion, &truth, j.radius, EDGE)), "{found:?}");
        assert!(
            rotation_search(&HypothesisScorer::new(&i, EDGE), &HypothesisScorer::new(&j, EDGE), &[], EDGE, 5)
                .is_empty()
        );
    }
}
