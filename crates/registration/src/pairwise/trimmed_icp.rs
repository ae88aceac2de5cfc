//! Trimmed ICP of one pair with the adaptive convergence threshold.
//!
//! Chetverikov, Stepanov, Krsek, "Robust Euclidean alignment of 3D point sets: the trimmed iterative closest point
//! algorithm", Image and Vision Computing 2005; stopping rule after section 2.2 of the paper.

use crate::pairwise::rigid_fit::RigidFit;
use visage_geometry::Motion;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint, Pursuit};
use visage_geometry::progress::{Canceled, Progress};

/// Which share of the source points is kept, those with the smallest distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trim {
    /// A given share in (0, 1], usually the overlap.
    Share(f64),
    /// In each iteration the share from `least` to 1 that minimises TrICP's objective `mse(xi) / xi^(1 + lambda)`.
    Search {
        /// The smallest share considered.
        least: f64,
    },
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// TrICP's preference for a larger share.
        lambda: i32 = 2,
    }
}

/// When and how far to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IcpOptions {
    /// The share of correspondences kept.
    pub trim: Trim,
    /// Target points farther away than this are no counterparts (a length; infinite = no bound).
    pub max_distance: f64,
    /// Mean squared distance of the kept correspondences below which the pair is registered [P2].
    pub threshold: f64,
    /// Fits at most.
    pub max_iterations: usize,
    /// A step that moves no point farther than this (a length) ends the iteration as stagnation.
    pub min_step: f64,
}

/// How the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IcpEnd {
    /// The mean squared distance fell below the adaptive threshold.
    Threshold,
    /// The last step moved nothing to speak of.
    Stagnation,
    /// The limit of iterations was reached.
    IterationLimit,
    /// Fewer than three points have a counterpart.
    NoCorrespondences,
}

/// The registered pair.
#[derive(Debug, Clone, PartialEq)]
pub struct IcpResult {
    /// Maps the local frame of the source view into that of the target view.
    pub motion: Motion,
    /// Correspondences kept in the last iteration.
    pub correspondences: usize,
    /// The share of the source points they are.
    pub share: f64,
    /// Mean squared distance of the kept correspondences at `motion`'s last but one step (at the start pose if
    /// `iterations` is 0).
    pub mean_distance2: f64,
    /// Fits made.
    pub iterations: usize,
    /// How it ended.
    pub end: IcpEnd,
}

/// A source point's nearest target point.
#[derive(Clone, Copy)]
struct Correspondence {
    distance2: f32,
    source: u32,
    target: u32,
}

/// Registers `source` (points in the source view's local frame) with `target`, starting from `start`
/// (source local frame to target local frame).
pub fn trimmed_icp(
    target: &IndexedPoints,
    source: &[LocalPoint],
    start: &Motion,
    options: &IcpOptions,
    progress: &Progress,
) -> Result<IcpResult, Canceled> {
    let reach = source.iter().map(|p| nalgebra::Vector3::from(*p).norm()).fold(0.0f32, f32::max);
    let max_distance2 = (options.max_distance * options.max_distance).min(f64::from(f32::MAX)) as f32;
    let mut result = IcpResult {
        motion: *start,
        correspondences: 0,
        share: 0.0,
        mean_distance2: f64::INFINITY,
        iterations: 0,
        end: IcpEnd::IterationLimit,
    };
    let mut found = Vec::with_capacity(source.len());
    let mut scratch = Vec::with_capacity(source.len());
    // where nothing moves there is nothing to remember
    let remembered = if options.max_iterations > 0 { source.len() } else { 0 };
    let mut pursuits = vec![Pursuit::new(); remembered];
    loop {
        progress.check()?;
        find_correspondences(target, source, &result.motion, max_distance2, &mut pursuits, &mut found);
        trim(&mut found, source.len(), options.trim, &mut scratch);
        result.correspondences = found.len();
        result.share = found.len() as f64 / source.len().max(1) as f64;
        result.mean_distance2 = mean_distance2(&found);
        if result.mean_distance2 < options.threshold {
            result.end = IcpEnd::Threshold;
            return Ok(result);
        }
        if result.iterations == options.max_iterations {
            return Ok(result);
        }
        let Some(motion) = fit(target, source, &found) else {
            result.end = IcpEnd::NoCorrespondences;
            return Ok(result);
        };
        let step = largest_step(&result.motion, &motion, reach.into());
        result.motion = motion;
        result.iterations += 1;
        if step < options.min_step {
            result.end = IcpEnd::Stagnation;
            return Ok(result);
        }
    }
}

