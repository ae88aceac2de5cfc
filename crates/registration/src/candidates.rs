//! Which pairs of views can overlap at all: bounding volumes before any search of neighbours.
//!
//! The world is cut into cells of four tolerances. A view *touches* every cell that a ball of one tolerance round one of
//! its points reaches; where none of a view's points lies in a cell that another view touches, the two have no
//! counterpart within the tolerance. The work grows with the views that share cells, not with all pairs.

use rayon::prelude::*;

use visage_geometry::Motion;
use visage_geometry::neighbours::LocalPoint;

/// A cell of the world's grid.
type Cell = [i64; 3];

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Cell edge in tolerances: wider ones hold more views that don't meet, narrower ones are touched more often.
        edge: f64 = 4.0,
    }
}

/// The ordered pairs `(i, j)`, `i != j`, of which a point of `queries[i]` may lie within `tolerance` of a point of
/// `targets[j]`, in lexicographic order. Points are in local frames, `local_poses` map those to the world.
pub fn candidate_pairs(
    targets: &[&[LocalPoint]],
    queries: &[&[LocalPoint]],
    local_poses: &[Motion],
    tolerance: f64,
) -> Vec<(usize, usize)> {
    let n = targets.len();
    let edge = (TUNING.edge * tolerance).max(f64::MIN_POSITIVE);
    let touched: Vec<Vec<Cell>> =
        targets.par_iter().zip(local_poses).map(|(points, pose)| cells(points, pose, tolerance, edge)).collect();
    let mut touched: Vec<(Cell, u32)> =
        touched.iter().zip(0u32..).flat_map(|(cells, view)| cells.iter().map(move |cell| (*cell, view))).collect();
    touched.par_sort_unstable();
    queries
        .par_iter()
        .zip(local_poses)
        .enumerate()
        .map(|(i, (points, pose))| {
            let mut meets = vec![false; n];
            for cell in &cells(points, pose, 0.0, edge) {
                let first = touched.partition_point(|(other, _)| other < cell);
                for (_, j) in touched[first..].iter().take_while(|(other, _)| other == cell) {
                    meets[*j as usize] = true;
                }
            }
            (0..n).filter(|&j| j != i && meets[j]).map(|j| (i, j)).collect::<Vec<_>>()
        })
        .collect::<Vec<_>>()
        .concat()
}

/// The cells within `reach` of a point, each once, sorted.
fn cells(points: &[LocalPoint], pose: &Motion, reach: f64, edge: f64) -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut last = None;
    for point in points {
        let world = pose * nalgebra::Point3::from(*point).cast::<f64>();
        let cell = |shift: f64| world.coords.add_scalar(shift).map(|x| (x / edge).floor() as i64);
        let corners = (cell(-reach), cell(reach));
        // scanners write neighbours one after the other
        if last.replace(corners) == Some(corners) {
            continue;
        }
        let (low, high) = corners;
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                cells.extend((low.z..=high.z).map(|z| [x, y, z]));
            }
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A patch of 10 x 10 points with step 1.
    fn patch() -> Vec<LocalPoint> {
        (0..100).map(|k| [(k % 10) as f32, (k / 10) as f32, 0.0]).collect()
    }

    fn pairs_of(points: &[&[LocalPoint]], poses: &[Motion], tolerance: f64) -> Vec<(usize, usize)> {
        candidate_pairs(points, points, poses, tolerance)
    }

    fn at(x: f64) -> Motion {
        Motion::translation(x, 0.0, 0.0)
    }

    #[test]
    fn views_that_touch_are_candidates_and_distant_ones_are_not() {
        let patch = patch();
        // the first two lie side by side, 0.9 apart; the third is far off
        let poses = [at(0.0), at(9.9), at(50.0)];
        assert_eq!(pairs_of(&[&patch, &patch, &patch], &poses, 1.0), [(0, 1), (1, 0)]);
    }

    #[test]
    fn no_pair_with_a_counterpart_is_left_out() {
        let patch = patch();
        for step in 0..60 {
            let shift = f64::from(step) * 0.2;
            let pairs = pairs_of(&[&patch, &patch], &[at(-3.3), at(shift - 3.3)], 0.7);
            let gap = (shift - 9.0).max(0.0);
            assert!(gap >= 0.7 || pairs.len() == 2, "{shift}: {pairs:?}");
        }
    }

    #[test]
    fn a_ring_of_views_has_a_ring_of_pairs() {
        let patch = patch();
        let poses: Vec<Motion> = (0..200).map(|k| at(8.0 * f64::from(k))).collect();
        let pairs = pairs_of(&vec![patch.as_slice(); 200], &poses, 0.5);
        assert_eq!(pairs.len(), 2 * 199);
    }
}
