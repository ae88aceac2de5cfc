//! From pairs to a whole: groups of views grow by the best pair that all their views bear out.

use rayon::prelude::*;

use super::alignment::align;
use super::confidence::Grounds;
use super::consensus::alike;
use super::group::Group;
use super::link::{LEAST_OVERLAP, Link};
use super::scene::Scene;
use super::sketch::Sketch;
use super::slide::slides;
use super::touch::contact;
use super::verification::verify;
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress};

/// All groups, and views that could be laid on others in several ways.
#[derive(Debug, Clone, Default)]
pub struct Assembly {
    /// The largest first, those of equal size in the order of views.
    pub groups: Vec<Group>,
    /// For each view whether it, or its group, fits the rest in several ways.
    pub ambiguous: Vec<bool>,
}

/// A pair within a join is drawn onto the surface; it may move by this many edges.
const DRIFT: f64 = 4.0;
/// Surfels of a view that are asked when groups are joined.
const SAMPLES: usize = 200;
/// Another way to lay two groups on each other is a rival from this share of the strength on.
const RIVAL: f64 = 0.85;
/// Groups are joined if of the points of their strongest pairs that come near each other this share touches,
pub(super) const TOUCHING: f64 = 0.75;
/// looking at this many pairs.
const WITNESSES: usize = 3;
/// What came of trying a link.
enum Attempt {
    Joined(Group),
    Ambiguous,
    Refused,
}

