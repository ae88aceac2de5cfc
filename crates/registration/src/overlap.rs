//! Directed overlap of pairs of views at their current poses.

use rayon::prelude::*;

use crate::candidates::candidate_pairs;
use visage_geometry::Motion;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};

use visage_geometry::progress::{Canceled, Progress};

/// `xi[i][j]`: the share of view i's points that have a counterpart in view j; 1 on the diagonal.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlapMatrix {
    shares: Vec<Vec<f64>>,
}

impl OverlapMatrix {
    /// The matrix of `n` views of which only the diagonal is known.
    pub fn identity(n: usize) -> Self {
        OverlapMatrix { shares: (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect() }
    }

    /// A matrix given row by row: square, one row a view.
    pub fn from_rows(shares: Vec<Vec<f64>>) -> Self {
        debug_assert!(shares.iter().all(|row| row.len() == shares.len()));
        OverlapMatrix { shares }
    }

    /// The share of view `i`'s points that have a counterpart in view `j`.
    pub fn directed(&self, i: usize, j: usize) -> f64 {
        self.shares[i][j]
    }

    /// The smaller of both directions: on it pairs are chosen.
    pub fn mutual(&self, i: usize, j: usize) -> f64 {
        self.shares[i][j].min(self.shares[j][i])
    }

    /// Corrects one share.
    pub fn set(&mut self, i: usize, j: usize, share: f64) {
        self.shares[i][j] = share;
    }

    /// The rows, for reports.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.shares
    }
}

/// Overlaps of all pairs at `local_poses` (local frame to world).
///
/// `targets[i]` are the points of view i, `queries[i]` points spread evenly over its surface, both in its local frame.
/// A query has a counterpart if a target of the other view lies nearer than `tolerance`. Pairs that can't have counterparts cost nothing ([`candidate_pairs`]).
pub fn overlaps(
    targets: &[&IndexedPoints],
    queries: &[&[LocalPoint]],
    local_poses: &[Motion],
    tolerance: f64,
    progress: &Progress,
) -> Result<OverlapMatrix, Canceled> {
    let n = targets.len();
    let target_points: Vec<&[LocalPoint]> = targets.iter().map(|target| target.points.as_slice()).collect();
    let pairs = candidate_pairs(&target_points, queries, local_poses, tolerance);
    let shares: Vec<f64> = pairs
        .par_iter()
        .map(|&(i, j)| {
            progress.check()?;
            Ok(directed_overlap(targets[j], queries[i], &local_poses[j].inv_mul(&local_poses[i]), tolerance))
        })
        .collect::<Result<_, Canceled>>()?;
    let mut matrix = OverlapMatrix::identity(n);
    for (&(i, j), share) in pairs.iter().zip(shares) {
        matrix.shares[i][j] = share;
    }
    Ok(matrix)
}

/// The share of `queries` (local frame of view i) with a point of view j nearer than `tolerance`;
/// `j_from_i` maps the local frame of i into that of j.
fn directed_overlap(view_j: &IndexedPoints, queries: &[LocalPoint], j_from_i: &Motion, tolerance: f64) -> f64 {
    if queries.is_empty() {
        return 0.0;
    }
    let motion = j_from_i.cast::<f32>();
    let tolerance2 = (tolerance * tolerance) as f32;
    let hits = queries
        .iter()
        .filter(|query| {
            let moved = motion * nalgebra::Point3::from(**query);
            view_j.tree.has_within(&moved.coords.into(), tolerance2)
        })
        .count();
    hits as f64 / queries.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::View;
    use visage_geometry::{Cloud, Point3};

    /// A sheet of `columns` by 20 points with step 1, its left edge at x = `from`.
    fn sheet(from: i32, columns: i32) -> View {
        let points = (0..20).flat_map(|y| (from..from + columns).map(move |x| Point3::new(x.into(), y.into(), 0.0)));
        View::new(&Cloud::from_points(points.collect())).expect("a sheet can be used")
    }

    #[test]
    fn overlap_is_directed() {
        // the second sheet is half as wide and lies within the first
        let views = [sheet(0, 20), sheet(10, 10), sheet(500, 20)];
        let targets: Vec<&IndexedPoints> = views.iter().map(|view| &view.indexed).collect();
        let queries: Vec<&[LocalPoint]> = views.iter().map(View::points).collect();
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        let xi = overlaps(&targets, &queries, &poses, 0.5, &Progress::silent()).expect("not canceled");
        assert_eq!(xi.directed(0, 1), 0.5);
        assert_eq!(xi.directed(1, 0), 1.0);
        assert_eq!(xi.mutual(0, 1), 0.5);
        assert_eq!(xi.directed(0, 2), 0.0);
        assert_eq!(xi.directed(0, 0), 1.0);
    }
}
