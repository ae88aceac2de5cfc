//! Global registration: from scans alone to poses that `joint` can start from.
//!
//! Each scan is thinned to oriented surfels that are described once ([`coarse_view`], [`descriptor`]). Of each pair the
//! surfels that look alike are matched ([`matching`]), motions that many matches agree on are found ([`consensus`]), refined
//! onto the surface ([`surfel_icp`]) and asked whether the surfaces bear them out ([`verification`]). Components of views then
//! grow by the best pairs that all their views bear out ([`agglomerative`]), of a long row of scans first by those of neighbours
//! ([`sequence`]).

pub mod about_axis;
pub mod agglomerative;
pub mod alternatives;
pub mod axis;
pub mod coarse_set;
pub mod coarse_view;
pub mod component;
pub mod confidence;
pub mod consensus;
pub mod contact;
pub mod cropped;
pub mod cuts;
pub mod descriptor;
pub mod exhaustive;
#[cfg(test)]
mod fixture;
pub mod grid;
pub mod hinted;
pub mod hypothesis_score;
pub mod likely_pairs;
pub mod matching;
pub mod merge_evidence;
pub mod onto;
pub mod pair_hypothesis;
pub mod placement;
pub mod pose_support;
pub mod report;
pub mod rotation_search;
pub mod scan_set;
pub mod sensor_side;
pub mod sequence;
pub mod slippage;
pub mod surfel_icp;
mod turned;
pub mod verification;
pub mod votes;

use rayon::prelude::*;

use self::agglomerative::Agglomeration;
use self::coarse_set::{CoarseSet, noise_level, resolution};
use self::coarse_view::{CoarseView, coarse_views_of, count_voxels};
use self::component::Component;
use self::cropped::{Frames, crop};
use self::exhaustive::Cores;
use self::hinted::{Prior, agglomerate_hinted};
use self::pair_hypothesis::PairHypothesis;
use self::pose_support::PoseSupport;
use self::sensor_side::try_other_sensor_sides;
use crate::sensor::Sensor;
use crate::view::{View, common_spacing};
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress, Stage};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// About how many surfels stand for a view.
        surfels: f64 = 1500.0,
        /// Voxels of a view at most, on average.
        most_surfels: f64 = 2200.0,
        /// A voxel narrower than this (in spacings) holds too few points to average.
        finest_edge: f64 = 2.5,
        /// A view of n points has about `n (TUNING.edge_factor / edge)^2` voxels of an edge given in spacings.
        edge_factor: f64 = 1.7,
        /// Motions of a pair that are refined on the surface.
        proposals: usize = 32,
        /// Of these the ones that take part further.
        hypotheses: usize = 5,
        /// Surfels of a view that are queried whether a motion is right.
        samples: usize = 400,
    }
}

/// What global registration found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Components of views that hang together; the largest first.
    pub components: Vec<Component>,
    /// For each view whether it, or its component, fits the rest in several ways.
    pub ambiguous: Vec<bool>,
    /// The searches by which they were found; see [`Component::search`].
    pub searches: Vec<Search>,
}

/// What was seen and proposed while views were one set.
#[derive(Debug, Clone)]
pub struct Search {
    /// The views.
    pub views: Vec<usize>,
    /// For each of `views` its coarse view.
    pub coarse_views: Vec<CoarseView>,
    /// All their pairs' candidates.
    pub hypotheses: Vec<PairHypothesis>,
    /// Edge of the surfels' voxels, a length.
    pub edge: f64,
    /// Root mean square distance, in edges, of surfaces that are the same.
    pub noise: f64,
    /// Whether its largest component was laid about one axis, and refined so.
    pub is_about_axis: bool,
}

impl Search {
    /// The search with view k called `names[k]`, which rise.
    fn renamed(mut self, names: &[usize]) -> Search {
        self.views.iter_mut().for_each(|view| *view = names[*view]);
        self.hypotheses
            .iter_mut()
            .for_each(|hypothesis| (hypothesis.i, hypothesis.j) = (names[hypothesis.i], names[hypothesis.j]));
        self
    }