/// Joins groups until no link joins two of them: those `begun`, and each other view as one of its own.
pub fn assemble(scene: &Scene, links: &[Link], begun: Vec<Group>, progress: &Progress) -> Result<Assembly, Canceled> {
    let sketches = scene.sketches;
    let mut groups: Vec<Option<Group>> = (0..sketches.len()).map(|view| Some(Group::of(view))).collect();
    let mut home: Vec<usize> = (0..sketches.len()).collect();
    for group in begun {
        let Some(&first) = group.views.first() else { continue };
        group.views.iter().for_each(|view| (groups[*view], home[*view]) = (None, first));
        groups[first] = Some(group);
    }
    let mut waiting: Vec<&Link> = links.iter().filter(|link| link.is_promising()).collect();
    waiting.sort_by(|a, b| scene.score(b).total_cmp(&scene.score(a)).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut ambiguous = vec![false; sketches.len()];
    // a link that was refused is tried again when one of its groups has grown
    let mut refused_at = vec![(0, 0); waiting.len()];
    let mut joined = true;
    while joined {
        joined = false;
        for (link, refused_at) in waiting.iter().zip(&mut refused_at) {
            progress.check()?;
            let (a, b) = (home[link.i], home[link.j]);
            let (Some(left), Some(right)) = (&groups[a], &groups[b]) else { continue };
            let sizes = (left.views.len(), right.views.len());
            if a == b || *refused_at == sizes {
                continue;
            }
            *refused_at = sizes;
            match try_join(scene, left, right, link, &waiting) {
                Attempt::Joined(union) => {
                    union.views.iter().for_each(|view| (home[*view], ambiguous[*view]) = (a, false));
                    groups[a] = Some(union);
                    groups[b] = None;
                    joined = true;
                }
                Attempt::Ambiguous => {
                    let smaller = if left.views.len() < right.views.len() { left } else { right };
                    smaller.views.iter().for_each(|view| ambiguous[*view] = true);
                }
                Attempt::Refused => {}
            }
        }
    }
    let mut groups: Vec<Group> = groups.into_iter().flatten().collect();
    sort_by_size(&mut groups);
    Ok(Assembly { groups, ambiguous })
}

/// The largest first, those of equal size in the order of views.
pub fn sort_by_size(groups: &mut [Group]) {
    groups.sort_by(|a, b| b.views.len().cmp(&a.views.len()).then(a.views.cmp(&b.views)));
}

/// Lays both groups together as `link` says, if all their views bear it out and nothing else fits as well.
fn try_join(scene: &Scene, left: &Group, right: &Group, link: &Link, waiting: &[&Link]) -> Attempt {
    let (sketches, edge) = (scene.sketches, scene.edge);
    let Some(motion) = implied(left, right, link) else { return Attempt::Refused };
    let measured = measure_all(sketches, left, right, &motion, edge);
    let mut grounds = Grounds::of(scene, &measured);
    if !grounds.suffice() {
        return Attempt::Refused;
    }
    grounds.touching = touching(scene, &measured);
    if grounds.touching < TOUCHING {
        return Attempt::Refused;
    }
    let radius = right.views.iter().map(|view| sketches[*view].radius).fold(0.0, f64::max);
    let rivals = waiting.iter().filter(|other| {
        let same_pair = (other.i, other.j) == (link.i, link.j);
        let is_other = !alike(&other.motion_i_j, &link.motion_i_j, radius, DRIFT * edge);
        same_pair && is_other && scene.score(other) > RIVAL * scene.score(link)
    });
    for rival in rivals {
        let Some(motion) = implied(left, right, rival) else { continue };
        let other = Grounds::of(scene, &measure_all(sketches, left, right, &motion, edge));
        grounds.rival = grounds.rival.max(other.score / grounds.score);
    }
    if grounds.rival < RIVAL && slides(sketches, &measured, edge, SAMPLES) {
        grounds.rival = 1.0;
    }
    if grounds.rival > RIVAL {
        return Attempt::Ambiguous;
    }
    let mut union = left.united(right, &motion);
    union.links.extend(measured.into_iter().filter(Link::is_promising));
    union.average(sketches, edge);
    Attempt::Joined(union)
}

/// How well the strongest pairs of a join touch at full resolution.
pub(super) fn touching(scene: &Scene, measured: &[Link]) -> f64 {
    let mut strongest: Vec<&Link> = measured.iter().collect();
    strongest.sort_by(|a, b| scene.score(b).total_cmp(&scene.score(a)).then((a.i, a.j).cmp(&(b.i, b.j))));
    let shares: Vec<f64> = strongest
        .iter()
        .take(WITNESSES)
        .filter(|link| link.is_promising())
        .filter_map(|link| contact(&scene.views[link.i], &scene.views[link.j], &link.motion_i_j, scene.resolution))
        .map(|contact| contact.touching)
        .collect();
    shares.iter().sum::<f64>() / shares.len().max(1) as f64
}

/// The motion from the right group's world into the left one's that a link stands for, whichever way round it is.
pub(super) fn implied(left: &Group, right: &Group, link: &Link) -> Option<Motion> {
    match (left.pose_of(link.i), right.pose_of(link.j)) {
        (Some(pose_i), Some(pose_j)) => Some(pose_i * link.motion_i_j * pose_j.inverse()),
        _ => {
            let (pose_j, pose_i) = (left.pose_of(link.j)?, right.pose_of(link.i)?);
            Some(pose_j * link.motion_i_j.inverse() * pose_i.inverse())
        }
    }
}

/// What all pairs of a left and a right view say when the groups are laid on each other.
pub(super) fn measure_all(sketches: &[Sketch], left: &Group, right: &Group, motion: &Motion, edge: f64) -> Vec<Link> {
    let pairs: Vec<(usize, usize)> =
        left.views.iter().flat_map(|&i| right.views.iter().map(move |&j| (i, j))).collect();
    pairs
        .par_iter()
        .with_max_len(1)
        .filter_map(|&(i, j)| {
            let motion_i_j = left.pose_of(i)?.inv_mul(&(motion * right.pose_of(j)?));
            measure(sketches, i, j, &motion_i_j, edge)
        })
        .collect()
}

/// What a pair says of an implied motion, drawn onto the surface first if that stays near; `None` if the views are
/// apart.
pub(super) fn measure(sketches: &[Sketch], i: usize, j: usize, implied: &Motion, edge: f64) -> Option<Link> {
    if implied.translation.vector.norm() > sketches[i].radius + sketches[j].radius {
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
    Some(if drawn.score() > raw.score() { drawn } else { raw })
}
