//! Gauss-Newton over all poses, with correspondences renewed in every step.

use crate::pairwise::trimmed_icp::largest_step;
use rayon::prelude::*;

use super::surfels::Surfels;
use crate::least_squares::normal_equations::{NormalEquations, PairBlock, SCALED, solve};
use crate::least_squares::pose_system::columns;
use crate::least_squares::robust_kernel::RobustKernel;
use visage_geometry::neighbours::Pursuit;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::se3::{self, Twist};
use visage_geometry::{Motion, Vector3};

/// How the refinement searches and stops. Lengths in the scans' unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// Surfels farther apart than this are no counterparts, in the first step.
    pub first_distance: f64,
    /// The distance it ends with.
    pub last_distance: f64,
    /// Steps at most.
    pub max_steps: usize,
    /// Steps that move no surfel farther than this end it.
    pub settled: f64,
    /// Until a step moves none farther than ten times that, only one in so many surfels is queried.
    pub query_stride: usize,
}

/// What the refinement did.
#[derive(Debug, Clone)]
pub struct Refined {
    /// Local frame to world.
    pub local_poses: Vec<Motion>,
    /// By how much each view's scale changed: its points are to be multiplied by it before its pose; 1 if scales were
    /// not sought.
    pub scales: Vec<f64>,
    /// Gauss-Newton steps made.
    pub steps: usize,
    /// Weighted root mean square of the residuals in the last step, a length.
    pub rms: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Each step's search distance in the one before.
        shrink: f64 = 0.6,
        /// Searches look this much farther than correspondences may be apart, so that the next steps know whom to ask again.
        margin: f64 = 1.3,
        /// Where the last steps begin, in steps that end it.
        unsettled: f64 = 10.0,
        /// Surfels that ask in one step, over all pairs, at most: it bounds memory, and where pairs are so many they say the same
        /// many times over.
        most_queries: usize = 4_000_000,
        /// The largest change of a scale's logarithm in one step.
        scale_step: f64 = 0.1,
    }
}

/// The robust kernel's scale in root mean square residuals.
pub(crate) const KERNEL: f64 = 3.0;

/// Refines `local_poses` over `pairs` (i < j); `anchors` keep their pose (and scale). With `D` = 6 unknowns a view is
/// moved, with 7 it is also scaled.
pub fn refine<const D: usize>(
    surfels: &[Surfels],
    local_poses: &[Motion],
    pairs: &[(usize, usize)],
    anchors: &[usize],
    options: &RefineOptions,
    progress: &Progress,
) -> Result<Refined, Canceled> {
    let directed: Vec<(usize, usize)> = pairs.iter().flat_map(|&(i, j)| [(i, j), (j, i)]).collect();
    let mut searches = searches(surfels, &directed);
    let columns = columns::<D>(local_poses.len(), |view| !anchors.contains(&view));
    let scales = vec![1.0; local_poses.len()];
    let mut refined = Refined { local_poses: local_poses.to_vec(), scales, steps: 0, rms: f64::INFINITY };
    let mut distance = options.first_distance;
    let mut scale = distance;
    let mut query_stride = options.query_stride.max(1);
    while refined.steps < options.max_steps {
        progress.check()?;
        let middle = Motion::from(nalgebra::Translation3::from(mean_position(&refined.local_poses)));
        let centered: Vec<Motion> = refined.local_poses.iter().map(|pose| middle.inverse() * pose).collect();
        let scales = &refined.scales;
        let blocks: Vec<PairBlock<D>> = directed
            .par_iter()
            .zip(&mut searches)
            .with_max_len(1)
            .map(|(&(a, b), search)| {
                progress.check()?;
                let placement = Placement::between((&centered[b], scales[b]), (&centered[a], scales[a]));
                let reach = Reach { distance: distance / scales[b], scale: scale / scales[b] };
                let sums = assemble::<D>(&surfels[a], &surfels[b], &placement, &reach, query_stride, search);
                Ok(sums.into_world(&centered[b], scales[b]))
            })
            .collect::<Result<_, Canceled>>()?;
        let Some(twists) = solve(&directed, &blocks, &columns) else { break };
        let mut largest = 0.0f64;
        for (view, twist) in twists.iter().enumerate() {
            let step = Step::of(twist);
            refined.local_poses[view] = middle * se3::exp(&step.twist) * step.grown(&centered[view]);
            refined.scales[view] *= step.growth;
            largest = largest.max(step.displacement(&centered[view], surfels[view].radius));
        }
        refined.steps += 1;
        let weight: f64 = blocks.iter().map(|b| b.weight).sum();
        refined.rms = (blocks.iter().map(|b| b.cost).sum::<f64>() / weight.max(f64::MIN_POSITIVE)).sqrt();
        scale = scale.min(KERNEL * refined.rms);
        let last = distance <= options.last_distance;
        distance = (TUNING.shrink * distance).max(options.last_distance);
        if last && query_stride > 1 && largest < TUNING.unsettled * options.settled {
            query_stride = 1;
            searches.par_iter_mut().for_each(|search| search.asked_at = None);
        } else if last && largest < options.settled {
            break;
        }
    }
    Ok(refined)
}

/// What each directed pair asks: all inner surfels of its first view or, if there are many pairs, every k-th, other ones
/// with each partner.
fn searches(surfels: &[Surfels], directed: &[(usize, usize)]) -> Vec<Search> {
    let all: usize = directed.iter().map(|&(a, _)| surfels[a].inner.len()).sum();
    let stride = all.div_ceil(TUNING.most_queries).max(1);
    directed.iter().map(|&(a, b)| Search::new(surfels[a].inner.len(), stride, b % stride)).collect()
}

