//! Low-rank and sparse decomposition of the matrix of relative motions (LRS-L1ALM): an alternative to averaging.
//!
//! The 4n x 4n matrix of all relative motions `M_ij = M_i^-1 M_j` has rank 4. Of the measured one some blocks are unknown
//! and some are wrong: `min ||W.*(X - E)||_1 + lambda ||V||_*  s.t. E = U V, U'U = I_4`, by augmented Lagrange
//! multipliers. Zheng, Liu, Sugimoto, Yan, Okutomi, "Practical low-rank matrix approximation under robust L1-norm", CVPR
//! 2012; for motions: Arrigoni, Rossi, Fusiello, "Global registration of 3D point sets via LRS decomposition", ECCV 2016.
//!
//! The problem is not convex, and the quick schedules of mu fail now and then. So the iteration begins at the matrix of
//! the poses at hand, with a mu that belongs to what they leave over; its answer is checked; an answer that is no motions,
//! or that fits worse than the poses did, is thrown away, and the slow schedule runs from a seeded start. If that fails
//! too, the caller is told so.

use nalgebra::{DMatrix, Dyn, Matrix3, Matrix4, OMatrix, U4};
use rand::{RngExt, SeedableRng};

use crate::averaging::motion_averaging::{RelativeMotion, disagreements};
use visage_geometry::{Motion, UnionFind};

/// What the decomposition found.
#[derive(Debug, Clone, PartialEq)]
pub struct LowRank {
    /// Poses (frame to world); anchors as they were.
    pub poses: Vec<Motion>,
    /// For each relative motion how far it disagrees with the poses (a length).
    pub disagreements: Vec<f64>,
    /// Updates of U and V made.
    pub steps: usize,
}

/// Why there are no poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LowRankError {
    /// A view is joined to no anchor.
    #[error("the relative motions do not determine every pose")]
    Undetermined,
    /// Neither start led to rigid motions that fit the relative motions as well as the poses given.
    #[error("the decomposition did not converge to rigid motions")]
    NotConverged,
}

type Tall = OMatrix<f64, Dyn, U4>;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Weight of the nuclear norm.
        lambda: f64 = 1e-3,
        /// Growth of mu from one outer step to the next: where nothing is known,
        cold_growth: f64 = 1.05,
        /// and, quicker, from the poses at hand.
        warm_growth: f64 = 1.2,
        /// Where mu stops growing.
        largest_mu: f64 = 1e20,
        /// mu of the start that knows nothing.
        cold_mu: f64 = 1e-6,
        /// mu of the start at the poses, times the largest entry that they leave over: a tenth, so that at first nothing is
        /// taken for an outlier.
        warm_mu: f64 = 0.1,
        /// No residual is taken for smaller than this, in radii: rounding.
        least_residual: f64 = 1e-6,
        /// Both the split `E = U V` (outer) and the change of E (inner) end below this, relative to the norm of X, where nothing is
        /// known,
        cold_tolerance: f64 = 1e-8,
        /// and below this within a loop: some 1e-5 of the object's radius is enough there.
        warm_tolerance: f64 = 1e-6,
        /// Outer steps at most,
        max_outer: usize = 1500,
        /// and inner ones in each.
        max_inner: usize = 100,
        /// Of the start that knows nothing.
        seed: u64 = 4,
        /// An answer may disagree with the relative motions by this much more than the poses did: entries of matrices, which
        /// the decomposition minimises, are not quite the twists that are compared.
        worse: f64 = 1.1,
        /// Singular values of a rotation are 1 up to this.
        rigid: f64 = 0.1,
    }
}

/// Poses that agree with most of the `relative` motions, beginning at `poses`.
///
/// `anchors` keep their pose: one view in each connected piece of the graph. `radius` makes translations comparable with
/// rotations.
pub fn decompose(
    poses: &[Motion],
    relative: &[RelativeMotion],
    anchors: &[usize],
    radius: f64,
) -> Result<LowRank, LowRankError> {
    let mut groups = UnionFind::new(poses.len());
    for pair in relative {
        groups.join(pair.i, pair.j);
    }
    let mut found = LowRank { poses: poses.to_vec(), disagreements: Vec::new(), steps: 0 };
    let mut held = 0;
    for &anchor in anchors {
        let root = groups.find(anchor);
        let mut members: Vec<usize> = (0..poses.len()).filter(|&view| groups.find(view) == root).collect();
        held += members.len();
        members.sort_by_key(|view| (*view != anchor, *view));
        if members.len() > 1 {
            let piece = Piece::new(&members, poses, relative, radius);
            let (moved, steps) = piece.solve().ok_or(LowRankError::NotConverged)?;
            found.steps += steps;
            for (view, pose) in members.iter().zip(moved).skip(1) {
                found.poses[*view] = pose;
            }
        }
    }
    if held != poses.len() {
        return Err(LowRankError::Undetermined);
    }
    found.disagreements = disagreements(&found.poses, relative, radius);
    Ok(found)
}

