//! What a person said of the views, in global registration: it proposes, and it joins where the surfaces let it.
//!
//! Picked points propose a motion of their pair. Where the surfaces don't contradict it, the pair is laid so before
//! anything is grown, whatever else would fit as well. Pairs that are said to overlap are searched as thoroughly as open
//! ones are, and may be joined on half the evidence.

use super::alignment::align;
use super::assembly::{Assembly, assemble, implied, measure_all, touching};
use super::confidence::Grounds;
use super::consensus::{self, Support, alike};
use super::glance::Glanced;
use super::group::Group;
use super::link::Link;
use super::matching::Match;
use super::scene::Scene;
use super::sketch::Sketch;
use super::slide::slides;
use super::touch::contact;
use super::turning::turnings;
use super::verification::verify;
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress};
use crate::registration::hinted::{Hinted, PickedPair};

/// Surfels of a view that are asked of picked points.
const SAMPLES: usize = 400;
/// Drawn onto the surface, picked places may come apart by this many edges more.
const DRAWN: f64 = 3.0;
/// Picked points are followed if this share of the surfels agrees,
const LEAST_OVERLAP: f64 = 0.02;
/// this share of what was said: more speaks for them than against,
const CONSISTENT: f64 = 0.5;
/// this share of the points near each other touches at full resolution,
const TOUCHING: f64 = 0.5;
/// and no other motion of the pair, at least as consistent, is stronger by this factor
const OVERRULED: f64 = 2.0;
/// (unless so much agrees that nothing speaks against them: a like part elsewhere may be larger).
const CLEAR: f64 = 0.8;
/// Poses that differ by less than this, in edges, are the same.
const SAME: f64 = 4.0;
/// Groups that are said to overlap are joined on half the score that others need,
const JOINED_SCORE: f64 = 0.08;
/// and of contact.
const JOINED_TOUCHING: f64 = 0.6;
/// Another way to lay them on each other is a rival from this share of the score on.
const RIVAL: f64 = 0.85;
/// Motions of a pair that is said to overlap, proposed by single matches.
const PROPOSALS: usize = 12;

/// What is known before anything was searched.
#[derive(Debug, Clone, Copy)]
pub struct Prior<'a> {
    /// Poses that are thought to be known, local frame to world.
    pub given: &'a [Option<Motion>],
    /// What a person said.
    pub hinted: &'a Hinted,
}

impl Prior<'_> {
    /// The motions of a pair that poses and picked points give.
    pub fn proposed(&self, i: usize, j: usize) -> impl Iterator<Item = Motion> {
        let given = self.given[i].zip(self.given[j]).map(|(pose_i, pose_j)| pose_i.inv_mul(&pose_j));
        self.hinted.motion(i, j).into_iter().chain(given)
    }

    /// Further motions of a pair that is said to overlap.
    pub fn thoroughly_proposed(
        &self,
        sketches: &[Sketch],
        (i, j): (usize, usize),
        matches: &[Match],
        edge: f64,
    ) -> Vec<Motion> {
        if !self.hinted.is_overlapping(i, j) {
            return Vec::new();
        }
        let (i, j) = (Glanced::new(&sketches[i], edge), Glanced::new(&sketches[j], edge));
        turnings(&i, &j, matches, edge, PROPOSALS)
    }
}

/// Assembles groups from those `begun`, pairs with picked points first.
pub fn assemble_hinted(
    scene: &Scene,
    links: &[Link],
    begun: Vec<Group>,
    hinted: &Hinted,
    progress: &Progress,
) -> Result<Assembly, Canceled> {
    if *hinted == Hinted::default() {
        return assemble(scene, links, begun, progress);
    }
    let followed: Vec<Link> = hinted.picked.iter().filter_map(|pair| followed(scene, links, pair)).collect();
    let begun = with_begun(scene, laid_out(scene, followed), begun);
    let assembly = assemble(scene, links, begun, progress)?;
    Ok(join_overlapping(scene, links, assembly, hinted))
}

/// The link that picked points make, if the surfaces don't contradict it.
fn followed(scene: &Scene, links: &[Link], pair: &PickedPair) -> Option<Link> {
    let (i, j) = (pair.i, pair.j);
    let (a, b) = (&scene.sketches[i], &scene.sketches[j]);
    let picked = pair.fit.a_from_b;
    let drawn = align(a, b, &picked, scene.edge);
    let stays = pair.distances(&drawn).0 <= pair.tolerance.max(pair.fit.rms + DRAWN * scene.edge);
    let motion_i_j = if stays { drawn } else { picked };
    let link = Link { i, j, motion_i_j, evidence: verify(a, b, &motion_i_j, scene.edge, SAMPLES) };
    let touches = || contact(&scene.views[i], &scene.views[j], &motion_i_j, scene.resolution).map(|c| c.touching);
    let consistency = link.evidence.both().consistency();
    let is_overruled = |other: &Link| {
        (other.i, other.j) == (i, j)
            && !alike(&other.motion_i_j, &motion_i_j, b.radius, SAME * scene.edge)
            && other.evidence.both().consistency() >= consistency
            && scene.score(other) > OVERRULED * scene.score(&link)
    };
    let holds = link.evidence.overlap() >= LEAST_OVERLAP
        && consistency >= CONSISTENT
        && (consistency >= CLEAR || !links.iter().any(is_overruled))
        && touches().is_some_and(|touching| touching >= TOUCHING);
    holds.then_some(link)
}

