//! Figures of merit of a registration at full resolution, for comparing methods on the same scans.
//!
//! Over chosen pairs (i, j), with fixed shares xi so that every method is scored on the same number of points. In a
//! direction a -> b, `d` is the distance of a's point, moved into b, from its nearest point of b; the `floor(xi_ab n_a)`
//! points of smallest d are kept. Everything is pooled over all pairs.

use rayon::prelude::*;

use crate::view::View;
use visage_geometry::Motion;
use visage_geometry::neighbours::{LocalPoint, Neighbour};
use visage_geometry::normals::{LocalPlane, NEIGHBOURS, local_planes};

/// A pair that is scored, with the shares of points to keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoredPair {
    /// The pair's views.
    pub views: (usize, usize),
    /// xi_ij and xi_ji.
    pub overlaps: (f64, f64),
}

/// Root mean squares, lengths in the scans' unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Objective {
    /// Of d over the kept points i -> j whose nearest point's own nearest point they are.
    pub mutual: f64,
    /// Of d over the kept points of both directions (the objective of trimmed ICP).
    pub trim: f64,
    /// Of the distance from the tangent plane (12 neighbours) at the nearest point, both directions.
    pub plane: f64,
}

#[derive(Default)]
struct Sums {
    squares: f64,
    count: f64,
}

impl Sums {
    fn add(&mut self, squares: f64, count: usize) {
        self.squares += squares;
        self.count += count as f64;
    }

    fn rms(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }
}

/// Scores `local_poses` (local frame to world) over `pairs`.
pub fn objective(views: &[View], local_poses: &[Motion], pairs: &[ScoredPair]) -> Objective {
    let planes: Vec<Vec<LocalPlane>> =
        views.iter().map(|view| local_planes(&view.indexed, view.points(), NEIGHBOURS)).collect();
    let (mut mutual, mut trim, mut plane) = (Sums::default(), Sums::default(), Sums::default());
    for pair in pairs {
        let (i, j) = pair.views;
        let j_from_i = local_poses[j].inv_mul(&local_poses[i]);
        let forward = nearest(&views[i], &views[j], &j_from_i);
        let backward = nearest(&views[j], &views[i], &j_from_i.inverse());
        let directions =
            [(i, j, j_from_i, &forward, pair.overlaps.0), (j, i, j_from_i.inverse(), &backward, pair.overlaps.1)];
        for (a, b, b_from_a, found, overlap) in directions {
            let kept = kept(found, overlap);
            trim.add(kept.iter().map(|&k| f64::from(found[k].distance2)).sum(), kept.len());
            let off_plane = |k: &usize| {
                let target = found[*k].index as usize;
                let moved = b_from_a * point(&views[a].points()[*k]);
                let normal = nalgebra::Vector3::from(planes[b][target].normal).cast::<f64>();
                normal.dot(&(moved - point(&views[b].points()[target]))).powi(2)
            };
            plane.add(kept.iter().map(off_plane).sum(), kept.len());
            if a == i {
                let both = kept.iter().filter(|k| backward[found[**k].index as usize].index as usize == **k);
                let (squares, count) = both.fold((0.0, 0), |(sum, n), k| (sum + f64::from(found[*k].distance2), n + 1));
                mutual.add(squares, count);
            }
        }
    }
    Objective { mutual: mutual.rms(), trim: trim.rms(), plane: plane.rms() }
}

fn point(local: &LocalPoint) -> nalgebra::Point3<f64> {
    nalgebra::Point3::from(*local).cast::<f64>()
}

/// For each point of `a` its nearest point in `b`.
fn nearest(a: &View, b: &View, b_from_a: &Motion) -> Vec<Neighbour> {
    a.points()
        .par_iter()
        .with_min_len(1024)
        .map(|local| {
            let moved: LocalPoint = (b_from_a * point(local)).cast::<f32>().coords.into();
            let none = Neighbour { index: 0, distance2: f32::INFINITY };
            b.indexed.tree.nearest(&moved, f32::INFINITY).unwrap_or(none)
        })
        .collect()
}

/// The indices of the points of smallest distance that `overlap` keeps, in ascending order.
fn kept(found: &[Neighbour], overlap: f64) -> Vec<usize> {
    let count = ((overlap * found.len() as f64).floor() as usize).min(found.len());
    let mut order: Vec<usize> = (0..found.len()).collect();
    if count > 0 && count < found.len() {
        order.select_nth_unstable_by(count - 1, |a, b| {
            found[*a].distance2.total_cmp(&found[*b].distance2).then(a.cmp(b))
        });
    }
    order.truncate(count);
    order.sort_unstable();
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3, Vector3};

    #[test]
    fn two_sheets_one_above_the_other() {
        let sheet: Vec<Point3> = (0..400).map(|k| Point3::new((k % 20) as f64, (k / 20) as f64, 0.0)).collect();
        let view = View::new(&Cloud::from_points(sheet)).expect("a sheet can be used");
        let views = [view.clone(), view];
        let poses = [Motion::identity(), Motion::translation(0.3, 0.0, 0.4)];
        let pair = ScoredPair { views: (0, 1), overlaps: (1.0, 0.5) };
        let scored = objective(&views, &poses, &[pair]);
        assert!((scored.trim - 0.5).abs() < 1e-5, "{scored:?}");
        assert!((scored.mutual - 0.5).abs() < 1e-5, "{scored:?}");
        assert!((scored.plane - 0.4).abs() < 1e-5, "{scored:?}");
        let lifted = [poses[0], Motion::from(nalgebra::Translation3::from(Vector3::z()))];
        assert!(objective(&views, &lifted, &[pair]).plane > 0.99);
    }
}
