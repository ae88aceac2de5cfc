//! Which pairs of views are laid on each other: in a large set most see different things, and to try them all costs more than
//! all the rest.
//!
//! Some surfels of each view ask those of all other views what looks most like them, and vote for the few views that have
//! it: the usual retrieval step before images are matched. Every view then is matched with those that most speaks for,
//! and with those near it in the order of the views, if that says something ([`super::sequence`]).

use rayon::prelude::*;

use super::coarse_view::CoarseView;
use super::descriptor::Descriptors;
use super::hinted::Prior;
use super::sequence::Sequence;
use crate::view_graph::all_pairs;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Each view is matched with so many others, and with those that chose it. A set of so many views is matched in all pairs.
        partners: usize = 16,
        /// Surfels of a view that vote,
        voters: usize = 48,
        /// for so many views each,
        votes: usize = 8,
        /// and those that are looked at of each other view: descriptions change little from one surfel to the next.
        looked_at: usize = 120,
    }
}

/// Voters compared in one go.
const TOGETHER: usize = 4;

/// Whether so many views are too many for all pairs to be matched.
pub fn is_large(views: usize) -> bool {
    views > TUNING.partners + 1
}

/// The pairs (i < j) that are worth matching, in order.
pub fn likely_pairs(coarse_views: &[CoarseView], prior: &Prior) -> Vec<(usize, usize)> {
    let n = coarse_views.len();
    let all = all_pairs(n);
    if !is_large(n) {
        return all.collect();
    }
    let chosen = chosen_partners(coarse_views);
    let is_chosen = |i: usize, j: usize| chosen[i].contains(&j) || chosen[j].contains(&i);
    let sequence = Sequence::of(n, is_chosen);
    // known poses propose a motion of every pair, but most of them are apart
    let may_meet = |i: usize, j: usize| {
        let reach = coarse_views[i].radius + coarse_views[j].radius;
        prior.hinted.is_overlapping(i, j) || prior.proposed(i, j).any(|motion| motion.translation.vector.norm() < reach)
    };
    all.filter(|&(i, j)| is_chosen(i, j) || sequence.is_near(i, j) || may_meet(i, j)).collect()
}

/// For each view the others that most votes speak for, its own and theirs for it; of equals the first.
fn chosen_partners(coarse_views: &[CoarseView]) -> Vec<Vec<usize>> {
    let some = |count: usize| -> Vec<Descriptors> {
        coarse_views.par_iter().map(|coarse_view| coarse_view.descriptors.spread(count)).collect()
    };
    let (voters, looked_at) = (some(TUNING.voters), some(TUNING.looked_at));
    let votes: Vec<Vec<u32>> = (0..coarse_views.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|view| votes_of(view, &voters[view], &looked_at))
        .collect();
    let both = |i: usize, j: usize| votes[i][j] + votes[j][i];
    let chosen = |view: usize| {
        let mut others: Vec<usize> = (0..coarse_views.len()).filter(|other| *other != view).collect();
        others.sort_by_key(|other| std::cmp::Reverse(both(view, *other)));
        others.truncate(TUNING.partners);
        others
    };
    (0..coarse_views.len()).map(chosen).collect()
}

