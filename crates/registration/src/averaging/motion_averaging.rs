//! Motion averaging on SE(3): poses that agree best with all relative motions at once [P3]-[P10].
//!
//! Govindu, "Lie-algebraic averaging for globally consistent motion estimation", CVPR 2004, with weights and a robust
//! kernel (Geman-McClure, its scale lowered step by step), so that one wrong pair can't bend the ring.

use nalgebra::Matrix1;

use crate::least_squares::pose_system::{PoseSystem, columns};
use crate::least_squares::robust_kernel::RobustKernel;
use visage_geometry::se3::{self, Twist};
use visage_geometry::{Motion, UnionFind};

/// A measured relative motion.
#[derive(Debug, Clone, PartialEq)]
pub struct RelativeMotion {
    /// The view whose frame is the target.
    pub i: usize,
    /// The view that is mapped.
    pub j: usize,
    /// `i_from_j` = M_ij: maps the frame of view j into the frame of view i.
    pub i_from_j: Motion,
    /// How much it counts, usually its overlap; positive.
    pub weight: f64,
}

/// How averaging weighs and stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AveragingOptions {
    /// The length by which rotations (radians) are made comparable with translations: the object's radius.
    pub radius: f64,
    /// Residuals below this length are noise: the robust kernel's scale never goes below it.
    pub noise: f64,
    /// Whether pairs that disagree lose weight.
    pub robust: bool,
}

/// What averaging did.
#[derive(Debug, Clone, PartialEq)]
pub struct Averaging {
    /// The averaged poses (frame to world); anchors as they were.
    pub poses: Vec<Motion>,
    /// For each relative motion, how far it disagrees with the averaged poses (a length).
    pub disagreements: Vec<f64>,
    /// For each relative motion its final robust weight relative to its own weight, in (0, 1].
    pub trusts: Vec<f64>,
    /// Linear solves made.
    pub rounds: usize,
}

/// The relative motions don't hold a view, or the weights are useless.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the relative motions do not determine every pose")]
pub struct Undetermined;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Linear solves at most.
        max_rounds: usize = 60,
        /// The squared scale of the robust kernel is divided by this in each round until it reaches its floor.
        scale_step: f64 = 2.0,
    }
}

/// Averages `relative` motions starting from `poses`.
///
/// `anchors` are the views that keep their pose: one in each connected piece of the graph of relative motions.
pub fn average(
    poses: &[Motion],
    relative: &[RelativeMotion],
    anchors: &[usize],
    options: &AveragingOptions,
) -> Result<Averaging, Undetermined> {
    let mut groups = UnionFind::new(poses.len());
    for pair in relative.iter().filter(|pair| pair.weight > 0.0) {
        groups.join(pair.i, pair.j);
    }
    let held: Vec<usize> = anchors.iter().map(|anchor| groups.find(*anchor)).collect();
    if (0..poses.len()).any(|view| !held.contains(&groups.find(view))) {
        return Err(Undetermined);
    }
    let columns = columns::<1>(poses.len(), |view| !anchors.contains(&view));
    let mut poses = poses.to_vec();
    let mut trusts = vec![1.0; relative.len()];
    let mut scale2 = f64::INFINITY;
    let mut rounds = 0;
    loop {
        let corrections: Vec<Twist> = relative.iter().map(|pair| correction(&poses, pair)).collect();
        let lengths: Vec<f64> = corrections.iter().map(|dv| twist_length(dv, options.radius)).collect();
        let mut settled = true;
        if options.robust {
            (scale2, settled) = next_scale2(scale2, &lengths, options.noise);
            let kernel = RobustKernel::with_squared_scale(scale2);
            for (trust, length) in trusts.iter_mut().zip(&lengths) {
                *trust = kernel.weight(*length);
            }
        }
        let largest = step(&mut poses, relative, &corrections, &trusts, &columns, options.radius)?;
        rounds += 1;
        if (settled && largest < 1e-9 * options.radius) || rounds == TUNING.max_rounds {
            let disagreements = disagreements(&poses, relative, options.radius);
            return Ok(Averaging { poses, disagreements, trusts, rounds });
        }
    }
}

/// How far each relative motion disagrees with the poses, a length: its translation, and its rotation times `radius`.
pub fn disagreements(poses: &[Motion], relative: &[RelativeMotion], radius: f64) -> Vec<f64> {
    relative.iter().map(|pair| twist_length(&correction(poses, pair), radius)).collect()
}

/// [P3], [P4], [P5]: `log(M_i M_ij M_j^-1)`.
fn correction(poses: &[Motion], pair: &RelativeMotion) -> Twist {
    se3::log(&(poses[pair.i] * pair.i_from_j * poses[pair.j].inverse()))
}

/// A twist as a length: the translation part, and the rotation times the radius.
fn twist_length(twist: &Twist, radius: f64) -> f64 {
    let u = twist.fixed_rows::<3>(0).norm_squared();
    let w = twist.fixed_rows::<3>(3).norm_squared();
    (u + w * radius * radius).sqrt()
}

/// The next squared kernel scale and whether it has reached its floor: three times the median disagreement,
/// at least the noise.
fn next_scale2(scale2: f64, disagreements: &[f64], noise: f64) -> (f64, bool) {
    let mut sorted = disagreements.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let floor = (3.0 * median).max(noise).powi(2);
    let largest = sorted.last().copied().unwrap_or(0.0).powi(2);
    let next = (scale2 / TUNING.scale_step).min(largest.max(floor));
    if next <= floor { (floor, true) } else { (next, false) }
}

