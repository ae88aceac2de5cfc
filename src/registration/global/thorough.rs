//! What is done where the quick way leaves views open, or a group that contradicts itself: more proposals for each pair,
//! and groups grown from many of them.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::assembly::{Assembly, measure};
use super::consensus::{Support, alike, proposals};
use super::glance::Glanced;
use super::group::Group;
use super::growth::{Known, grow};
use super::hinted::assemble_hinted;
use super::link::Link;
use super::scene::Scene;
use super::turning::turnings;
use super::verification::verify;
use super::votes::SurfelVotes;
use super::{links_of, matching};
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress};
use crate::registration::hinted::Hinted;

/// Motions of a pair that are proposed by single matches, and by matches that are not on one plane.
const PROPOSALS: usize = 12;
/// Surfels of a view that are asked of a group.
const SAMPLES: usize = 100;
/// Groups of fewer views say too little to be clear.
const LEAST_VIEWS: usize = 3;
/// Of what all pairs of a clear group say, at most this share is that a scanner looked through a surface or missed it
/// (the dragon's say 0.011),
const NOT_SEEN: f64 = 0.02;
/// and at least this share agrees (the happy buddha's say 0.865).
const AGREE: f64 = 0.83;

/// A link within a group that says something else, is as strong as this and stronger than what the group says instead,
/// contradicts it: on right registrations of real scans of things such links have 0.025 at most, and smooth pebbles laid on
/// each other the wrong way have left right ones of 0.1 to 0.4 unused.
const CONTRADICTING: f64 = 0.2;
/// A group of which more than this share of views is contradicted is not clear at all: half of it may lie wrong.
const CONTRADICTED: f64 = 0.125;
/// Another place is as good as a view's own from this share of what speaks for that on.
const RIVAL: f64 = 0.8;
/// More open views than this are not looked at thoroughly: it takes seconds for each.
const MOST_OPEN: usize = 24;
/// Motions nearer to each other than this, in edges, say the same.
const SAME: f64 = 4.0;

/// What is clear of an assembly: of each group the views that hardly anything speaks against, if they agree with each other.
#[derive(Debug, Clone)]
pub struct Cores {
    groups: Vec<Group>,
    /// For each view which of `groups` holds it.
    home: Vec<Option<usize>>,
}

impl Cores {
    /// Asks the groups of an assembly.
    pub fn of(scene: &Scene, links: &[Link], assembly: &Assembly) -> Self {
        let mut cores = Cores { groups: Vec::new(), home: vec![None; scene.sketches.len()] };
        for group in assembly.groups.iter().filter(|group| group.views.len() >= LEAST_VIEWS) {
            let core = without_contradicted(scene, links, group);
            if is_coherent(scene, &core) {
                core.views.iter().for_each(|view| cores.home[*view] = Some(cores.groups.len()));
                cores.groups.push(core);
            }
        }
        cores
    }

    /// Whether one core holds all views.
    pub fn hold_all(&self) -> bool {
        self.groups.len() == 1 && self.home.iter().all(Option::is_some)
    }

    /// How many views are of none.
    fn open(&self) -> usize {
        self.home.iter().filter(|home| home.is_none()).count()
    }

    /// Whether two views are of one core.
    fn hold(&self, i: usize, j: usize) -> bool {
        self.home[i].is_some() && self.home[i] == self.home[j]
    }
}

/// Assembles groups anew, with more links, which are added; what is clear of the `quick` assembly stays. `pairs` are those
/// that are matched.
pub fn assemble_thoroughly(
    scene: &Scene,
    links: &mut Vec<Link>,
    pairs: &[(usize, usize)],
    (quick, cores): (&Assembly, Cores),
    hinted: &Hinted,
    progress: &Progress,
) -> Result<Assembly, Canceled> {
    if cores.open() > MOST_OPEN {
        return Ok(quick.clone());
    }
    links.extend(more_links(scene, links, pairs, &cores, progress)?);
    let is_open = |group: &&Group| group.views.iter().all(|view| cores.home[*view].is_none());
    let open: Vec<Group> = quick.groups.iter().filter(is_open).cloned().collect();
    let grown = grow(scene, links, &Known { clear: &cores.groups, open: &open }, progress)?;
    let mut assembly = assemble_hinted(scene, links, grown.groups, hinted, progress)?;
    for group in assembly.groups.iter().filter(|group| group.views.len() == 1) {
        assembly.ambiguous[group.views[0]] |= grown.ambiguous[group.views[0]];
    }
    Ok(assembly)
}

