//! Global registration: from scans alone to poses that `joint` can start from.
//!
//! Each scan is thinned to oriented surfels that are described once ([`sketch`], [`descriptor`]). Of each pair the
//! surfels that look alike are matched ([`matching`]), motions that many matches agree on are found ([`consensus`]), drawn
//! onto the surface ([`alignment`]) and asked whether the surfaces bear them out ([`verification`]). Groups of views then
//! grow by the best pairs that all their views bear out ([`assembly`]).

pub mod alignment;
pub mod alternatives;
pub mod assembly;
pub mod confidence;
pub mod consensus;
pub mod cropped;
pub mod descriptor;
pub mod glance;
pub mod grid;
pub mod group;
pub mod growth;
pub mod hinted;
pub mod link;
pub mod matching;
pub mod onto;
pub mod other_side;
pub mod partners;
pub mod placement;
pub mod report;
pub mod scan_set;
pub mod scene;
pub mod sight;
pub mod sketch;
pub mod slide;
pub mod standing;
pub mod thorough;
pub mod touch;
pub mod turning;
pub mod verification;
pub mod votes;

use rayon::prelude::*;

use self::assembly::Assembly;
use self::cropped::{Frames, crop};
use self::group::Group;
use self::hinted::{Prior, assemble_hinted};
use self::link::Link;
use self::other_side::try_other_sides;
use self::scene::{Scene, noise_level, resolution};
use self::sketch::{Sketch, count_voxels, sketch_all};
use self::standing::Standing;
use self::thorough::Cores;
use super::multiview;
use super::sensor::Sensor;
use super::view::View;
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress, Stage};

/// About how many surfels stand for a view.
const SURFELS: f64 = 1500.0;
/// Voxels of a view at most, on average.
const MOST_SURFELS: f64 = 2200.0;
/// A voxel narrower than this (in spacings) holds too few points to average.
const FINEST_EDGE: f64 = 2.5;
/// A view of n points has about `n (EDGE_FACTOR / edge)^2` voxels of an edge given in spacings.
const EDGE_FACTOR: f64 = 1.7;
/// Motions of a pair that are drawn onto the surface.
const PROPOSALS: usize = 32;
/// Of these the ones that take part further.
const LINKS: usize = 5;
/// Surfels of a view that are asked whether a motion is right.
const SAMPLES: usize = 400;

/// What global registration found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Groups of views that hang together; the largest first.
    pub groups: Vec<Group>,
    /// For each view whether it, or its group, fits the rest in several ways.
    pub ambiguous: Vec<bool>,
    /// The searches by which they were found; see [`Group::search`].
    pub searches: Vec<Search>,
}

/// What was seen and proposed while views were one set.
#[derive(Debug, Clone)]
pub struct Search {
    /// The views.
    pub views: Vec<usize>,
    /// For each of `views` its sketch.
    pub sketches: Vec<Sketch>,
    /// All their pairs' candidates.
    pub links: Vec<Link>,
    /// Edge of the surfels' voxels, a length.
    pub edge: f64,
    /// Root mean square distance, in edges, of surfaces that are the same.
    pub noise: f64,
}

impl Search {
    /// The search with view k called `names[k]`, which rise.
    fn renamed(mut self, names: &[usize]) -> Search {
        self.views.iter_mut().for_each(|view| *view = names[*view]);
        self.links.iter_mut().for_each(|link| (link.i, link.j) = (names[link.i], names[link.j]));
        self
    }

    /// The views of a group that was found here, with the side from which each was seen. A sketch's side is only a
    /// guess, but where views agree their sides do, too: seen from the wrong one their surfaces would look the other way.
    pub fn seen(&self, views: &[View], group: &[usize]) -> Vec<View> {
        let sketch =
            |view: usize| self.views.iter().position(|other| *other == view).map(|place| &self.sketches[place]);
        let sensor = |view: usize| views[view].sensor.or_else(|| sketch(view).map(|sketch| sketch.sensor));
        let seen = |view: &usize| View { sensor: sensor(*view), ..views[*view].clone() };
        group.iter().map(seen).collect()
    }