/// One weighted solve of [P6], [P7] and the update [P8]-[P10]; returns the largest correction as a length.
///
/// The row of pair (i, j) in D is -I at i and +I at j, so `D'WD` is the graph's Laplacian times a 6x6 identity:
/// one sparse scalar factorisation serves all six components, and no pseudo-inverse is formed.
fn step(
    poses: &mut [Motion],
    relative: &[RelativeMotion],
    corrections: &[Twist],
    trusts: &[f64],
    columns: &[Option<usize>],
    radius: f64,
) -> Result<f64, Undetermined> {
    let Some(mut system) = PoseSystem::<1, 6>::new(columns) else { return Ok(0.0) };
    for ((pair, dv), trust) in relative.iter().zip(corrections).zip(trusts) {
        let weight = pair.weight * trust;
        system.add((pair.i, pair.j), &Matrix1::new(weight), &(dv.transpose() * weight));
    }
    let mut largest = 0.0f64;
    let solution = system.solve().ok_or(Undetermined)?;
    let is_free = |view: &usize| columns[*view].is_some();
    for view in (0..poses.len()).filter(is_free) {
        let (pose, dv) = (&mut poses[view], solution[view].transpose());
        *pose = se3::exp(&dv) * *pose;
        largest = largest.max(twist_length(&dv, radius));
    }
    Ok(largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use visage_geometry::Vector3;

    const OPTIONS: AveragingOptions = AveragingOptions { radius: 100.0, noise: 0.1, robust: true };

    fn random_motion(rng: &mut rand_chacha::ChaCha8Rng, shift: f64, angle: f64) -> Motion {
        let mut v =
            || Vector3::new(rng.random::<f64>(), rng.random::<f64>(), rng.random::<f64>()) * 2.0 - Vector3::repeat(1.0);
        Motion::new(v() * shift, v() * angle)
    }

    /// A ring of ten views with chords; exact relative motions; disturbed start.
    fn ring() -> (Vec<Motion>, Vec<Motion>, Vec<RelativeMotion>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let truth: Vec<Motion> = (0..10).map(|_| random_motion(&mut rng, 50.0, 2.0)).collect();
        let mut start: Vec<Motion> = truth.iter().map(|m| random_motion(&mut rng, 5.0, 0.05) * m).collect();
        start[0] = truth[0];
        let relative = (0..10)
            .flat_map(|i| [(i, (i + 1) % 10), (i, (i + 2) % 10)])
            .map(|(i, j)| RelativeMotion { i, j, i_from_j: truth[i].inv_mul(&truth[j]), weight: 0.7 })
            .collect();
        (truth, start, relative)
    }

    fn largest_error(found: &[Motion], truth: &[Motion]) -> f64 {
        found.iter().zip(truth).map(|(a, b)| twist_length(&se3::log(&(a * b.inverse())), 100.0)).fold(0.0, f64::max)
    }

    #[test]
    fn exact_motions_give_exact_poses() {
        let (truth, start, relative) = ring();
        let averaged = average(&start, &relative, &[0], &OPTIONS).expect("a ring is connected");
        assert!(largest_error(&averaged.poses, &truth) < 1e-7);
        assert!(averaged.disagreements.iter().all(|d| *d < 1e-7));
        assert_eq!(averaged.poses[0], truth[0]);
    }

    #[test]
    fn one_pair_turned_by_30_degrees_moves_nothing_when_robust() {
        let (truth, start, mut relative) = ring();
        relative[4].i_from_j *= Motion::new(Vector3::zeros(), Vector3::z() * 30f64.to_radians());
        let robust = average(&start, &relative, &[0], &OPTIONS).expect("a ring is connected");
        assert!(largest_error(&robust.poses, &truth) < 0.01, "{}", largest_error(&robust.poses, &truth));
        assert!(robust.trusts[4] < 1e-3);
        let plain = average(&start, &relative, &[0], &AveragingOptions { robust: false, ..OPTIONS });
        assert!(largest_error(&plain.expect("a ring is connected").poses, &truth) > 1.0);
    }

    #[test]
    fn whichever_pair_is_wrong_no_pose_moves_by_a_tenth_of_the_spacing() {
        let spacing = OPTIONS.noise;
        let (_, start, mut relative) = ring();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for pair in &mut relative {
            pair.i_from_j *= random_motion(&mut rng, 0.05 * spacing, 0.05 * spacing / OPTIONS.radius);
        }
        let poses = |relative: &[RelativeMotion], robust| {
            average(&start, relative, &[0], &AveragingOptions { robust, ..OPTIONS }).expect("connected").poses
        };
        let right = [poses(&relative, true), poses(&relative, false)];
        for wrong in 0..relative.len() {
            let axis = Vector3::ith_axis(wrong % 3);
            let mut turned = relative.clone();
            turned[wrong].i_from_j *= Motion::new(Vector3::zeros(), axis.into_inner() * 30f64.to_radians());
            let robust = largest_error(&poses(&turned, true), &right[0]);
            assert!(robust <= 0.1 * spacing, "pair {wrong}: {} spacings", robust / spacing);
            let plain = largest_error(&poses(&turned, false), &right[1]);
            assert!(plain > 50.0 * spacing, "without weights pair {wrong} has to hurt: {} spacings", plain / spacing);
        }
    }

    #[test]
    fn a_view_without_a_pair_is_undetermined() {
        let (_, start, mut relative) = ring();
        relative.retain(|pair| pair.i != 7 && pair.j != 7);
        assert_eq!(average(&start, &relative, &[0], &OPTIONS), Err(Undetermined));
        assert!(average(&start, &relative, &[0, 7], &OPTIONS).is_ok(), "an anchor needs no pair");
    }
}