/// A connected piece of the graph; its first view is the anchor, views are counted within it.
struct Piece {
    poses: Vec<Motion>,
    relative: Vec<RelativeMotion>,
    radius: f64,
    /// X: the known blocks, translations in radii.
    measured: DMatrix<f64>,
    /// W, by blocks.
    known: DMatrix<bool>,
}

/// Where the iteration is.
struct Split {
    full: DMatrix<f64>,
    left: Tall,
    /// V', so that it is tall like U.
    right: Tall,
    multipliers: DMatrix<f64>,
    mu: f64,
    growth: f64,
    tolerance: f64,
}

impl Piece {
    fn new(members: &[usize], poses: &[Motion], relative: &[RelativeMotion], radius: f64) -> Self {
        let place = |view: usize| members.iter().position(|member| *member == view);
        let relative: Vec<RelativeMotion> = relative
            .iter()
            .filter_map(|pair| Some(RelativeMotion { i: place(pair.i)?, j: place(pair.j)?, ..pair.clone() }))
            .collect();
        let n = members.len();
        let mut measured = DMatrix::identity(4 * n, 4 * n);
        let mut known = DMatrix::from_fn(n, n, |i, j| i == j);
        for pair in &relative {
            for (i, j, motion) in [(pair.i, pair.j, pair.i_from_j), (pair.j, pair.i, pair.i_from_j.inverse())] {
                measured.fixed_view_mut::<4, 4>(4 * i, 4 * j).copy_from(&scaled(&motion, radius));
                known[(i, j)] = true;
            }
        }
        Piece { poses: members.iter().map(|view| poses[*view]).collect(), relative, radius, measured, known }
    }

    /// Poses of the piece's views and the steps it took, from the first start that leads to sound ones.
    fn solve(&self) -> Option<(Vec<Motion>, usize)> {
        let mut steps = 0;
        for mut split in [self.at_the_poses(), self.at_random()] {
            let converged = self.iterate(&mut split, &mut steps);
            if let Some(poses) = converged.then(|| self.motions(&split)).flatten()
                && self.disagreement(&poses)
                    <= TUNING.worse * self.disagreement(&self.poses) + TUNING.least_residual * self.radius
            {
                return Some((poses, steps));
            }
        }
        None
    }

    fn disagreement(&self, poses: &[Motion]) -> f64 {
        disagreements(poses, &self.relative, self.radius).iter().sum()
    }

