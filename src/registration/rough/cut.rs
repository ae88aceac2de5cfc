//! Where a group would fall apart first, and what its parts say of each other.
//!
//! Views that are wrong together bear each other out. So not only each view is held against all others, but also each
//! cluster: the weakest links of the tree that holds the group together best cut it into clusters.

use crate::registration::view_graph::Groups;

/// What the two sides of a cut say of each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Surfels that agree across it, a view of the smaller side.
    pub agree: f64,
    /// Share of what is said across it that speaks against it.
    pub against: f64,
}

/// What views say of each other: for each pair how many surfels agree, and how many speak against their places.
#[derive(Debug, Clone)]
pub struct Sayings {
    n: usize,
    agree: Vec<f64>,
    against: Vec<f64>,
}

impl Sayings {
    /// Of `n` views that say nothing yet.
    pub fn of(n: usize) -> Self {
        Sayings { n, agree: vec![0.0; n * n], against: vec![0.0; n * n] }
    }

    /// Notes what a pair says.
    pub fn set(&mut self, i: usize, j: usize, agree: f64, against: f64) {
        for index in [i * self.n + j, j * self.n + i] {
            (self.agree[index], self.against[index]) = (agree, against);
        }
    }

    /// For each view the weakest of the cuts that part it from the greater half: least agreement, most against, each
    /// on its own.
    pub fn weakest_cuts(&self) -> Vec<Cut> {
        let mut weakest: Vec<Cut> = (0..self.n).map(|view| self.across(&[view])).collect();
        for side in self.sides().iter().filter(|side| 2 * side.len() <= self.n) {
            let cut = self.across(side);
            for &view in side {
                weakest[view].agree = weakest[view].agree.min(cut.agree);
                weakest[view].against = weakest[view].against.max(cut.against);
            }
        }
        weakest
    }

    /// What `side` and the others say of each other.
    fn across(&self, side: &[usize]) -> Cut {
        let others = || (0..self.n).filter(|other| !side.contains(other));
        let sum = |said: &[f64]| -> f64 {
            side.iter().map(|view| others().map(|other| said[view * self.n + other]).sum::<f64>()).sum()
        };
        let (agree, against) = (sum(&self.agree), sum(&self.against));
        Cut { agree: agree / side.len() as f64, against: against / (agree + against).max(1.0) }
    }

    /// Both sides of each link of the tree of greatest agreement.
    fn sides(&self) -> Vec<Vec<usize>> {
        let mut pairs: Vec<(usize, usize)> = (0..self.n).flat_map(|i| (i + 1..self.n).map(move |j| (i, j))).collect();
        let weight = |&(i, j): &(usize, usize)| self.agree[i * self.n + j];
        pairs.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.cmp(b)));
        let joined = |pairs: &[(usize, usize)]| {
            let mut groups = Groups::new(self.n);
            let tree: Vec<(usize, usize)> = pairs.iter().copied().filter(|&(i, j)| groups.join(i, j)).collect();
            (tree, groups.numbered())
        };
        let (tree, _) = joined(&pairs);
        let mut sides = Vec::new();
        for link in &tree {
            let rest: Vec<(usize, usize)> = tree.iter().copied().filter(|other| other != link).collect();
            let (_, pieces) = joined(&rest);
            let of = |piece: usize| (0..self.n).filter(|view| pieces[*view] == piece).collect::<Vec<usize>>();
            sides.extend([of(pieces[link.0]), of(pieces[link.1])]);
        }
        sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_clusters_are_cut_where_they_hang_together() {
        // 0, 1, 2 and 3, 4 agree among themselves; between them little agrees, and more speaks against it
        let mut sayings = Sayings::of(5);
        [(0, 1), (1, 2), (0, 2), (3, 4)].iter().for_each(|&(i, j)| sayings.set(i, j, 100.0, 0.0));
        sayings.set(2, 3, 10.0, 30.0);
        let cuts = sayings.weakest_cuts();
        assert_eq!(cuts[3], Cut { agree: 5.0, against: 0.75 });
        assert_eq!(cuts[4], Cut { agree: 5.0, against: 0.75 });
        assert_eq!(cuts[0], Cut { agree: 200.0, against: 0.0 });
        assert_eq!(cuts[2].against, 30.0 / 240.0);
        assert_eq!(Sayings::of(1).weakest_cuts().len(), 1);
    }
}
