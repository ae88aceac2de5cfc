//! How well each pose is known: a covariance that holds, from the correspondences at the final poses.
//!
//! The inverse of the normal matrix alone is too small: one patch of a scan takes part in the correspondences with
//! several views, in both directions, and what is wrong with it (noise, the grid, a bent normal) is wrong with all of
//! them; and the robust weights make the matrix larger than the gradient's derivative. So the covariance is the
//! cluster-robust sandwich of an M-estimator, `A^-1 (sum over c of g_c g_c') A^-1` (Huber 1967; Liang and Zeger 1986):
//! `A = a H` with the normal matrix H and the mean slope a of the robust residuals; a cluster c holds *all*
//! correspondences, of whatever views, in one cell of space, wide enough that what is wrong in one says little of the
//! next, and `g_c` is its share of the gradient over all unknowns. No noise model is needed. What is wrong with *all*
//! of a surface, such as the sag of averaged patches, is invisible to any of this and is added as `TUNING.systematic`.
//!
//! Frames: a twist is `(translation, rotation vector)` in the axes of the world, applied from the left, about the
//! view's own centroid at its pose: `p -> center + exp(w) (p - center) + t`. It is relative to the views that keep
//! their poses (view 0). Units: the scans' unit and radians.

mod evidence;
mod jackknife;
pub mod weak_axes;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix6, Vector6};
use rayon::prelude::*;

use self::evidence::{Cell, Correspondences, PairEvidence};
use crate::joint;
use crate::joint::surfels::{FineSurfels, Surfels};
use crate::least_squares::pose_system::{self, PoseSystem};
use crate::outcome::Outcome;
use crate::view::View;
use visage_geometry::se3::{self, Twist};
use visage_geometry::{Motion, Point3, Vector3};

/// How well one pose is known.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseCovariance {
    /// The view's centroid in the world, about which twists are taken.
    pub center: Point3,
    /// 6x6, translation first: squared lengths, lengths times radians, squared radians.
    pub covariance: Matrix6<f64>,
    /// What of that is not noise but common to whole sides of the object.
    pub systematic: Matrix6<f64>,
    /// Six independent twists, and of the information that holds the view along each the share that is real: normals
    /// have noise, and noise looks like relief. About 1 where there is relief; near 0 or below where there is none.
    pub evidence: [(f64, Twist); 6],
    /// The Gauss-Newton step from here; nothing to speak of if the joint cost is at rest.
    pub step: Twist,
    /// `q' extent q` is the mean squared displacement of the view's surface by a twist q.
    pub extent: Matrix6<f64>,
    /// Clusters that hold the view.
    pub clusters: usize,
}

impl PoseCovariance {
    /// Root mean square displacement of the view's surface by the step from here to where the joint cost is least.
    pub fn unrest(&self) -> f64 {
        self.step.dot(&(self.extent * self.step)).max(0.0).sqrt()
    }

    /// Root mean square displacement of the view's surface by one standard deviation of its pose.
    pub fn displacement(&self) -> f64 {
        (self.extent * self.covariance).trace().max(0.0).sqrt()
    }
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Residuals that are wrong in one way over whole sides of an object are not seen by the sandwich, since all poses
        /// yield to them: a surfel is the mean of a voxel and sags below a surface bent by the view's radius R, by up to
        /// `edge^2 / 12 R`, and not alike for views from different directions. This is the share of `edge^2 / R` that is wrong,
        /// times the root of the share of a view's correspondences that are wrong together. Set on code-made shapes for a last
        /// pass with the judged surfels' edge, and lessened with the square of the edge since; tested on other instances of
        /// them (`tests/truth.rs`).
        systematic: f64 = 0.006,
        /// Edge of a cluster's cell, in edges of the surfels' voxels.
        cell: f64 = 3.0,
        /// Below this share the covariance grows no more: the motion is free, and that is said by naming it.
        least_share: f64 = 0.1,
    }
}

/// How well the poses of all views are known.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// For each view the covariance of its pose; `None` for view 0, for views not joined to it, and where nothing can be said.
    pub covariances: Vec<Option<PoseCovariance>>,
    /// For each view the root mean square displacement of its surface, a length, by one standard deviation of its pose against
    /// the others as they stand, from one place of what holds it to another ([`jackknife`]); `None` where too little holds it.
    pub displacements: Vec<Option<f64>>,
}