    /// The start at the poses at hand, whose matrix is of rank 4 already.
    fn at_the_poses(&self) -> Split {
        let n = self.poses.len();
        let (mut rows, mut columns) = (Tall::zeros(4 * n), Tall::zeros(4 * n));
        for (view, pose) in self.poses.iter().enumerate() {
            rows.fixed_view_mut::<4, 4>(4 * view, 0).copy_from(&scaled(&pose.inverse(), self.radius));
            columns.fixed_view_mut::<4, 4>(4 * view, 0).copy_from(&scaled(pose, self.radius).transpose());
        }
        let full = &rows * columns.transpose();
        let residual = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|block| self.known[*block]);
        let largest = residual
            .map(|(i, j)| {
                let difference = self.measured.fixed_view::<4, 4>(4 * i, 4 * j) - full.fixed_view::<4, 4>(4 * i, 4 * j);
                difference.amax()
            })
            .fold(TUNING.least_residual, f64::max);
        // the multipliers start at 0, so U need not be orthonormal yet: the first step makes it so
        Split {
            multipliers: DMatrix::zeros(4 * n, 4 * n),
            full,
            left: rows,
            right: columns,
            mu: TUNING.warm_mu / largest,
            growth: TUNING.warm_growth,
            tolerance: TUNING.warm_tolerance,
        }
    }

    /// The start that knows nothing: V from a seed.
    fn at_random(&self) -> Split {
        let n = self.poses.len();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(TUNING.seed);
        let right = Tall::from_fn(4 * n, |_, _| 2.0 * rng.random::<f64>() - 1.0);
        let zeros = DMatrix::zeros(4 * n, 4 * n);
        Split {
            full: self.measured.clone(),
            left: Tall::zeros(4 * n),
            right,
            multipliers: zeros,
            mu: TUNING.cold_mu,
            growth: TUNING.cold_growth,
            tolerance: TUNING.cold_tolerance,
        }
    }

    /// Augmented Lagrange multipliers; whether `E = U V` holds in the end.
    fn iterate(&self, split: &mut Split, steps: &mut usize) -> bool {
        let tolerance = split.tolerance * self.measured.norm();
        for _ in 0..TUNING.max_outer {
            for _ in 0..TUNING.max_inner {
                *steps += 1;
                let Some(change) = self.step(split) else { return false };
                if change < tolerance {
                    break;
                }
            }
            let gap = &split.full - &split.left * split.right.transpose();
            if gap.norm() < tolerance {
                return true;
            }
            split.multipliers += gap * split.mu;
            split.mu = (split.growth * split.mu).min(TUNING.largest_mu);
        }
        false
    }

    /// One update of U, V and E; how much E changed, or nothing if the numbers left all bounds.
    fn step(&self, split: &mut Split) -> Option<f64> {
        let Split { full, left, right, multipliers, mu, .. } = split;
        let shifted = &*full + &*multipliers / *mu;
        let svd = (&shifted * &*right).try_svd(true, true, f64::EPSILON, 0)?;
        *left = svd.u? * svd.v_t?;
        let svd = (shifted.tr_mul(left)).try_svd(true, true, f64::EPSILON, 0)?;
        let shrunk = svd.singular_values.map(|s| (s - TUNING.lambda / *mu).max(0.0));
        *right = svd.u? * DMatrix::from_diagonal(&shrunk) * svd.v_t?;
        let target = &*left * right.transpose() - &*multipliers / *mu;
        let mut change2 = 0.0;
        for ((row, column), known) in blocks(&self.known) {
            for (r, c) in (0..4).flat_map(|c| (0..4).map(move |r| (4 * row + r, 4 * column + c))) {
                let t = target[(r, c)];
                let x = self.measured[(r, c)];
                let value = if known { x - soft(x - t, 1.0 / *mu) } else { t };
                change2 += (value - full[(r, c)]).powi(2);
                full[(r, c)] = value;
            }
        }
        change2.is_finite().then(|| change2.sqrt())
    }

    /// The poses that the first block column of `U V` holds, or nothing if they are no rigid motions.
    fn motions(&self, split: &Split) -> Option<Vec<Motion>> {
        let column = &split.left * split.right.fixed_view::<4, 4>(0, 0).transpose();
        let first = column.fixed_view::<4, 4>(0, 0).try_inverse()?;
        let anchor = self.poses[0];
        (0..self.poses.len())
            .map(|view| {
                let block = column.fixed_view::<4, 4>(4 * view, 0) * first;
                Some(anchor * rigid(&(block / block[(3, 3)]), self.radius)?.inverse())
            })
            .collect()
    }
}

fn blocks(known: &DMatrix<bool>) -> impl Iterator<Item = ((usize, usize), bool)> {
    let rows = known.nrows();
    known.iter().enumerate().map(move |(index, known)| ((index % rows, index / rows), *known))
}

/// The homogeneous matrix with its translation divided by `radius`.
fn scaled(motion: &Motion, radius: f64) -> Matrix4<f64> {
    let mut matrix = motion.to_homogeneous();
    matrix.fixed_view_mut::<3, 1>(0, 3).scale_mut(1.0 / radius);
    matrix
}

fn soft(x: f64, threshold: f64) -> f64 {
    if x > threshold {
        x - threshold
    } else if x < -threshold {
        x + threshold
    } else {
        0.0
    }
}