    /// The views of a component that was found here, with the side from which each was seen. A coarse view's side is only a
    /// guess, but where views agree their sides do, too: seen from the wrong one their surfaces would look the other way.
    pub fn seen(&self, views: &[View], component: &[usize]) -> Vec<View> {
        let coarse_view =
            |view: usize| self.views.iter().position(|other| *other == view).map(|place| &self.coarse_views[place]);
        let sensor =
            |view: usize| views[view].sensor.or_else(|| coarse_view(view).map(|coarse_view| coarse_view.sensor));
        let seen = |view: &usize| View { sensor: sensor(*view), ..views[*view].clone() };
        component.iter().map(seen).collect()
    }

    /// How the views of a refined component that was found here stand, and the places of those that hold together.
    pub fn pose_supports(&self, views: &[usize], local_poses: &[Motion]) -> (Vec<PoseSupport>, Vec<usize>) {
        let place = |view: usize| views.iter().position(|other| *other == view);
        let coarse_views: Vec<&CoarseView> = self
            .views
            .iter()
            .zip(&self.coarse_views)
            .filter(|(view, _)| views.contains(view))
            .map(|(_, s)| s)
            .collect();
        let named = |hypothesis: &PairHypothesis| {
            Some(PairHypothesis { i: place(hypothesis.i)?, j: place(hypothesis.j)?, ..*hypothesis })
        };
        let hypotheses: Vec<PairHypothesis> = self.hypotheses.iter().filter_map(named).collect();
        let said = pose_support::pairs_said(&coarse_views, local_poses, self.edge);
        let supports =
            pose_support::pose_supports(&coarse_views, local_poses, &hypotheses, &said, self.edge, self.noise);
        // an axis holds what few surfels do not
        let holding = match self.is_about_axis {
            true => (0..views.len()).collect(),
            false => cuts::holding(&coarse_views, local_poses, &said),
        };
        (supports, holding)
    }
}

/// The edge of the voxels, in the unit of the scans.
///
/// From the number of points, as if they were spread evenly; wider where that gives many more voxels, as in rooms and
/// streets, where most points lie near the scanner.
pub fn edge_of(views: &[View]) -> f64 {
    let count = views.len().max(1) as f64;
    let points = views.iter().map(|view| view.points().len() as f64).sum::<f64>() / count;
    let edge = common_spacing(views) * (TUNING.edge_factor * (points / TUNING.surfels).sqrt()).max(TUNING.finest_edge);
    let voxels: usize = views.par_iter().map(|view| count_voxels(view.points(), edge)).sum();
    edge * (voxels as f64 / count / TUNING.most_surfels).sqrt().max(1.0)
}

/// Sorts `views` into components and finds poses within each. The largest component is found first; what is left is a set of
/// its own, with lengths and noise of its own: it may be another object, scanned more finely or more coarsely. What is
/// known in `prior` proposes, like matches do. `sensors` tell where the scanner stood (local frame), where that is known.
pub fn find(views: &[View], prior: &Prior, sensors: &[Option<Sensor>], progress: &Progress) -> Result<Found, Canceled> {
    let mut found = find_at_once(views, prior, sensors, progress)?;
    let mut settled = 1;
    while let Some(rest) = rest_beyond(&found.components, settled) {
        let views: Vec<View> = rest.iter().map(|view| views[*view].clone()).collect();
        let given: Vec<Option<Motion>> = rest.iter().map(|view| prior.given[*view]).collect();
        let hinted = prior.hinted.among(&rest);
        let sensors: Vec<Option<Sensor>> = rest.iter().map(|view| sensors[*view]).collect();
        let again = find_at_once(&views, &Prior { given: &given, hinted: &hinted, turning: None }, &sensors, progress)?;
        found.components.truncate(settled);
        let search = found.searches.len();
        found.components.extend(again.components.into_iter().map(|component| component.renamed(&rest, search)));
        found.searches.extend(again.searches.into_iter().map(|search| search.renamed(&rest)));
        rest.iter().zip(again.ambiguous).for_each(|(view, ambiguous)| found.ambiguous[*view] |= ambiguous);
        settled += 1;
    }
    agglomerative::sort_by_size(&mut found.components);
    Ok(found)
}

