//! Which pairs of views are registered with each other, and whether they hold all views together.

use crate::overlap::OverlapMatrix;
use visage_geometry::UnionFind;

/// The pairs chosen in one round.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewGraph {
    /// Pairs `(i, j)` with `i < j`, in lexicographic order.
    pub pairs: Vec<(usize, usize)>,
    /// The overlap a pair had to exceed in the end: xi_0, or lower if the graph would have been in pieces.
    pub min_overlap: f64,
    /// For each view the index of its connected piece; piece 0 holds view 0.
    pub pieces: Vec<usize>,
}

/// All pairs `(i, j)` of `n` views with `i < j`, in lexicographic order.
pub fn all_pairs(n: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..n).flat_map(move |i| (i + 1..n).map(move |j| (i, j)))
}

/// Below this overlap a pair is not believed, even if the graph stays in pieces without it.
pub const LEAST_OVERLAP: f64 = 0.1;

impl ViewGraph {
    /// All pairs whose mutual overlap exceeds `min_overlap`, and for each view at least its best `min_degree` pairs: a
    /// view that one pair alone holds goes wherever that pair goes. If they leave the views in pieces, the best pairs
    /// between pieces are added, as many as join them. No pair below [`LEAST_OVERLAP`] is taken.
    pub fn choose(overlaps: &OverlapMatrix, min_overlap: f64, min_degree: usize) -> Self {
        let n = overlaps.rows().len();
        let mut candidates: Vec<(usize, usize)> = all_pairs(n).collect();
        candidates.retain(|&(i, j)| overlaps.mutual(i, j) > min_overlap.min(LEAST_OVERLAP));
        candidates.sort_by(|&a, &b| overlaps.mutual(b.0, b.1).total_cmp(&overlaps.mutual(a.0, a.1)).then(a.cmp(&b)));

        let mut groups = UnionFind::new(n);
        let mut degrees = vec![0; n];
        let mut graph = ViewGraph { pairs: Vec::new(), min_overlap, pieces: Vec::new() };
        for (i, j) in candidates {
            let overlap = overlaps.mutual(i, j);
            let joins = groups.join(i, j);
            if overlap > min_overlap || joins || degrees[i] < min_degree || degrees[j] < min_degree {
                graph.pairs.push((i, j));
                graph.min_overlap = graph.min_overlap.min(overlap);
                degrees[i] += 1;
                degrees[j] += 1;
            }
        }
        graph.pairs.sort_unstable();
        graph.pieces = groups.numbered();
        graph
    }

    /// The number of connected pieces.
    pub fn piece_count(&self) -> usize {
        self.pieces.iter().max().map_or(0, |last| last + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(n: usize, entries: &[(usize, usize, f64)]) -> OverlapMatrix {
        let mut rows: Vec<Vec<f64>> = OverlapMatrix::identity(n).rows().to_vec();
        for &(i, j, share) in entries {
            rows[i][j] = share;
            rows[j][i] = share;
        }
        OverlapMatrix::from_rows(rows)
    }

    #[test]
    fn pairs_above_the_threshold_are_chosen() {
        let graph = ViewGraph::choose(&matrix(3, &[(0, 1, 0.8), (1, 2, 0.6), (0, 2, 0.3)]), 0.5, 0);
        assert_eq!(graph.pairs, [(0, 1), (1, 2)]);
        assert_eq!((graph.min_overlap, graph.piece_count()), (0.5, 1));
    }

    #[test]
    fn the_threshold_is_lowered_only_as_far_as_needed() {
        let graph = ViewGraph::choose(&matrix(4, &[(0, 1, 0.8), (1, 2, 0.4), (0, 2, 0.3), (2, 3, 0.7)]), 0.5, 0);
        assert_eq!(graph.pairs, [(0, 1), (1, 2), (2, 3)]);
        assert_eq!(graph.min_overlap, 0.4);
    }

    #[test]
    fn every_view_gets_its_partners() {
        let overlaps = matrix(4, &[(0, 1, 0.9), (0, 2, 0.8), (1, 2, 0.3), (2, 3, 0.25), (1, 3, 0.2), (0, 3, 0.05)]);
        let graph = ViewGraph::choose(&overlaps, 0.5, 2);
        assert_eq!(graph.pairs, [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)]);
    }

    #[test]
    fn views_that_share_nothing_stay_apart() {
        let graph = ViewGraph::choose(&matrix(3, &[(0, 2, 0.8), (1, 2, 0.05)]), 0.5, 2);
        assert_eq!(graph.pieces, [0, 1, 0]);
        assert_eq!(graph.pairs, [(0, 2)]);
    }
}