/// The groups that links make by themselves.
fn laid_out(scene: &Scene, mut links: Vec<Link>) -> Vec<Group> {
    links.sort_by(|a, b| scene.score(b).total_cmp(&scene.score(a)).then((a.i, a.j).cmp(&(b.i, b.j))));
    let mut groups: Vec<Group> = Vec::new();
    let take = |groups: &mut Vec<Group>, view: usize| match groups.iter().position(|g| g.views.contains(&view)) {
        Some(index) => groups.swap_remove(index),
        None => Group::of(view),
    };
    for link in links {
        let mut left = take(&mut groups, link.i);
        if !left.views.contains(&link.j) {
            let right = take(&mut groups, link.j);
            let Some(motion) = implied(&left, &right, &link) else { continue };
            left = left.united(&right, &motion);
        }
        left.links.push(link);
        groups.push(left);
    }
    groups.iter_mut().for_each(|group| group.average(scene.sketches, scene.edge));
    groups.sort_by_key(|group| group.views[0]);
    groups
}

/// Groups that were grown, with those that a person laid out: united where they say the same; where they don't, the grown
/// ones lose the views in question.
fn with_begun(scene: &Scene, laid_out: Vec<Group>, grown: Vec<Group>) -> Vec<Group> {
    let mut kept = laid_out;
    for mut group in grown {
        let (sharing, apart): (Vec<Group>, Vec<Group>) =
            kept.into_iter().partition(|other| other.views.iter().any(|view| group.views.contains(view)));
        kept = apart;
        for other in sharing {
            match agreement(scene, &group, &other) {
                Some(motion) => group = group.united(&without(&other, &group.views), &motion),
                None => {
                    group = without(&group, &other.views);
                    kept.push(other);
                }
            }
        }
        if group.views.len() > 1 {
            kept.push(group);
        }
    }
    kept.sort_by_key(|group| group.views[0]);
    kept
}

/// The motion from the other group's world into this one's, if they agree on all views of both.
fn agreement(scene: &Scene, group: &Group, other: &Group) -> Option<Motion> {
    let shared: Vec<usize> = group.views.iter().copied().filter(|view| other.views.contains(view)).collect();
    let pose = |group: &Group, view: usize| group.pose_of(view).unwrap_or_default();
    let first = *shared.first()?;
    let motion = pose(group, first) * pose(other, first).inverse();
    let is_same = |view: &usize| {
        let radius = scene.sketches[*view].radius;
        alike(&(motion * pose(other, *view)), &pose(group, *view), radius, SAME * scene.edge)
    };
    shared.iter().all(is_same).then_some(motion)
}

/// A group without some of its views.
fn without(group: &Group, views: &[usize]) -> Group {
    let kept = |view: &usize| !views.contains(view);
    let rows = group.views.iter().copied().zip(group.local_poses.iter().copied()).filter(|(view, _)| kept(view));
    let (left, local_poses) = rows.unzip();
    let links = group.links.iter().filter(|link| kept(&link.i) && kept(&link.j)).copied().collect();
    Group { views: left, local_poses, links, search: group.search }
}

/// Joins groups whose views are said to overlap on less evidence than others need.
fn join_overlapping(scene: &Scene, links: &[Link], mut assembly: Assembly, hinted: &Hinted) -> Assembly {
    for &(i, j) in &hinted.overlapping {
        let home = |view: usize| assembly.groups.iter().position(|group| group.views.contains(&view));
        let Some((a, b)) = home(i).zip(home(j)).filter(|(a, b)| a != b) else { continue };
        let (left, right) = (&assembly.groups[a], &assembly.groups[b]);
        let Some(union) = joined(scene, links, left, right, (i, j)) else { continue };
        union.views.iter().for_each(|view| assembly.ambiguous[*view] = false);
        assembly.groups[a] = union;
        assembly.groups.remove(b);
    }
    super::assembly::sort_by_size(&mut assembly.groups);
    assembly
}

fn joined(scene: &Scene, links: &[Link], left: &Group, right: &Group, (i, j): (usize, usize)) -> Option<Group> {
    let mut found: Vec<(Grounds, Vec<Link>, Motion)> = links
        .iter()
        .filter(|link| (link.i, link.j) == (i, j))
        .filter_map(|link| implied(left, right, link))
        .map(|motion| {
            let measured = measure_all(scene.sketches, left, right, &motion, scene.edge);
            (Grounds::of(scene, &measured), measured, motion)
        })
        .filter(|(grounds, ..)| grounds.best >= JOINED_SCORE && grounds.score >= JOINED_SCORE)
        .collect();
    found.sort_by(|a, b| b.0.score.total_cmp(&a.0.score));
    found.retain(|(_, measured, _)| touching(scene, measured) >= JOINED_TOUCHING);
    let (best, measured, motion) = found.first()?;
    let radius = right.views.iter().map(|view| scene.sketches[*view].radius).fold(0.0, f64::max);
    let is_rival = |(grounds, _, other): &(Grounds, Vec<Link>, Motion)| {
        !alike(other, motion, radius, SAME * scene.edge) && grounds.score > RIVAL * best.score
    };
    if found.iter().any(is_rival) || slides(scene.sketches, measured, scene.edge, SAMPLES) {
        return None;
    }
    let mut union = left.united(right, motion);
    union.links.extend(measured.iter().filter(|link| link.is_promising()));
    union.average(scene.sketches, scene.edge);
    Some(union)
}

/// The proposals of a pair: those that are known, then those of many matches, then, where it is said to overlap, those of
/// single ones.
pub fn proposed(sketches: &[Sketch], (i, j): (usize, usize), prior: &Prior, edge: f64, count: usize) -> Vec<Motion> {
    let matches = super::matching::matches(&sketches[i], &sketches[j], edge);
    let proposals = consensus::proposals(&sketches[i], &sketches[j], &matches, Support::Any, edge, count);
    prior
        .proposed(i, j)
        .chain(proposals.into_iter().map(|proposal| proposal.motion_i_j))
        .chain(prior.thoroughly_proposed(sketches, (i, j), &matches, edge))
        .collect()
}