/// The rigid motion nearest to a matrix (translation in radii) that has to be almost one.
fn rigid(matrix: &Matrix4<f64>, radius: f64) -> Option<Motion> {
    let svd = matrix.fixed_view::<3, 3>(0, 0).into_owned().svd(true, true);
    let sound = svd.singular_values.iter().all(|s| (s - 1.0).abs() < TUNING.rigid);
    let rotation: Matrix3<f64> = svd.u? * svd.v_t?;
    let translation = matrix.fixed_view::<3, 1>(0, 3) * radius;
    if !sound || rotation.determinant() < 0.0 || !translation.iter().all(|t| t.is_finite()) {
        return None;
    }
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(rotation);
    Some(Motion::from_parts(translation.into(), nalgebra::UnitQuaternion::from_rotation_matrix(&rotation)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Vector3, se3};

    const RADIUS: f64 = 80.0;

    fn random_motion(rng: &mut rand_chacha::ChaCha8Rng, shift: f64, angle: f64) -> Motion {
        let mut v =
            || Vector3::new(rng.random::<f64>(), rng.random::<f64>(), rng.random::<f64>()) * 2.0 - Vector3::repeat(1.0);
        Motion::new(v() * shift, v() * angle)
    }

    /// Ten views in a ring with chords, their relative motions exact but for `noise` (radians, and radii); the start is
    /// off by `off`.
    fn ring(noise: f64, off: f64) -> (Vec<Motion>, Vec<Motion>, Vec<RelativeMotion>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let truth: Vec<Motion> = (0..10).map(|_| random_motion(&mut rng, 60.0, 2.0)).collect();
        let start = truth
            .iter()
            .enumerate()
            .map(|(view, pose)| if view == 0 { *pose } else { random_motion(&mut rng, off * RADIUS, off) * pose });
        let start = start.collect();
        let pairs = (0..10).flat_map(|i| [(i, (i + 1) % 10), (i, (i + 2) % 10)]);
        let relative = pairs.map(|(i, j)| {
            let i_from_j = truth[i].inv_mul(&truth[j]) * random_motion(&mut rng, noise * RADIUS, noise);
            RelativeMotion { i, j, i_from_j, weight: 1.0 }
        });
        let relative = relative.collect();
        (truth, start, relative)
    }

    fn largest_error(found: &[Motion], truth: &[Motion]) -> f64 {
        let error = |(a, b): (&Motion, &Motion)| {
            let twist = se3::log(&(a * b.inverse()));
            twist.fixed_rows::<3>(0).norm() + RADIUS * twist.fixed_rows::<3>(3).norm()
        };
        found.iter().zip(truth).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn exact_motions_give_exact_poses() {
        let (truth, start, relative) = ring(0.0, 0.05);
        let found = decompose(&start, &relative, &[0], RADIUS).expect("converges");
        assert!(largest_error(&found.poses, &truth) < 1e-5 * RADIUS, "{}", largest_error(&found.poses, &truth));
        assert_eq!(found.poses[0], truth[0]);
    }

    #[test]
    fn two_wrong_pairs_change_nothing() {
        let (truth, start, mut relative) = ring(0.0, 0.05);
        for wrong in [4, 11] {
            relative[wrong].i_from_j *= Motion::new(Vector3::y() * 5.0, Vector3::z() * 30f64.to_radians());
        }
        let found = decompose(&start, &relative, &[0], RADIUS).expect("converges");
        assert!(largest_error(&found.poses, &truth) < 1e-3 * RADIUS, "{}", largest_error(&found.poses, &truth));
        assert!(found.disagreements[4] > 0.4 * RADIUS && found.disagreements[5] < 1e-3 * RADIUS);
    }

    #[test]
    fn both_starts_lead_to_the_same_poses() {
        let (truth, start, relative) = ring(0.003, 0.03);
        let piece = Piece::new(&(0..10).collect::<Vec<_>>(), &start, &relative, RADIUS);
        let (mut steps, mut warm, mut cold) = ((0, 0), piece.at_the_poses(), piece.at_random());
        assert!(piece.iterate(&mut warm, &mut steps.0) && piece.iterate(&mut cold, &mut steps.1));
        let (warm, cold) = (piece.motions(&warm).expect("rigid"), piece.motions(&cold).expect("rigid"));
        assert!(largest_error(&warm, &cold) < 1e-3 * RADIUS, "{}", largest_error(&warm, &cold));
        assert!(largest_error(&warm, &truth) < 0.02 * RADIUS, "{}", largest_error(&warm, &truth));
        assert!(3 * steps.0 < steps.1, "the poses are the shorter way: {steps:?}");
    }

    #[test]
    fn what_does_not_fit_is_said() {
        let (_, start, mut relative) = ring(0.0, 0.05);
        relative.retain(|pair| pair.i != 7 && pair.j != 7);
        assert_eq!(decompose(&start, &relative, &[0], RADIUS).err(), Some(LowRankError::Undetermined));
        assert!(decompose(&start, &relative, &[0, 7], RADIUS).is_ok(), "an anchor needs no pair");
    }
}
