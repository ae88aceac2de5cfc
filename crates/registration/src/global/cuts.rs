//! What speaks against holding a refined component together.
//!
//! Components grow pair by pair, and each pair is asked where it fits best. Once all poses are refined at once, every pair
//! stands where the whole has it, and what all pairs between two parts say may speak against them: then one of the parts lies
//! wrong, however well its own views fit each other.

use super::coarse_view::CoarseView;
use super::verification::PairVotes;
use crate::view_graph::all_pairs;
use visage_geometry::{Motion, UnionFind};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Parts do not hold together if the balance of all pairs between them is below this share of what the pairs say: views
        /// that lay right had -0.1 at times, seldom -0.7, where light does not come back and what was seen counts as missed;
        /// wrong ones mostly -0.4 to -4.
        least: f64 = -0.2,
    }
}

/// How much speaks for each pair of views where they stand.
struct Balances {
    /// `of[i][j]`: agreeing surfels less what speaks against the pair, and all that was said.
    of: Vec<Vec<[f64; 2]>>,
}

/// The places of the views that hold together, in order: those that are left after parts were cut off which all pairs between them and
/// the rest speak against; the larger part stays. `said` is what all pairs say of `local_poses`, in lexicographic order.
pub fn holding(coarse_views: &[&CoarseView], local_poses: &[Motion], said: &[PairVotes]) -> Vec<usize> {
    let balances = Balances::of(coarse_views, local_poses, said);
    let mut kept: Vec<usize> = (0..coarse_views.len()).collect();
    while let Some(part) = balances.worst_part(&kept) {
        kept.retain(|view| !part.contains(view));
    }
    kept
}

impl Balances {
    fn of(coarse_views: &[&CoarseView], local_poses: &[Motion], said: &[PairVotes]) -> Self {
        let n = coarse_views.len();
        let mut of = vec![vec![[0.0; 2]; n]; n];
        for ((i, j), said) in all_pairs(n).zip(said) {
            let apart = local_poses[i].inv_mul(&local_poses[j]).translation.vector.norm();
            if apart <= coarse_views[i].radius + coarse_views[j].radius {
                let votes = said.both();
                (of[i][j], of[j][i]) = ([votes.balance(), votes.said()], [votes.balance(), votes.said()]);
            }
        }
        Balances { of }
    }

    /// Of the parts that a view, or a weak link, leaves on either side the smaller one of the cut that most speaks against, if
    /// anything does.
    fn worst_part(&self, kept: &[usize]) -> Option<Vec<usize>> {
        let with = |view: usize, others: &mut dyn Iterator<Item = &usize>| -> f64 {
            others.filter(|other| **other != view).map(|other| self.of[view][*other][0]).sum()
        };
        // a link of the tree may take views along for which the rest speaks more
        let without_strays = |part: Vec<usize>| -> Vec<usize> {
            let is_of_part = |view: &usize| {
                let rest = with(*view, &mut kept.iter().filter(|other| !part.contains(other)));
                rest <= with(*view, &mut part.iter())
            };
            part.iter().copied().filter(is_of_part).collect()
        };
        let against = |part: Vec<usize>| {
            let across =
                part.iter().flat_map(|i| kept.iter().map(move |j| (*i, *j))).filter(|(_, j)| !part.contains(j));
            let [balance, said] = across.fold([0.0; 2], |sum, (i, j)| {
                let [balance, said] = self.of[i][j];
                [sum[0] + balance, sum[1] + said]
            });
            (balance - TUNING.least * said, part)
        };
        let parts = kept.iter().map(|view| vec![*view]).chain(self.sides(kept));
        let parts = parts.map(without_strays);
        let parts = parts.filter(|part| !part.is_empty() && 2 * part.len() <= kept.len() && kept.len() > 2);
        let worst = parts.map(against).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.len().cmp(&b.1.len())))?;
        (worst.0 < 0.0).then_some(worst.1)
    }

    /// The smaller sides of the links of the tree that holds the views by the pairs of which most speaks.
    fn sides(&self, kept: &[usize]) -> Vec<Vec<usize>> {
        let mut pairs: Vec<(usize, usize)> = all_pairs(kept.len()).collect();
        let balance = |&(i, j): &(usize, usize)| self.of[kept[i]][kept[j]][0];
        pairs.sort_by(|a, b| balance(b).total_cmp(&balance(a)));
        let mut held = UnionFind::new(kept.len());
        let tree: Vec<(usize, usize)> = pairs.into_iter().filter(|(i, j)| held.join(*i, *j)).collect();
        let side = |cut: usize| {
            let mut sides = UnionFind::new(kept.len());
            let links = tree.iter().enumerate().filter(|(k, _)| *k != cut);
            links.for_each(|(_, (i, j))| {
                sides.join(*i, *j);
            });
            let is_there = |k: &usize| sides.find(*k) == sides.find(tree[cut].0);
            let (one, other): (Vec<usize>, Vec<usize>) = (0..kept.len()).partition(is_there);
            let smaller = if one.len() <= other.len() { one } else { other };
            smaller.into_iter().map(|k| kept[k]).collect()
        };
        (0..tree.len()).map(side).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};
    use crate::global::pose_support::pairs_said;

    fn held(fixture: &Fixture, local_poses: &[Motion]) -> Vec<usize> {
        let coarse_views: Vec<&CoarseView> = fixture.coarse_views.iter().collect();
        holding(&coarse_views, local_poses, &pairs_said(&coarse_views, local_poses, EDGE))
    }

    #[test]
    fn views_that_stand_right_hold_together_and_one_that_does_not_is_cut_off() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0, 120.0]);
        let mut poses: Vec<Motion> = (0..4).map(|view| fixture.i_from_j(0, view)).collect();
        assert_eq!(held(&fixture, &poses), [0, 1, 2, 3]);
        poses[2] = fixture.i_from_j_off(0, 2, [0.0; 3], [0.0, 0.0, 0.9]);
        assert_eq!(held(&fixture, &poses), [0, 1, 3]);
    }

    #[test]
    fn of_two_parts_that_speak_against_each_other_the_larger_stays() {
        let balances = |pairs: &[(usize, usize, f64)]| {
            let mut of = vec![vec![[0.0; 2]; 6]; 6];
            pairs.iter().for_each(|&(i, j, say)| (of[i][j], of[j][i]) = ([say, say.abs()], [say, say.abs()]));
            Balances { of }
        };
        let all = [0, 1, 2, 3, 4];
        let right = [(0, 1, 90.0), (1, 2, 80.0), (3, 4, 95.0), (2, 3, 20.0), (1, 3, -10.0)];
        assert_eq!(balances(&right).worst_part(&all), None);
        let torn = [(0, 1, 90.0), (1, 2, 80.0), (3, 4, 95.0), (2, 3, 20.0), (1, 3, -60.0)];
        assert_eq!(balances(&torn).worst_part(&all), Some(vec![3, 4]), "each has a neighbour that speaks for it");
        // the strongest link of 2 is to 3, but by all others it belongs to 0, 1 and 4
        let astray = [(0, 1, 90.0), (1, 4, 90.0), (3, 5, 95.0), (2, 3, 60.0), (3, 4, 40.0), (0, 3, -300.0)];
        let astray = [astray.as_slice(), &[(0, 2, 35.0), (1, 2, 35.0), (2, 4, 35.0)]].concat();
        assert_eq!(balances(&astray).worst_part(&[0, 1, 2, 3, 4, 5]), Some(vec![3, 5]));
    }
}
