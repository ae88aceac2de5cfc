//! Poses for all views of a set, whatever is known of them: given poses are starting points and witnesses, the rest is
//! found.

use super::alternatives::{Alternatives, Piece, alternatives};
use super::confidence::{SURE, confidence};
use super::group::Group;
use super::hinted::Prior;
use super::scan_set::Set;
use super::standing::Standing;
use super::{Search, find};
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress};
use crate::registration::multiview::{Multiview, PairOutcome};
use crate::registration::overlap::OverlapMatrix;
use crate::registration::quality::{self, Verdict};
use crate::registration::resolution::resolution;
use crate::registration::view::View;
use crate::registration::witness::Witness;

/// Where a view's pose came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// It was given, and refined from there.
    Given,
    /// It was given, but lay too far off to be refined.
    Corrected,
    /// None was given.
    Found,
}

/// A group of views with poses in a world of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedGroup {
    /// Its views, in order.
    pub views: Vec<usize>,
    /// For each of `views` its pose: scan to the frame of the group's first scan.
    pub scan_poses: Vec<Motion>,
    /// How good they are, judged by its own views alone.
    pub verdict: Verdict,
}

/// What became of a set.
#[derive(Debug, Clone)]
pub struct Placement {
    /// All views; those that are not in the first group are unplaced.
    pub result: Multiview,
    /// For each view where its pose came from; `None` = unplaced.
    pub origins: Vec<Option<Origin>>,
    /// For each view the probability that its pose is right relative to the others; 0 for unplaced ones.
    pub confidences: Vec<f64>,
    /// For each placed view how it stands among the others.
    pub standings: Vec<Option<Standing>>,
    /// For each view whether it could be laid on others in several ways that are equally good.
    pub ambiguous: Vec<bool>,
    /// Groups of two views or more that hang together; the first is the one that is placed.
    pub groups: Vec<PlacedGroup>,
    /// The places of views that fit the rest in several ways.
    pub alternatives: Vec<Alternatives>,
}

/// Refines poses; see [`crate::registration::method::Method::register`].
pub type Refine<'a> = dyn Fn(&[View], &[Motion]) -> Result<Multiview, Canceled> + 'a;

/// A given pose that is off by less than this share of the view's size is one that refinement can start from.
const NEAR: f64 = 0.3;

/// Places all views of a set, whatever poses it has.
pub fn place(set: &Set, refine: &Refine, progress: &Progress) -> Result<Placement, Canceled> {
    let views = set.views;
    let prior = Prior { given: set.given, hinted: set.hinted };
    let found = find(views, &prior, set.sensors, progress)?;
    let mut groups = Vec::new();
    let mut placed: Option<Multiview> = None;
    let mut standings = vec![None; views.len()];
    for group in found.groups.iter().filter(|group| group.views.len() > 1) {
        let search = &found.searches[group.search];
        let (group, refined, found) = settle_group(views, group, search, refine)?;
        groups.extend(held_together(set, &group, &refined, &found));
        if placed.is_none() {
            group.views.iter().zip(found).for_each(|(view, standing)| standings[*view] = Some(standing));
            placed = Some(spread(&group, &refined, views.len()));
        }
    }
    let mut result = placed.unwrap_or_else(|| Multiview::alone(views.len()));
    let origins = settle_world(views, set.given, &mut result);
    let sure = |view: usize| {
        standings[view].filter(|_| result.placed[view]).map(|standing| confidence(&standing, &Witness::default()))
    };
    let confidences: Vec<f64> = (0..views.len()).map(|view| sure(view).unwrap_or(0.0)).collect();
    let pieces = open_pieces(&found.ambiguous, &result, &groups, &standings, &confidences);
    let alternatives = match found.searches.first() {
        Some(search) => alternatives(views, search, &result, pieces, progress)?,
        None => Vec::new(),
    };
    Ok(Placement { result, origins, confidences, standings, ambiguous: found.ambiguous, groups, alternatives })
}

/// Of a set of which the other places of a view do as well as its own, as a mean, views may lie elsewhere.
const SYMMETRIC: f64 = 0.5;

/// Pieces whose other places are told: where more are open, the set is in doubt, and not they.
const MOST_PIECES: usize = 24;

/// What may lie in several ways: ambiguous views and groups without a place, and placed views that are not sure in a set
/// that looks the same from several sides.
fn open_pieces(
    ambiguous: &[bool],
    result: &Multiview,
    groups: &[PlacedGroup],
    standings: &[Option<Standing>],
    confidences: &[f64],
) -> Vec<Piece> {
    let open = |group: &&PlacedGroup| group.views.iter().any(|view| ambiguous[*view] && !result.placed[*view]);
    let mut pieces: Vec<Piece> = groups.iter().skip(1).filter(open).map(Piece::of_group).collect();
    let is_single = |view: &usize| !groups.iter().skip(1).any(|group| group.views.contains(view));
    let may_lie_elsewhere = |view: &usize| match standings[*view].filter(|_| result.placed[*view]) {
        Some(standing) => confidences[*view] < SURE && standing.group_rival >= SYMMETRIC,
        None => ambiguous[*view] && !result.placed[*view],
    };
    pieces.extend((0..ambiguous.len()).filter(is_single).filter(may_lie_elsewhere).map(Piece::of_view));
    pieces.truncate(MOST_PIECES);
    pieces
}

/// A refined view that is surer to be wrong than this has no place there either.
const REFUTED: f64 = 0.1;

