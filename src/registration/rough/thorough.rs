//! What is done where the quick way leaves views open, or a group that contradicts itself: more proposals for each pair,
//! and groups grown from many of them.

use rayon::prelude::*;

use super::assembly::{Assembly, measure};
use super::consensus::{Support, alike, proposals};
use super::glance::Glanced;
use super::group::Group;
use super::growth::grow;
use super::hinted::assemble_hinted;
use super::link::Link;
use super::scene::Scene;
use super::turning::turnings;
use super::verification::verify;
use super::votes::SurfelVotes;
use super::{links_of, matching};
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
/// makes it unclear: on right registrations of real scans such links have 0.025 at most, and smooth pebbles laid on each
/// other the wrong way have left right ones of 0.1 to 0.4 unused.
const CONTRADICTING: f64 = 0.2;
/// Motions nearer to each other than this, in edges, say the same.
const SAME: f64 = 4.0;

/// Whether one clear group holds all views.
pub fn is_settled(scene: &Scene, links: &[Link], assembly: &Assembly) -> bool {
    assembly.groups.len() == 1 && is_clear(scene, links, &assembly.groups[0])
}

/// Assembles groups anew, with more links, which are added.
pub fn assemble_thoroughly(
    scene: &Scene,
    links: &mut Vec<Link>,
    quick: &Assembly,
    hinted: &Hinted,
    progress: &Progress,
) -> Result<Assembly, Canceled> {
    links.extend(more_links(scene, links, &quick.groups, progress)?);
    let grown = grow(scene, links, &quick.groups, progress)?;
    let mut assembly = assemble_hinted(scene, links, grown.groups, hinted, progress)?;
    for group in assembly.groups.iter().filter(|group| group.views.len() == 1) {
        assembly.ambiguous[group.views[0]] |= grown.ambiguous[group.views[0]];
    }
    Ok(assembly)
}

/// Whether hardly anything speaks against a group.
fn is_clear(scene: &Scene, links: &[Link], group: &Group) -> bool {
    is_coherent(scene, group) && !links.iter().any(|link| contradicts(scene, link, group))
}

/// Whether a strong link between two views of a group says something else than the group, and more clearly.
fn contradicts(scene: &Scene, link: &Link, group: &Group) -> bool {
    let score = scene.score(link);
    let place = |view: usize| group.views.iter().position(|other| *other == view);
    let Some((k, l)) = place(link.i).zip(place(link.j)).filter(|_| score >= CONTRADICTING) else { return false };
    let implied = group.local_poses[k].inv_mul(&group.local_poses[l]);
    if alike(&implied, &link.motion_i_j, scene.sketches[link.j].radius, SAME * scene.edge) {
        return false;
    }
    measure(scene.sketches, link.i, link.j, &implied, scene.edge).is_none_or(|own| score > scene.score(&own))
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

/// Further links of all pairs but those within one clear group.
fn more_links(scene: &Scene, known: &[Link], groups: &[Group], progress: &Progress) -> Result<Vec<Link>, Canceled> {
    let clear: Vec<&Group> = groups.iter().filter(|group| is_clear(scene, known, group)).collect();
    let is_open =
        |&(i, j): &(usize, usize)| !clear.iter().any(|group| group.views.contains(&i) && group.views.contains(&j));
    let n = scene.sketches.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).filter(is_open).collect();
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
            let known = known.iter().filter(|link| (link.i, link.j) == (i, j)).copied().collect();
            Ok(links_of(scene.sketches, (i, j), proposed, known, scene.edge))
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(found.into_iter().flatten().collect())
}