/// The views that are in none of the first `settled` components, in order, if another component may be found among them.
fn rest_beyond(components: &[Component], settled: usize) -> Option<Vec<usize>> {
    if components.get(settled - 1)?.views.len() < 2 {
        return None;
    }
    let mut rest: Vec<usize> =
        components[settled..].iter().flat_map(|component| component.views.iter().copied()).collect();
    rest.sort_unstable();
    (rest.len() >= 2).then_some(rest)
}

/// Components views with one length of surfels and one level of noise for all.
fn find_at_once(
    views: &[View],
    prior: &Prior,
    sensors: &[Option<Sensor>],
    progress: &Progress,
) -> Result<Found, Canceled> {
    let edge = edge_of(views);
    let mut coarse_views = coarse_views_of(views, edge, sensors);
    prior.hinted.cut.iter().for_each(|view| coarse_views[*view].depth_image.crop());
    progress.report(Stage::Registering, 0.05);
    let pairs = likely_pairs::likely_pairs(&coarse_views, prior);
    let refined: Vec<Vec<Motion>> = pairs
        .par_iter()
        .with_max_len(1)
        .map(|&(i, j)| {
            progress.check()?;
            Ok(refined_motions(
                &coarse_views,
                (i, j),
                hinted::proposed(&coarse_views, (i, j), prior, edge, TUNING.proposals),
                &[],
                edge,
            ))
        })
        .collect::<Result<_, Canceled>>()?;
    let mut hypotheses = best_hypotheses(&coarse_views, &pairs, &refined, edge);
    let is_framed = likely_pairs::is_large(views.len()) && crop(&mut coarse_views, &hypotheses, Frames::All);
    if is_framed {
        hypotheses = best_hypotheses(&coarse_views, &pairs, &refined, edge);
    }
    let mut noise = noise_level(&hypotheses, edge);
    let spacing = common_spacing(views);
    let coarse_set =
        CoarseSet { views, coarse_views: &coarse_views, resolution: resolution(spacing, noise, edge), edge, noise };
    let mut agglomeration = agglomerate_hinted(&coarse_set, &hypotheses, Vec::new(), prior.hinted, progress)?;
    let mut cores = Cores::of(&coarse_set, &hypotheses, &agglomeration);
    if !cores.hold_all() && !is_framed && crop(&mut coarse_views, &hypotheses, Frames::Some) {
        hypotheses = best_hypotheses(&coarse_views, &pairs, &refined, edge);
        noise = noise_level(&hypotheses, edge);
        let coarse_set =
            CoarseSet { views, coarse_views: &coarse_views, resolution: resolution(spacing, noise, edge), edge, noise };
        agglomeration = agglomerate_hinted(&coarse_set, &hypotheses, Vec::new(), prior.hinted, progress)?;
        cores = Cores::of(&coarse_set, &hypotheses, &agglomeration);
    }
    if !cores.hold_all() {
        let is_changed =
            try_other_sensor_sides(views, prior, &pairs, &mut coarse_views, &mut hypotheses, edge, progress)?;
        noise = noise_level(&hypotheses, edge);
        let coarse_set =
            CoarseSet { views, coarse_views: &coarse_views, resolution: resolution(spacing, noise, edge), edge, noise };
        if is_changed {
            agglomeration = agglomerate_hinted(&coarse_set, &hypotheses, Vec::new(), prior.hinted, progress)?;
            cores = Cores::of(&coarse_set, &hypotheses, &agglomeration);
        }
        agglomeration = exhaustive::search_exhaustively(
            &coarse_set,
            &mut hypotheses,
            &pairs,
            (&agglomeration, cores),
            prior.hinted,
            progress,
        )?;
    }
    let coarse_set =
        CoarseSet { views, coarse_views: &coarse_views, resolution: resolution(spacing, noise, edge), edge, noise };
    let about_axis = prior.turning.and_then(|turning| {
        let pictures = |component: &Component| about_axis::borne_out(turning, component);
        about_axis::laid(turning, &hypotheses, edge, &agglomeration)
            .filter(|component| about_axis::is_seconded(&coarse_set, pictures, component, &agglomeration))
    });
    let is_about_axis = about_axis.is_some();
    if let Some(component) = about_axis {
        agglomeration = Agglomeration { components: vec![component], ambiguous: vec![false; views.len()] };
    }
    let Agglomeration { components, ambiguous } = agglomeration;
    let search = Search { views: (0..views.len()).collect(), coarse_views, hypotheses, edge, noise, is_about_axis };
    Ok(Found { components, ambiguous, searches: vec![search] })
}

