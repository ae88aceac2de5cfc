//! The objective by which the paper compares methods (its Tables 1 and 2), as fitted to the figures it reports.
//!
//! The paper prints no definition. This one gives the figures of its method within a few percent at the poses that come
//! with the scans: for view i, d is the distance of a point from the nearest point of all other views together, and
//! `psi_i = min over xi in [0.4, 1] of (mean of the xi N smallest d^2) / xi^3`; Obj is the mean of psi_i.

use rayon::prelude::*;

use crate::view::View;
use visage_geometry::Motion;
use visage_geometry::neighbours::LocalPoint;

/// The paper runs on every 8th point.
pub const STRIDE: usize = 8;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The least share of points that counts.
        least_share: f64 = 0.4,
    }
}

/// Obj of `local_poses` (local frame to world), a squared length; infinite if a view has no other to be near to.
pub fn paper_objective(views: &[View], local_poses: &[Motion]) -> f64 {
    let psi: Vec<f64> =
        (0..views.len()).into_par_iter().map(|i| least_ratio(&mut nearest2(views, local_poses, i))).collect();
    psi.iter().sum::<f64>() / psi.len() as f64
}

/// For each point of view i its squared distance from the nearest point of the other views.
fn nearest2(views: &[View], local_poses: &[Motion], i: usize) -> Vec<f32> {
    // the views around the same place first: what they answer bounds the search in the others
    let apart = |j: usize| (local_poses[i].translation.vector - local_poses[j].translation.vector).norm();
    let mut others: Vec<usize> = (0..views.len()).filter(|&j| j != i).collect();
    others.sort_by(|&a, &b| apart(a).total_cmp(&apart(b)));
    let mut nearest = vec![f32::INFINITY; views[i].points().len()];
    for j in others {
        let j_from_i = local_poses[j].inv_mul(&local_poses[i]).cast::<f32>();
        for (point, nearest) in views[i].points().iter().zip(&mut nearest) {
            let moved: LocalPoint = (j_from_i * nalgebra::Point3::from(*point)).coords.into();
            if let Some(found) = views[j].indexed.tree.nearest(&moved, *nearest) {
                *nearest = found.distance2;
            }
        }
    }
    nearest
}

/// `min over k >= 0.4 N of (mean of the k smallest) / (k/N)^3`.
fn least_ratio(distances2: &mut [f32]) -> f64 {
    distances2.sort_unstable_by(f32::total_cmp);
    let n = distances2.len() as f64;
    let first = (TUNING.least_share * n).ceil() as usize;
    let mut least = f64::INFINITY;
    let mut sum = 0.0;
    for (index, distance2) in distances2.iter().enumerate() {
        sum += f64::from(*distance2);
        let count = index + 1;
        if count >= first {
            let share = count as f64 / n;
            least = least.min(sum / count as f64 / share.powi(3));
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3, Vector3};

    #[test]
    fn the_share_that_makes_the_ratio_least_is_taken() {
        // nine at 1, one far away: xi = 0.9 gives 1 / 0.729
        let mut distances2 = vec![1.0; 9];
        distances2.push(100.0);
        assert!((least_ratio(&mut distances2) - 1.0 / 0.729).abs() < 1e-6);
        // a few small ones are not enough: 0.4 is the least share
        let mut distances2 = [vec![0.0; 3], vec![1.0; 7]].concat();
        assert!((least_ratio(&mut distances2) - 0.7).abs() < 1e-6, "all ten: 0.7");
    }

    #[test]
    fn sheets_half_a_millimetre_apart() {
        let sheet = |z: f64| {
            let points = (0..400).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), z));
            View::new(&Cloud::from_points(points.collect())).expect("a sheet can be used")
        };
        let views = [sheet(0.0), sheet(0.5), sheet(5.0)];
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        // the first two have each other, the third has the second
        let expected = (0.25 + 0.25 + 4.5 * 4.5) / 3.0;
        assert!((paper_objective(&views, &poses) - expected).abs() < 1e-5);
        let moved: Vec<Motion> = poses.iter().map(|pose| Motion::translation(3.0, 4.0, 5.0) * pose).collect();
        assert!((paper_objective(&views, &moved) - expected).abs() < 1e-5, "where the world lies does not matter");
        let off = Vector3::new(0.0, 0.0, 0.5);
        let worse = [poses[0], Motion::translation(off.x, off.y, off.z) * poses[1], poses[2]];
        assert!(paper_objective(&views[..2], &worse[..2]) > 0.9);
    }
}