fn mean_position(poses: &[Motion]) -> Vector3 {
    poses.iter().map(|pose| pose.translation.vector).sum::<Vector3>() / poses.len().max(1) as f64
}

/// What one solution does to one view: it grows about the origin, then moves.
struct Step {
    twist: Twist,
    growth: f64,
}

impl Step {
    fn of<const D: usize>(solution: &nalgebra::SVector<f64, D>) -> Self {
        let twist = Twist::from_iterator(solution.iter().copied());
        let growth = if D == SCALED { solution[D - 1].clamp(-TUNING.scale_step, TUNING.scale_step).exp() } else { 1.0 };
        Step { twist, growth }
    }

    /// The pose after the growth, before the motion.
    fn grown(&self, pose: &Motion) -> Motion {
        Motion::from_parts((pose.translation.vector * self.growth).into(), pose.rotation)
    }

    /// How far it moves the points of a view, at most.
    fn displacement(&self, pose: &Motion, radius: f64) -> f64 {
        let reach = pose.translation.vector.norm() + radius;
        let turn = self.twist.fixed_rows::<3>(3).norm();
        self.twist.fixed_rows::<3>(0).norm() + (turn + (self.growth - 1.0).abs()) * reach
    }
}

/// How view a lies in the local frame and unit of view b: `p_b = motion (ratio p_a)`.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    /// Turns and shifts.
    pub motion: Motion,
    /// a's scale in that of b.
    pub ratio: f64,
}

impl Placement {
    /// From each view's pose and scale.
    pub fn between(b: (&Motion, f64), a: (&Motion, f64)) -> Self {
        let mut motion = b.0.inv_mul(a.0);
        motion.translation.vector /= b.1;
        Placement { motion, ratio: a.1 / b.1 }
    }

    /// How far the change from this placement to another moves a point within `radius` of a's origin, at most.
    fn largest_step(&self, to: &Placement, radius: f64) -> f64 {
        largest_step(&self.motion, &to.motion, radius) + (to.ratio - self.ratio).abs() * radius
    }
}

/// How far correspondences reach, and the robust kernel's scale: lengths in the unit of the view that is searched.
struct Reach {
    distance: f64,
    scale: f64,
}

/// What a directed pair remembers from step to step.
struct Search {
    /// Every `stride`-th inner surfel of view a asks, from the `first`.
    stride: usize,
    first: usize,
    /// For each of these its pursuit of the nearest surfel in view b.
    pursuits: Vec<Pursuit>,
    /// Those of them that had a neighbour when all were last asked.
    active: Vec<u32>,
    /// The placement at which all were last asked.
    asked_at: Option<Placement>,
}

impl Search {
    /// Of `inner` surfels.
    fn new(inner: usize, stride: usize, first: usize) -> Self {
        let pursuits = vec![Pursuit::new(); inner.saturating_sub(first).div_ceil(stride)];
        Search { stride, first, pursuits, active: Vec::new(), asked_at: None }
    }

    /// All surfels are asked again once the views have moved so far that one without a neighbour may have got one.
    fn must_ask_all(&self, placement: &Placement, radius: f64, distance: f64) -> bool {
        let slack = 0.5 * (TUNING.margin - 1.0) * distance;
        self.asked_at.is_none_or(|asked| asked.largest_step(placement, radius) > slack)
    }
}

/// The cosine below which two normals don't belong to one surface.
pub(crate) const LEAST_COSINE: f32 = 0.5;

/// Correspondences of view a's surfels in view b, summed in b's local frame.
fn assemble<const D: usize>(
    a: &Surfels,
    b: &Surfels,
    placement: &Placement,
    &Reach { distance, scale }: &Reach,
    query_stride: usize,
    search: &mut Search,
) -> NormalEquations<D> {
    let ask_all = search.must_ask_all(placement, a.radius, distance);
    if ask_all {
        search.asked_at = Some(*placement);
        search.active.clear();
        search.active.extend((0..search.pursuits.len() as u32).step_by(query_stride));
    }
    let motion = placement.motion.cast::<f32>();
    let ratio = placement.ratio as f32;
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    let search_distance2 = (TUNING.margin * distance).powi(2) as f32;
    let distance2 = (distance * distance) as f32;
    let kernel = RobustKernel::with_squared_scale((scale * scale) as f32);
    let Search { stride, first, pursuits, active, .. } = search;
    let mut sums = NormalEquations::<D>::default();
    active.retain(|&query| {
        let query = query as usize;
        let index = a.inner[*first + query * *stride] as usize;
        let point = nalgebra::Vector3::from(a.indexed.points[index]);
        let moved = rotation * if D == SCALED { point * ratio } else { point } + shift;
        let nearest = pursuits[query].nearest(&b.indexed, &moved.into(), search_distance2);
        let Some(nearest) = nearest else { return !ask_all };
        let target = nearest.index as usize;
        let normal_a = rotation * nalgebra::Vector3::from(a.normals[index]);
        let normal_b = nalgebra::Vector3::from(b.normals[target]);
        let cosine = normal_a.dot(&normal_b);
        if nearest.distance2 < distance2 && b.is_inner[target] && a.likeness(index, b, target, cosine) > LEAST_COSINE {
            let normal = (normal_b + normal_a * cosine.signum()).normalize();
            let residual = normal.dot(&(moved - nalgebra::Vector3::from(b.indexed.points[target])));
            sums.add(&normal.cast(), &moved.cast(), residual.into(), kernel.weight(residual).into());
        }
        true
    });
    sums
}