/// How well the poses are known, from the surfels that the method left, else from ones as fine as `joint`'s.
pub fn of_result(views: &[View], result: &Outcome) -> Uncertainty {
    match &result.surfels {
        Some(surfels) => of_surfels(surfels, result),
        None => of_surfels(&joint::judged_surfels(views), result),
    }
}

fn of_surfels(FineSurfels { views: surfels, edge, reach, share }: &FineSurfels, result: &Outcome) -> Uncertainty {
    let pairs: Vec<(usize, usize)> = result
        .pairs
        .iter()
        .filter(|pair| result.placed[pair.i] && result.placed[pair.j])
        .flat_map(|pair| [(pair.i, pair.j), (pair.j, pair.i)])
        .collect();
    let columns = columns(&pairs, surfels.len());
    let middle = middle(&result.local_poses);
    let to_middle = nalgebra::Translation3::from(-middle);
    let poses: Vec<Motion> = result.local_poses.iter().map(|pose| to_middle * pose).collect();
    let correspondences = Correspondences::search(surfels, &poses, &pairs, *reach);
    let evidence = correspondences.by_pair(TUNING.cell * edge);
    let slope = mean_slope(&evidence);
    let extents: Vec<Matrix6<f64>> = surfels.iter().zip(&poses).map(|(surfels, pose)| extent(surfels, pose)).collect();
    let displacement = |view: usize| {
        let held = correspondences.of_view(view, &poses[view].translation.vector);
        jackknife::displacement(held, &extents[view], slope)
    };
    let displacements = (0..surfels.len()).into_par_iter().with_max_len(1).map(displacement).collect();
    let Some(inverse) = inverse_information(&evidence, &columns) else {
        return Uncertainty { covariances: vec![None; surfels.len()], displacements };
    };
    let clusters = clusters(&evidence);
    let estimate = |view: usize| {
        let row = inverse.fixed_rows::<6>(columns[view]?).into_owned();
        let block = |other: usize| columns[other].map_or_else(Matrix6::zeros, |k| row.fixed_columns::<6>(k).into());
        let blocks: Vec<Matrix6<f64>> = (0..surfels.len()).map(block).collect();
        let center = poses[view].translation.vector;
        let about_center = about(&center);
        let (meat, step) = pulls(&clusters, &blocks);
        let count = clusters.iter().filter(|cluster| cluster.1 == view).count();
        let reality = Reality::new(&evidence, &blocks, &blocks[view])?;
        let spread = about_center * reality.stretch();
        let sandwich = spread * meat * spread.transpose() * (share * small_sample(count) / (slope * slope));
        let weight: f64 = evidence.iter().filter(|e| e.a == view || e.b == view).map(|e| e.weight).sum();
        let sag = TUNING.systematic * edge * edge / surfels[view].radius;
        let systematic = spread * blocks[view] * spread.transpose() * (weight * sag * sag);
        Some(PoseCovariance {
            center: Point3::from(center + middle),
            covariance: sandwich + systematic,
            systematic,
            evidence: reality.twists().map(|(share, twist)| (share, about_center * twist)),
            step: about_center * step / slope,
            extent: extents[view],
            clusters: count,
        })
    };
    Uncertainty { covariances: (0..surfels.len()).map(estimate).collect(), displacements }
}

/// By how much less than its weight a residual changes the gradient, on average.
fn mean_slope(evidence: &[PairEvidence]) -> f64 {
    let (slope, weight) = evidence.iter().fold((0.0, 0.0), |(s, w), pair| (s + pair.slope, w + pair.weight));
    (slope / f64::max(weight, f64::MIN_POSITIVE)).clamp(0.2, 1.0)
}

/// The sum over the clusters of the outer product of what each moves the view by, and of what all do together.
fn pulls(clusters: &[Cluster], blocks: &[Matrix6<f64>]) -> (Matrix6<f64>, Twist) {
    let mut meat = Matrix6::zeros();
    let mut step = Vector6::zeros();
    for cluster in clusters.chunk_by(|a, b| a.0 == b.0) {
        let pull: Vector6<f64> = cluster.iter().map(|(_, view, gradient)| blocks[*view] * gradient).sum();
        meat += pull * pull.transpose();
        step -= pull;
    }
    (meat, step)
}

/// How much of the information about a view is real.
struct Reality {
    /// Turns coordinates in which the information is the identity into twists.
    root: Matrix6<f64>,
    inverse: Matrix6<f64>,
    /// Along its columns, in those coordinates, the real shares are these.
    axes: Matrix6<f64>,
    shares: Vector6<f64>,
}