/// How many surfels of a view find what looks most like them in each of the others.
fn votes_of(view: usize, voters: &Descriptors, others: &[Descriptors]) -> Vec<u32> {
    // for each voter how far the most alike in each view is
    let mut nearest = vec![vec![f32::INFINITY; others.len()]; voters.count()];
    let mut rows: [Vec<f32>; TOGETHER] = Default::default();
    for (other, looked_at) in others.iter().enumerate().filter(|(other, _)| *other != view) {
        for first in (0..voters.count()).step_by(TOGETHER) {
            // a last few that are not full ask the last one again
            let at: [usize; TOGETHER] = std::array::from_fn(|k| (first + k).min(voters.count() - 1));
            looked_at.distances2(&at.map(|k| voters.get(k)), &mut rows);
            for (voter, row) in at.iter().zip(&rows) {
                nearest[*voter][other] = row.iter().copied().fold(f32::INFINITY, f32::min);
            }
        }
    }
    let mut votes = vec![0; others.len()];
    for nearest in &nearest {
        let mut sorted = nearest.clone();
        let (_, limit, _) = sorted.select_nth_unstable_by(TUNING.votes - 1, f32::total_cmp);
        let for_whom =
            nearest.iter().enumerate().filter(|(_, distance2)| **distance2 <= *limit && distance2.is_finite());
        for_whom.for_each(|(other, _)| votes[other] += 1);
    }
    votes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hinted::Hinted;
    use crate::sensor::Sensor;
    use crate::view::View;
    use visage_geometry::{Cloud, Motion, Point3, Vector3};

    /// Views of a long wavy ground, each showing 60 by 40 of it and half of what the one before shows; turned at random.
    fn along_the_ground(count: u32) -> Vec<CoarseView> {
        let height = |x: f64, y: f64| {
            4.0 * (0.17 * x).sin() * (0.21 * y + 0.0013 * x * x).cos() + 3.0 * (0.005 * x * x + 0.1 * y).sin()
        };
        let view = |k: u32| {
            let places = (0..2400).map(|p| (f64::from(30 * k + p % 60), f64::from(p / 60)));
            let turn = Motion::rotation(Vector3::new(0.9, f64::from(k), 0.3));
            let points: Vec<Point3> = places.map(|(x, y)| turn * Point3::new(x, y, height(x, y))).collect();
            let view = View::new(&Cloud::from_points(points)).expect("a sheet can be used");
            CoarseView::new(&view, 2.5, Some(Sensor::Toward(turn * Vector3::z())))
        };
        (0..count).map(view).collect()
    }

    #[test]
    fn in_a_large_set_neighbours_are_matched_and_most_pairs_are_not_whatever_the_order() {
        let coarse_views = along_the_ground(40);
        let none = Hinted::default();
        let prior = Prior { given: &[None; 40], hinted: &none, turning: None };
        let pairs = likely_pairs(&coarse_views, &prior);
        assert!(pairs.len() < 600, "{} of 780", pairs.len());
        let found = (1..40).filter(|k| pairs.contains(&(k - 1, *k))).count();
        assert!(found >= 36, "{found} of 39 neighbours");
        let shuffled: Vec<CoarseView> = (0..40).map(|k| coarse_views[k * 7 % 40].clone()).collect();
        let sorted = |i: usize, j: usize| (i.min(j), i.max(j));
        let mut again: Vec<(usize, usize)> =
            likely_pairs(&shuffled, &prior).into_iter().map(|(i, j)| sorted(i * 7 % 40, j * 7 % 40)).collect();
        again.sort_unstable();
        let same = again.iter().filter(|pair| pairs.contains(pair)).count();
        assert!(same as f64 > 0.95 * pairs.len() as f64, "{same} of {}: only ties depend on the order", pairs.len());
    }

    #[test]
    fn a_small_set_is_matched_in_all_pairs_and_known_poses_add_theirs() {
        let coarse_views = along_the_ground(TUNING.partners as u32 + 1);
        let none = Hinted::default();
        let prior = Prior { given: &[None; TUNING.partners + 1], hinted: &none, turning: None };
        assert_eq!(likely_pairs(&coarse_views, &prior).len(), TUNING.partners * (TUNING.partners + 1) / 2);
        let coarse_views = along_the_ground(40);
        let without = likely_pairs(&coarse_views, &Prior { given: &[None; 40], hinted: &none, turning: None });
        let apart = all_pairs(40).find(|pair| !without.contains(pair));
        let (i, j) = apart.expect("not all pairs are matched");
        let mut given = [None; 40];
        (given[i], given[j]) = (Some(Motion::identity()), Some(Motion::identity()));
        assert!(likely_pairs(&coarse_views, &Prior { given: &given, hinted: &none, turning: None }).contains(&(i, j)));
    }
}