/// Refines a group. A few views that then cross the others, or that the others' scanners refute, were laid there by
/// mistake: they are left out, and the rest is refined anew. When most are, nothing can be said of any, and the verdict
/// is left to tell.
fn settle_group(
    views: &[View],
    group: &Group,
    search: &Search,
    refine: &Refine,
) -> Result<(Group, Multiview, Vec<Standing>), Canceled> {
    let members = search.seen(views, &group.views);
    let refined = refine(&members, &group.local_poses)?;
    let standings = standings_of(&members, &group.views, &refined, search);
    let kept: Vec<usize> =
        (0..members.len()).filter(|k| confidence(&standings[*k], &Witness::default()) >= REFUTED).collect();
    if kept.len() == members.len() || kept.len() < 2 || 2 * kept.len() <= members.len() {
        return Ok((group.clone(), refined, standings));
    }
    let rest = Group {
        views: kept.iter().map(|k| group.views[*k]).collect(),
        local_poses: kept.iter().map(|k| refined.local_poses[*k]).collect(),
        ..group.clone()
    };
    let members = search.seen(views, &rest.views);
    let refined = refine(&members, &rest.local_poses)?;
    let standings = standings_of(&members, &rest.views, &refined, search);
    Ok((rest, refined, standings))
}

/// How the views of a refined group stand; `members` are its views.
fn standings_of(members: &[View], views: &[usize], refined: &Multiview, search: &Search) -> Vec<Standing> {
    let sharpness = quality::sharpness(members, refined, resolution(members, refined));
    let mut standings = search.standings(views, &refined.local_poses);
    for (standing, sharpness) in standings.iter_mut().zip(sharpness) {
        standing.sharpness = sharpness.unwrap_or(0.0);
    }
    standings
}

/// The views of a refined group that still hang together, in the frame of the first.
fn held_together(set: &Set, group: &Group, refined: &Multiview, found: &[Standing]) -> Option<PlacedGroup> {
    let kept: Vec<usize> = (0..group.views.len()).filter(|k| refined.placed[*k]).collect();
    let scan_pose = |k: usize| set.views[group.views[k]].scan_pose(&refined.local_poses[k]);
    let world = scan_pose(*kept.first()?).inverse();
    if kept.len() < 2 {
        return None;
    }
    let members: Vec<View> = group.views.iter().map(|view| set.views[*view].clone()).collect();
    let names: Vec<String> = group.views.iter().map(|view| set.names[*view].clone()).collect();
    let mut verdict = quality::judge(&members, refined, &names);
    let sure = |standing: &Standing| confidence(standing, &Witness::default());
    verdict.doubt(&found.iter().map(sure).collect::<Vec<f64>>(), &refined.placed, &names);
    Some(PlacedGroup {
        views: kept.iter().map(|k| group.views[*k]).collect(),
        scan_poses: kept.iter().map(|k| world * scan_pose(*k)).collect(),
        verdict,
    })
}

/// A group's registration as one of all `n` views.
fn spread(group: &Group, refined: &Multiview, n: usize) -> Multiview {
    let mut result = Multiview { rounds: refined.rounds.clone(), ..Multiview::alone(n) };
    result.placed = vec![false; n];
    let mut rows = OverlapMatrix::identity(n).rows().to_vec();
    for (k, &view) in group.views.iter().enumerate() {
        result.local_poses[view] = refined.local_poses[k];
        result.placed[view] = refined.placed[k];
        for (l, &other) in group.views.iter().enumerate() {
            rows[view][other] = refined.overlaps.rows()[k][l];
        }
    }
    result.overlaps = OverlapMatrix::from_rows(rows);
    let renamed = |pair: &PairOutcome| PairOutcome { i: group.views[pair.i], j: group.views[pair.j], ..pair.clone() };
    result.pairs = refined.pairs.iter().map(renamed).collect();
    result
}

/// Moves the placed views into the world that most given poses agree on, else into the frame of the first; says where
/// each pose came from.
fn settle_world(views: &[View], given: &[Option<Motion>], result: &mut Multiview) -> Vec<Option<Origin>> {
    let placed: Vec<usize> = (0..views.len()).filter(|view| result.placed[*view]).collect();
    let near = |world: &Motion, view: usize| {
        given[view].is_some_and(|pose| {
            let difference = (world * result.local_poses[view]).inv_mul(&pose);
            let moved = difference.translation.vector.norm() + difference.rotation.angle() * views[view].radius;
            moved < NEAR * views[view].radius
        })
    };
    let mut best: Option<(usize, Motion)> = None;
    for &view in &placed {
        let Some(pose) = given[view] else { continue };
        let world = pose * result.local_poses[view].inverse();
        let agreeing = placed.iter().filter(|other| near(&world, **other)).count();
        if best.is_none_or(|(most, _)| agreeing > most) {
            best = Some((agreeing, world));
        }
    }
    let first = placed.first().map_or_else(Motion::identity, |view| views[*view].local_pose(&Motion::identity()));
    let world = match (best, placed.first()) {
        (Some((_, world)), _) => world,
        (None, Some(view)) => first * result.local_poses[*view].inverse(),
        (None, None) => Motion::identity(),
    };
    let origins = (0..views.len())
        .map(|view| {
            result.placed[view].then(|| match given[view] {
                None => Origin::Found,
                Some(_) if near(&world, view) => Origin::Given,
                Some(_) => Origin::Corrected,
            })
        })
        .collect();
    for &view in &placed {
        result.local_poses[view] = world * result.local_poses[view];
    }
    origins
}