impl Reality {
    fn new(evidence: &[PairEvidence], blocks: &[Matrix6<f64>], looseness: &Matrix6<f64>) -> Option<Self> {
        let mut clean = Matrix6::zeros();
        for pair in evidence {
            // how the pair's views move against each other when the view is pulled and all others yield
            let yielding = (blocks[pair.a] - blocks[pair.b]).transpose();
            clean += yielding.transpose() * pair.clean * yielding;
        }
        let root = looseness.cholesky()?.l();
        let inverse = root.try_inverse()?;
        let eigen = (inverse * clean * inverse.transpose()).symmetric_eigen();
        Some(Reality { root, inverse, axes: eigen.eigenvectors, shares: eigen.eigenvalues })
    }

    /// Twists that were divided by information that is not real, undone.
    fn stretch(&self) -> Matrix6<f64> {
        let factors = Matrix6::from_diagonal(&self.shares.map(|share| 1.0 / share.clamp(TUNING.least_share, 1.0)));
        self.root * self.axes * factors * self.axes.transpose() * self.inverse
    }

    fn twists(&self) -> [(f64, Twist); 6] {
        std::array::from_fn(|k| (self.shares[k], self.root * self.axes.column(k)))
    }
}

/// The covariance is itself an estimate from `clusters` terms: the ellipsoid that holds 95 % is larger than a known
/// covariance's by the ratio of Hotelling's `T^2(6, clusters)` to chi-squared (6), which is `m / (m - 9.1)` to 1 %
/// from m = 20 on.
fn small_sample(clusters: usize) -> f64 {
    let m = clusters as f64;
    if m > 12.0 { m / (m - 9.1) } else { 4.0 }
}

/// Where each view's six unknowns begin; the first view with a pair, to which the others are relative, and views
/// without one have none.
fn columns(pairs: &[(usize, usize)], n: usize) -> Vec<Option<usize>> {
    let reference = pairs.iter().map(|pair| pair.0).min();
    pose_system::columns::<6>(n, |view| Some(view) != reference && pairs.iter().any(|pair| pair.0 == view))
}

fn middle(poses: &[Motion]) -> Vector3 {
    poses.iter().map(|pose| pose.translation.vector).sum::<Vector3>() / poses.len().max(1) as f64
}

/// Turns a twist about the origin into the same twist about `center`.
fn about(center: &Vector3) -> Matrix6<f64> {
    let mut matrix = Matrix6::identity();
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&-se3::skew(center));
    matrix
}

fn inverse_information(evidence: &[PairEvidence], columns: &[Option<usize>]) -> Option<DMatrix<f64>> {
    let mut system = PoseSystem::<6, 1>::new(columns)?;
    for pair in evidence {
        system.add((pair.a, pair.b), &pair.information, &Vector6::zeros());
    }
    system.damped().inverse()
}

/// A view's part of a cluster: its share of the gradient.
type Cluster = (Cell, usize, Vector6<f64>);

/// What the correspondences in each cell say to each view, ordered by cell, then view.
fn clusters(evidence: &[PairEvidence]) -> Vec<Cluster> {
    let mut merged: BTreeMap<(Cell, usize), Vector6<f64>> = BTreeMap::new();
    let mut add = |cell: Cell, view: usize, gradient: Vector6<f64>| {
        merged.entry((cell, view)).and_modify(|sum| *sum += gradient).or_insert(gradient);
    };
    for pair in evidence {
        for (cell, gradient) in &pair.gradients {
            add(*cell, pair.a, *gradient);
            add(*cell, pair.b, -gradient);
        }
    }
    merged.into_iter().map(|((cell, view), gradient)| (cell, view, gradient)).collect()
}

/// `q' extent q`: the mean squared displacement of the view's surfels by a twist q about its centroid.
fn extent(surfels: &Surfels, pose: &Motion) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for &index in &surfels.inner {
        let arm = pose.rotation * nalgebra::Vector3::from(surfels.indexed.points[index as usize]).cast::<f64>();
        let mut moved = nalgebra::Matrix3x6::<f64>::zeros();
        moved.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        moved.fixed_view_mut::<3, 3>(0, 3).copy_from(&-se3::skew(&arm));
        sum += moved.transpose() * moved;
    }
    sum / surfels.inner.len().max(1) as f64
}