    /// How the views of a refined group that was found here stand.
    pub fn standings(&self, views: &[usize], local_poses: &[Motion]) -> Vec<Standing> {
        let place = |view: usize| views.iter().position(|other| *other == view);
        let sketches: Vec<&Sketch> =
            self.views.iter().zip(&self.sketches).filter(|(view, _)| views.contains(view)).map(|(_, s)| s).collect();
        let named = |link: &Link| Some(Link { i: place(link.i)?, j: place(link.j)?, ..*link });
        let links: Vec<Link> = self.links.iter().filter_map(named).collect();
        standing::standings(&sketches, local_poses, &links, self.edge, self.noise)
    }
}

/// The edge of the voxels, in the unit of the scans.
///
/// From the number of points, as if they were spread evenly; wider where that gives many more voxels, as in rooms and
/// streets, where most points lie near the scanner.
pub fn edge_of(views: &[View]) -> f64 {
    let count = views.len().max(1) as f64;
    let points = views.iter().map(|view| view.points().len() as f64).sum::<f64>() / count;
    let edge = multiview::common_spacing(views) * (EDGE_FACTOR * (points / SURFELS).sqrt()).max(FINEST_EDGE);
    let voxels: usize = views.par_iter().map(|view| count_voxels(view.points(), edge)).sum();
    edge * (voxels as f64 / count / MOST_SURFELS).sqrt().max(1.0)
}

/// Groups `views` and finds poses within each group. The largest group is told apart first; what is left is a set of
/// its own, with lengths and noise of its own: it may be another object, scanned more finely or more coarsely. What is
/// known in `prior` proposes, like matches do. `sensors` tell where the scanner stood (local frame), where that is known.
pub fn find(views: &[View], prior: &Prior, sensors: &[Option<Sensor>], progress: &Progress) -> Result<Found, Canceled> {
    let mut found = find_at_once(views, prior, sensors, progress)?;
    let mut settled = 1;
    while let Some(rest) = rest_beyond(&found.groups, settled) {
        let views: Vec<View> = rest.iter().map(|view| views[*view].clone()).collect();
        let given: Vec<Option<Motion>> = rest.iter().map(|view| prior.given[*view]).collect();
        let hinted = prior.hinted.among(&rest);
        let sensors: Vec<Option<Sensor>> = rest.iter().map(|view| sensors[*view]).collect();
        let again = find_at_once(&views, &Prior { given: &given, hinted: &hinted }, &sensors, progress)?;
        found.groups.truncate(settled);
        let search = found.searches.len();
        found.groups.extend(again.groups.into_iter().map(|group| group.renamed(&rest, search)));
        found.searches.extend(again.searches.into_iter().map(|search| search.renamed(&rest)));
        rest.iter().zip(again.ambiguous).for_each(|(view, ambiguous)| found.ambiguous[*view] |= ambiguous);
        settled += 1;
    }
    assembly::sort_by_size(&mut found.groups);
    Ok(found)
}

/// The views that are in none of the first `settled` groups, in order, if another group may be found among them.
fn rest_beyond(groups: &[Group], settled: usize) -> Option<Vec<usize>> {
    if groups.get(settled - 1)?.views.len() < 2 {
        return None;
    }
    let mut rest: Vec<usize> = groups[settled..].iter().flat_map(|group| group.views.iter().copied()).collect();
    rest.sort_unstable();
    (rest.len() >= 2).then_some(rest)
}

