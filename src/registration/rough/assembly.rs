//! From pairs to a whole: groups of views grow by the best pair that all their views bear out.

use rayon::prelude::*;

use super::alignment::align;
use super::consensus::alike;
use super::sketch::Sketch;
use super::verification::{Evidence, verify};
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress};
use crate::registration::motion_averaging::{self, AveragingOptions, RelativeMotion};

/// A way to lay two views on each other, drawn onto the surface and asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// The view whose frame is the target.
    pub i: usize,
    /// The view that is mapped.
    pub j: usize,
    /// Maps the local frame of view j into that of view i.
    pub motion_i_j: Motion,
    /// What the surfaces say.
    pub evidence: Evidence,
}

/// Views that hang together.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Its views, in order.
    pub views: Vec<usize>,
    /// For each of `views` its pose: local frame to the group's world.
    pub local_poses: Vec<Motion>,
    /// The pairs that hold it together.
    pub links: Vec<Link>,
}

/// A link is worth trying from this share of agreeing surfels on,
const LEAST_OVERLAP: f64 = 0.08;
/// and this share of agreement among all that was said.
const LEAST_CONSISTENCY: f64 = 0.6;
/// Groups are joined if this share of all that their views say of each other agrees,
const JOIN_CONSISTENCY: f64 = 0.72;
/// and at least this share of a view's surfels does.
const JOIN_OVERLAP: f64 = 0.15;
/// A pair within a join is drawn onto the surface; it may move by this many edges.
const DRIFT: f64 = 4.0;
/// Surfels of a view that are asked when groups are joined.
const SAMPLES: usize = 200;

impl Link {
    /// How much speaks for it, to rank links: agreement counts, conflict counts more.
    pub fn strength(&self) -> f64 {
        let e = &self.evidence;
        e.overlap() * (e.consistency() - 0.5).max(0.0)
    }
}

/// Grows groups until no link joins two of them; the largest first, those of equal size in the order of views.
pub fn assemble(sketches: &[Sketch], links: &[Link], edge: f64, progress: &Progress) -> Result<Vec<Group>, Canceled> {
    let mut groups: Vec<Option<Group>> = (0..sketches.len())
        .map(|view| Some(Group { views: vec![view], local_poses: vec![Motion::identity()], links: Vec::new() }))
        .collect();
    let mut home: Vec<usize> = (0..sketches.len()).collect();
    let mut waiting: Vec<&Link> = links.iter().filter(|link| is_promising(link)).collect();
    waiting.sort_by(|a, b| b.strength().total_cmp(&a.strength()).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut joined = true;
    while joined {
        joined = false;
        for link in &waiting {
            progress.check()?;
            let (a, b) = (home[link.i], home[link.j]);
            if a == b {
                continue;
            }
            let (Some(left), Some(right)) = (&groups[a], &groups[b]) else { continue };
            if let Some(union) = join(sketches, left, right, link, edge) {
                union.views.iter().for_each(|view| home[*view] = a);
                groups[a] = Some(union);
                groups[b] = None;
                joined = true;
            }
        }
        waiting.retain(|link| home[link.i] != home[link.j]);
    }
    let mut groups: Vec<Group> = groups.into_iter().flatten().collect();
    groups.sort_by(|a, b| b.views.len().cmp(&a.views.len()).then(a.views.cmp(&b.views)));
    Ok(groups)
}

fn is_promising(link: &Link) -> bool {
    link.evidence.overlap() >= LEAST_OVERLAP && link.evidence.consistency() >= LEAST_CONSISTENCY
}

/// Both groups laid together as `link` says, if all their views bear it out.
fn join(sketches: &[Sketch], left: &Group, right: &Group, link: &Link, edge: f64) -> Option<Group> {
    let pose_i = left.pose_of(link.i)?;
    let pose_j = right.pose_of(link.j)?;
    let motion_left_right = pose_i * link.motion_i_j * pose_j.inverse();
    let pairs: Vec<(usize, usize)> =
        left.views.iter().flat_map(|&i| right.views.iter().map(move |&j| (i, j))).collect();
    let measured: Vec<Link> = pairs
        .par_iter()
        .with_max_len(1)
        .filter_map(|&(i, j)| {
            let implied = left.pose_of(i)?.inv_mul(&(motion_left_right * right.pose_of(j)?));
            measure(sketches, i, j, &implied, edge)
        })
        .collect();
    let agree: f64 = measured.iter().map(|link| link.evidence.agree()).sum();
    let conflict: f64 = measured.iter().map(|link| link.evidence.conflict()).sum();
    let overlap = measured.iter().map(|link| link.evidence.overlap()).fold(0.0, f64::max);
    if agree < JOIN_CONSISTENCY * (agree + conflict) || overlap < JOIN_OVERLAP {
        return None;
    }
    let mut union = left.clone();
    union.views.extend(&right.views);
    union.local_poses.extend(right.local_poses.iter().map(|pose| motion_left_right * pose));
    union.links.extend(&right.links);
    union.links.extend(
        measured
            .into_iter()
            .filter(|link| link.evidence.overlap() >= LEAST_OVERLAP && link.evidence.consistency() >= JOIN_CONSISTENCY),
    );
    union.sort();
    union.average(sketches, edge);
    Some(union)
}

/// What a pair says of an implied motion, drawn onto the surface first if that stays near; `None` if the views are apart.
fn measure(sketches: &[Sketch], i: usize, j: usize, implied: &Motion, edge: f64) -> Option<Link> {
    let apart = implied.translation.vector.norm() > sketches[i].radius + sketches[j].radius;
    if apart {
        return None;
    }
    let (a, b) = (&sketches[i], &sketches[j]);
    let at = |motion_i_j: Motion| Link { i, j, motion_i_j, evidence: verify(a, b, &motion_i_j, edge, SAMPLES) };
    let raw = at(*implied);
    if raw.evidence.overlap() < 0.5 * LEAST_OVERLAP {
        return Some(raw);
    }
    let drawn = align(a, b, implied, edge);
    if !alike(&drawn, implied, b.radius, DRIFT * edge) {
        return Some(raw);
    }
    let drawn = at(drawn);
    Some(if drawn.evidence.agree() - drawn.evidence.conflict() > raw.evidence.agree() - raw.evidence.conflict() {
        drawn
    } else {
        raw
    })
}

impl Group {
    /// A view's pose in the group's world.
    pub fn pose_of(&self, view: usize) -> Option<Motion> {
        self.views.iter().position(|v| *v == view).map(|k| self.local_poses[k])
    }

    /// Views in order, so that nothing depends on the order of joining but the poses' last digits.
    fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.views.len()).collect();
        order.sort_by_key(|k| self.views[*k]);
        self.local_poses = order.iter().map(|k| self.local_poses[*k]).collect();
        self.views.sort_unstable();
    }

    /// Spreads what the links say over all poses; the first view keeps its own.
    fn average(&mut self, sketches: &[Sketch], edge: f64) {
        let place = |view: usize| self.views.iter().position(|v| *v == view).unwrap_or(0);
        let relative: Vec<RelativeMotion> = self
            .links
            .iter()
            .map(|link| RelativeMotion {
                i: place(link.i),
                j: place(link.j),
                motion_i_j: link.motion_i_j,
                weight: link.evidence.overlap().max(0.01),
            })
            .collect();
        let radius = self.views.iter().map(|v| sketches[*v].radius).fold(0.0, f64::max);
        let options = AveragingOptions { radius, noise: 0.25 * edge, robust: true };
        if let Ok(averaged) = motion_averaging::average(&self.local_poses, &relative, &[0], &options) {
            self.local_poses = averaged.poses;
        }
    }
}