/// The best ways to lay two views on each other.
fn pair_hypotheses(coarse_views: &[CoarseView], i: usize, j: usize, prior: &Prior, edge: f64) -> Vec<PairHypothesis> {
    let proposed = hinted::proposed(coarse_views, (i, j), prior, edge, TUNING.proposals);
    hypotheses_of(coarse_views, (i, j), proposed, &[], edge)
}

/// The best of the proposed motions of a pair, refined on the surface; those that are `known` already are left out.
fn hypotheses_of(
    coarse_views: &[CoarseView],
    pair: (usize, usize),
    proposed: impl IntoIterator<Item = Motion>,
    known: &[PairHypothesis],
    edge: f64,
) -> Vec<PairHypothesis> {
    best_of_pair(coarse_views, pair, &refined_motions(coarse_views, pair, proposed, known, edge), edge)
}

/// The proposed motions of a pair refined on the surface, no two of them alike, and none like one that is `known`.
fn refined_motions(
    coarse_views: &[CoarseView],
    (i, j): (usize, usize),
    proposed: impl IntoIterator<Item = Motion>,
    known: &[PairHypothesis],
    edge: f64,
) -> Vec<Motion> {
    let (a, b) = (&coarse_views[i], &coarse_views[j]);
    let is_same = |other: &Motion, motion: &Motion| consensus::alike(other, motion, b.radius, 2.0 * edge);
    let mut refined: Vec<Motion> = Vec::new();
    for motion in proposed {
        let motion = surfel_icp::align(a, b, &motion, edge);
        let is_known = known.iter().any(|hypothesis| is_same(&hypothesis.i_from_j, &motion));
        if !is_known && !refined.iter().any(|other| is_same(other, &motion)) {
            refined.push(motion);
        }
    }
    refined
}

/// The best hypotheses of all pairs, of the motions by which each may lie.
fn best_hypotheses(
    coarse_views: &[CoarseView],
    pairs: &[(usize, usize)],
    refined: &[Vec<Motion>],
    edge: f64,
) -> Vec<PairHypothesis> {
    let of_pair = |(pair, motions): (&(usize, usize), &Vec<Motion>)| best_of_pair(coarse_views, *pair, motions, edge);
    let found: Vec<Vec<PairHypothesis>> = pairs.par_iter().zip(refined).map(of_pair).collect();
    found.into_iter().flatten().collect()
}

/// Those of some motions of a pair that the surfaces bear out best.
fn best_of_pair(
    coarse_views: &[CoarseView],
    (i, j): (usize, usize),
    motions: &[Motion],
    edge: f64,
) -> Vec<PairHypothesis> {
    let hypothesis = |i_from_j: &Motion| {
        let evidence = verification::verify(&coarse_views[i], &coarse_views[j], i_from_j, edge, TUNING.samples);
        PairHypothesis { i, j, i_from_j: *i_from_j, evidence }
    };
    let mut hypotheses: Vec<PairHypothesis> = motions.iter().map(hypothesis).collect();
    hypotheses.sort_by(|a, b| b.score().total_cmp(&a.score()));
    hypotheses.truncate(TUNING.hypotheses);
    hypotheses
}