/// A group without the views that a link contradicts; if these are many, nothing of it is clear.
fn without_contradicted(scene: &Scene, links: &[Link], group: &Group) -> Group {
    let mut place = vec![None; scene.sketches.len()];
    group.views.iter().enumerate().for_each(|(k, view)| place[*view] = Some(k));
    let contradicted: Vec<[Option<usize>; 2]> = links
        .par_iter()
        .filter_map(|link| Some((link, place[link.i]?, place[link.j]?)))
        .filter(|(link, k, l)| contradicts(scene, link, &group.local_poses[*k].inv_mul(&group.local_poses[*l])))
        .map(|(link, k, l)| {
            // what a frame does not show can't speak against a link: its pair alone says too little
            if !(scene.sketches[link.i].sight.is_cropped() && scene.sketches[link.j].sight.is_cropped()) {
                return [Some(k), Some(l)];
            }
            let pose_l = group.local_poses[k] * link.motion_i_j;
            let pose_k = group.local_poses[l] * link.motion_i_j.inverse();
            [(k, pose_k), (l, pose_l)].map(|(place, pose)| is_as_well_at(scene, group, place, &pose).then_some(place))
        })
        .collect();
    let contradicted: BTreeSet<usize> = contradicted.into_iter().flatten().flatten().collect();
    if contradicted.len() as f64 > CONTRADICTED * group.views.len() as f64 {
        return group.among(&[]);
    }
    let clear: Vec<usize> = (0..group.views.len()).filter(|k| !contradicted.contains(k)).collect();
    group.among(&clear)
}

/// Whether a strong link says something else than the motion by which a group lays its pair, and more clearly.
fn contradicts(scene: &Scene, link: &Link, implied: &Motion) -> bool {
    let score = scene.score(link);
    score >= CONTRADICTING
        && !alike(implied, &link.motion_i_j, scene.sketches[link.j].radius, SAME * scene.edge)
        && measure(scene.sketches, link.i, link.j, implied, scene.edge).is_none_or(|own| score > scene.score(&own))
}

/// Whether as much speaks for another pose of a group's view as for its own, by all others of the group.
fn is_as_well_at(scene: &Scene, group: &Group, place: usize, pose: &Motion) -> bool {
    let sketch = |k: usize| &scene.sketches[group.views[k]];
    let balance = |pose: &Motion| -> f64 {
        let others = (0..group.views.len()).filter(|other| *other != place);
        let motions = others.map(|other| (other, group.local_poses[other].inv_mul(pose)));
        let near = motions
            .filter(|(other, motion)| motion.translation.vector.norm() < sketch(*other).radius + sketch(place).radius);
        near.map(|(other, motion)| verify(sketch(other), sketch(place), &motion, scene.edge, SAMPLES).both().balance())
            .sum()
    };
    balance(pose) > RIVAL * balance(&group.local_poses[place])
}

/// Whether the pairs of a group agree, and no scanner looked through what another saw.
fn is_coherent(scene: &Scene, group: &Group) -> bool {
    let n = group.views.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    let votes: Vec<SurfelVotes> = pairs
        .par_iter()
        .map(|&(k, l)| {
            let (i, j) = (&scene.sketches[group.views[k]], &scene.sketches[group.views[l]]);
            let motion_i_j = group.local_poses[k].inv_mul(&group.local_poses[l]);
            verify(i, j, &motion_i_j, scene.edge, SAMPLES).both()
        })
        .collect();
    let votes: SurfelVotes = votes.into_iter().sum();
    n >= LEAST_VIEWS && votes.unseen() <= NOT_SEEN * votes.said() && votes.agree >= AGREE * votes.said()
}

/// Further links of the pairs that are matched, but for those within one core.
fn more_links(
    scene: &Scene,
    known: &[Link],
    pairs: &[(usize, usize)],
    cores: &Cores,
    progress: &Progress,
) -> Result<Vec<Link>, Canceled> {
    let pairs: Vec<(usize, usize)> = pairs.iter().copied().filter(|&(i, j)| !cores.hold(i, j)).collect();
    let glanced: Vec<Glanced> = scene.sketches.par_iter().map(|sketch| Glanced::new(sketch, scene.edge)).collect();
    let found: Vec<Vec<Link>> = pairs
        .par_iter()
        .with_max_len(1)
        .map(|&(i, j)| {
            progress.check()?;
            let matches = matching::matches(&scene.sketches[i], &scene.sketches[j], scene.edge);
            let (a, b) = (&scene.sketches[i], &scene.sketches[j]);
            let agreed = proposals(a, b, &matches, Support::AcrossPlanes, scene.edge, PROPOSALS);
            let turned = turnings(&glanced[i], &glanced[j], &matches, scene.edge, PROPOSALS);
            let proposed = agreed.into_iter().map(|proposal| proposal.motion_i_j).chain(turned);
            let known: Vec<Link> = known.iter().filter(|link| (link.i, link.j) == (i, j)).copied().collect();
            Ok(links_of(scene.sketches, (i, j), proposed, &known, scene.edge))
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(found.into_iter().flatten().collect())
}