/// `pursuits` remember each source point's last answer, which holds while no other target point can have come nearer.
fn find_correspondences(
    target: &IndexedPoints,
    source: &[LocalPoint],
    motion: &Motion,
    max_distance2: f32,
    pursuits: &mut [Pursuit],
    found: &mut Vec<Correspondence>,
) {
    let motion = motion.cast::<f32>();
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    found.clear();
    for (index, point) in source.iter().enumerate() {
        let moved: LocalPoint = (rotation * nalgebra::Vector3::from(*point) + shift).into();
        let nearest = match pursuits.get_mut(index) {
            Some(pursuit) => pursuit.nearest(target, &moved, max_distance2),
            None => target.tree.nearest(&moved, max_distance2),
        };
        if let Some(neighbour) = nearest {
            found.push(Correspondence {
                distance2: neighbour.distance2,
                source: index as u32,
                target: neighbour.index,
            });
        }
    }
}

/// Drops all but the correspondences with the smallest distances; those kept stay in the order of the source points,
/// since sums are taken in that order.
fn trim(found: &mut Vec<Correspondence>, source_len: usize, rule: Trim, scratch: &mut Vec<f32>) {
    scratch.clear();
    scratch.extend(found.iter().map(|c| c.distance2));
    let kept = match rule {
        Trim::Share(share) => ((share * source_len as f64).floor() as usize).min(found.len()),
        Trim::Search { least } => {
            scratch.sort_unstable_by(f32::total_cmp);
            best_share(scratch, source_len, least)
        }
    };
    if kept == 0 || kept == found.len() {
        found.truncate(kept);
        return;
    }
    let largest = *scratch.select_nth_unstable_by(kept - 1, f32::total_cmp).1;
    // of several at the largest distance kept, the first ones in the order of the source points stay
    let mut ties = kept - scratch[..kept].iter().filter(|d| **d < largest).count();
    found.retain(|c| {
        c.distance2 < largest
            || (c.distance2 == largest && ties > 0 && {
                ties -= 1;
                true
            })
    });
}

/// The number of correspondences, their squared distances sorted, at which TrICP's objective is smallest.
fn best_share(sorted: &[f32], source_len: usize, least: f64) -> usize {
    let first = ((least * source_len as f64).ceil() as usize).max(3);
    let mut best = (f64::INFINITY, first.min(sorted.len()));
    let mut sum = 0.0;
    for (index, distance2) in sorted.iter().enumerate() {
        sum += f64::from(*distance2);
        let count = index + 1;
        if count >= first {
            let share = count as f64 / source_len as f64;
            let objective = sum / count as f64 / share.powi(1 + TUNING.lambda);
            if objective < best.0 {
                best = (objective, count);
            }
        }
    }
    best.1
}

fn mean_distance2(kept: &[Correspondence]) -> f64 {
    if kept.is_empty() {
        return f64::INFINITY;
    }
    kept.iter().map(|c| f64::from(c.distance2)).sum::<f64>() / kept.len() as f64
}

fn fit(target: &IndexedPoints, source: &[LocalPoint], kept: &[Correspondence]) -> Option<Motion> {
    let mut fit = RigidFit::default();
    for c in kept {
        fit.add(&source[c.source as usize], &target.points[c.target as usize]);
    }
    fit.solve()
}

/// How far the change from one motion to another moves a point within `reach` of the origin, at most.
pub(crate) fn largest_step(from: &Motion, to: &Motion, reach: f64) -> f64 {
    let angle = visage_geometry::se3::rotation_angle(&from.rotation.rotation_to(&to.rotation));
    2.0 * (0.5 * angle).sin() * reach + (to.translation.vector - from.translation.vector).norm()
}