/// Groups views with one length of surfels and one level of noise for all.
fn find_at_once(
    views: &[View],
    prior: &Prior,
    sensors: &[Option<Sensor>],
    progress: &Progress,
) -> Result<Found, Canceled> {
    let edge = edge_of(views);
    let mut sketches = sketch_all(views, edge, sensors);
    prior.hinted.cut.iter().for_each(|view| sketches[*view].sight.crop());
    progress.report(Stage::Registering, 0.05);
    let pairs = partners::likely_pairs(&sketches, prior);
    let drawn: Vec<Vec<Motion>> = pairs
        .par_iter()
        .with_max_len(1)
        .map(|&(i, j)| {
            progress.check()?;
            Ok(drawn_motions(&sketches, (i, j), hinted::proposed(&sketches, (i, j), prior, edge, PROPOSALS), &[], edge))
        })
        .collect::<Result<_, Canceled>>()?;
    let mut links = best_links(&sketches, &pairs, &drawn, edge);
    let is_framed = partners::is_large(views.len()) && crop(&mut sketches, &links, Frames::All);
    if is_framed {
        links = best_links(&sketches, &pairs, &drawn, edge);
    }
    let mut noise = noise_level(&links, edge);
    let spacing = multiview::common_spacing(views);
    let scene = Scene { views, sketches: &sketches, resolution: resolution(spacing, noise, edge), edge, noise };
    let mut assembly = assemble_hinted(&scene, &links, Vec::new(), prior.hinted, progress)?;
    let mut cores = Cores::of(&scene, &links, &assembly);
    if !cores.hold_all() && !is_framed && crop(&mut sketches, &links, Frames::Some) {
        links = best_links(&sketches, &pairs, &drawn, edge);
        noise = noise_level(&links, edge);
        let scene = Scene { views, sketches: &sketches, resolution: resolution(spacing, noise, edge), edge, noise };
        assembly = assemble_hinted(&scene, &links, Vec::new(), prior.hinted, progress)?;
        cores = Cores::of(&scene, &links, &assembly);
    }
    if !cores.hold_all() {
        let is_changed = try_other_sides(views, prior, &pairs, &mut sketches, &mut links, edge, progress)?;
        noise = noise_level(&links, edge);
        let scene = Scene { views, sketches: &sketches, resolution: resolution(spacing, noise, edge), edge, noise };
        if is_changed {
            assembly = assemble_hinted(&scene, &links, Vec::new(), prior.hinted, progress)?;
            cores = Cores::of(&scene, &links, &assembly);
        }
        assembly =
            thorough::assemble_thoroughly(&scene, &mut links, &pairs, (&assembly, cores), prior.hinted, progress)?;
    }
    let Assembly { groups, ambiguous } = assembly;
    let search = Search { views: (0..views.len()).collect(), sketches, links, edge, noise };
    Ok(Found { groups, ambiguous, searches: vec![search] })
}

/// The best ways to lay two views on each other.
fn pair_links(sketches: &[Sketch], i: usize, j: usize, prior: &Prior, edge: f64) -> Vec<Link> {
    let proposed = hinted::proposed(sketches, (i, j), prior, edge, PROPOSALS);
    links_of(sketches, (i, j), proposed, &[], edge)
}

/// The best of the proposed motions of a pair, drawn onto the surface; those that are `known` already are left out.
fn links_of(
    sketches: &[Sketch],
    pair: (usize, usize),
    proposed: impl IntoIterator<Item = Motion>,
    known: &[Link],
    edge: f64,
) -> Vec<Link> {
    best_of_pair(sketches, pair, &drawn_motions(sketches, pair, proposed, known, edge), edge)
}

/// The proposed motions of a pair drawn onto the surface, no two of them alike, and none like one that is `known`.
fn drawn_motions(
    sketches: &[Sketch],
    (i, j): (usize, usize),
    proposed: impl IntoIterator<Item = Motion>,
    known: &[Link],
    edge: f64,
) -> Vec<Motion> {
    let (a, b) = (&sketches[i], &sketches[j]);
    let is_same = |other: &Motion, motion: &Motion| consensus::alike(other, motion, b.radius, 2.0 * edge);
    let mut drawn: Vec<Motion> = Vec::new();
    for motion in proposed {
        let motion = alignment::align(a, b, &motion, edge);
        let is_known = known.iter().any(|link| is_same(&link.motion_i_j, &motion));
        if !is_known && !drawn.iter().any(|other| is_same(other, &motion)) {
            drawn.push(motion);
        }
    }
    drawn
}

/// The best links of all pairs, of the motions by which each may lie.
fn best_links(sketches: &[Sketch], pairs: &[(usize, usize)], drawn: &[Vec<Motion>], edge: f64) -> Vec<Link> {
    let of_pair = |(pair, motions): (&(usize, usize), &Vec<Motion>)| best_of_pair(sketches, *pair, motions, edge);
    let found: Vec<Vec<Link>> = pairs.par_iter().zip(drawn).map(of_pair).collect();
    found.into_iter().flatten().collect()
}

/// Those of some motions of a pair that the surfaces bear out best.
fn best_of_pair(sketches: &[Sketch], (i, j): (usize, usize), motions: &[Motion], edge: f64) -> Vec<Link> {
    let link = |motion_i_j: &Motion| {
        let evidence = verification::verify(&sketches[i], &sketches[j], motion_i_j, edge, SAMPLES);
        Link { i, j, motion_i_j: *motion_i_j, evidence }
    };
    let mut links: Vec<Link> = motions.iter().map(link).collect();
    links.sort_by(|a, b| b.score().total_cmp(&a.score()));
    links.truncate(LINKS);
    links
}
