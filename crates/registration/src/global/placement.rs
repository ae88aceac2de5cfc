//! Poses for all views of a set, whatever is known of them: given poses are starting points and witnesses, the rest is
//! found.

use super::alternatives::{Alternatives, Piece, alternatives};
use super::component::Component;
use super::confidence::{SURE, confidence};
use super::hinted::Prior;
use super::pose_support::PoseSupport;
use super::scan_set::Set;
use super::{Search, find};
use crate::joint::joint_at;
use crate::outcome::{Outcome, PairOutcome};
use crate::overlap::OverlapMatrix;
use crate::quality::sharpness::sharpness;
use crate::quality::witness::Witness;
use crate::quality::{Evidence, Surfaces, Verdict, judge};
use crate::resolution::resolution;
use crate::view::View;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress};

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

/// A component of views with poses in a world of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedComponent {
    /// Its views, in order.
    pub views: Vec<usize>,
    /// For each of `views` its pose: scan to the frame of the component's first scan.
    pub scan_poses: Vec<Motion>,
    /// How good they are, judged by its own views alone.
    pub verdict: Verdict,
}

/// What became of a set.
#[derive(Debug, Clone)]
pub struct Placement {
    /// All views; those that are not in the first component are unplaced.
    pub result: Outcome,
    /// For each view where its pose came from; `None` = unplaced.
    pub origins: Vec<Option<Origin>>,
    /// For each view the probability that its pose is right relative to the others; 0 for unplaced ones.
    pub confidences: Vec<f64>,
    /// For each placed view how it is supported among the others.
    pub pose_supports: Vec<Option<PoseSupport>>,
    /// For each view whether it could be laid on others in several ways that are equally good.
    pub ambiguous: Vec<bool>,
    /// Components of two views or more that hang together; the first is the one that is placed.
    pub components: Vec<PlacedComponent>,
    /// The places of views that fit the rest in several ways.
    pub alternatives: Vec<Alternatives>,
}

/// Refines poses; see [`crate::method::Method::register`].
pub type Refine<'a> = dyn Fn(&[View], &[Motion]) -> Result<Outcome, Canceled> + 'a;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A given pose that is off by less than this share of the view's size is one that refinement can start from.
        near: f64 = 0.3,
        /// Of a set of which the other places of a view do as well as its own, as a mean, views may lie elsewhere.
        symmetric: f64 = 0.5,
        /// Pieces whose other places are told: where more are open, the set is in doubt, and not they.
        most_pieces: usize = 24,
        /// A refined view that is surer to be wrong than this has no place there either.
        refuted: f64 = 0.1,
    }
}

/// Places all views of a set, whatever poses it has.
pub fn place(set: &Set, refine: &Refine, progress: &Progress) -> Result<Placement, Canceled> {
    let views = set.views;
    let prior = Prior { given: set.given, hinted: set.hinted, turning: set.turning };
    let found = find(views, &prior, set.sensors, progress)?;
    let mut components = Vec::new();
    let mut placed: Option<Outcome> = None;
    let mut pose_supports = vec![None; views.len()];
    // in a component when it was found, and without a place in the end
    let mut left_out = vec![false; views.len()];
    for component in found.components.iter().filter(|component| component.views.len() > 1) {
        let search = &found.searches[component.search];
        component.views.iter().for_each(|view| left_out[*view] = true);
        let (component, refined, found) = settle_component(views, component, search, refine, progress)?;
        component.views.iter().for_each(|view| left_out[*view] = false);
        components.extend(held_together(set, &component, &refined, &found));
        if placed.is_none() {
            component.views.iter().zip(found).for_each(|(view, support)| pose_supports[*view] = Some(support));
            placed = Some(spread(&component, &refined, views.len()));
        }
    }
    let mut result = placed.unwrap_or_else(|| Outcome::alone(views.len()));
    let origins = settle_world(views, set.given, &mut result);
    let sure = |view: usize| {
        pose_supports[view].filter(|_| result.placed[view]).map(|support| confidence(&support, &Witness::default()))
    };
    let confidences: Vec<f64> = (0..views.len()).map(|view| sure(view).unwrap_or(0.0)).collect();
    let is_open: Vec<bool> =
        found.ambiguous.iter().zip(&left_out).map(|(ambiguous, left)| *ambiguous || *left).collect();
    let pieces = open_pieces(&is_open, &result, &components, &pose_supports, &confidences);
    let alternatives = match found.searches.first() {
        Some(search) => alternatives(views, search, &result, pieces, progress)?,
        None => Vec::new(),
    };
    Ok(Placement { result, origins, confidences, pose_supports, ambiguous: found.ambiguous, components, alternatives })
}

/// What may lie in several ways: views that are ambiguous or were left out, and components of such, without a place, and placed views
/// that are not sure in a set that looks the same from several sides.
fn open_pieces(
    is_open: &[bool],
    result: &Outcome,
    components: &[PlacedComponent],
    pose_supports: &[Option<PoseSupport>],
    confidences: &[f64],
) -> Vec<Piece> {
    let open =
        |component: &&PlacedComponent| component.views.iter().any(|view| is_open[*view] && !result.placed[*view]);
    let mut pieces: Vec<Piece> = components.iter().skip(1).filter(open).map(Piece::of_component).collect();
    let is_single = |view: &usize| !components.iter().skip(1).any(|component| component.views.contains(view));
    let may_lie_elsewhere = |view: &usize| match pose_supports[*view].filter(|_| result.placed[*view]) {
        Some(support) => confidences[*view] < SURE && support.component_rival >= TUNING.symmetric,
        None => is_open[*view] && !result.placed[*view],
    };
    pieces.extend((0..is_open.len()).filter(is_single).filter(may_lie_elsewhere).map(Piece::of_view));
    pieces.truncate(TUNING.most_pieces);
    pieces
}

/// Refines a component. A few views that then cross the others, or that the others' scanners refute, and parts that the rest
/// speaks against, were laid there by mistake: they are left out, and the rest is refined anew. When most are, nothing can be
/// said of any, and the verdict is left to tell.
fn settle_component(
    views: &[View],
    component: &Component,
    search: &Search,
    refine: &Refine,
    progress: &Progress,
) -> Result<(Component, Outcome, Vec<PoseSupport>), Canceled> {
    // what turned about one axis would be free to slide where only that holds it
    let refine = |members: &[View], poses: &[Motion]| match search.is_about_axis {
        true => joint_at(members, poses, progress),
        false => refine(members, poses),
    };
    let members = search.seen(views, &component.views);
    let refined = refine(&members, &component.local_poses)?;
    let (pose_supports, mut kept) = pose_supports_of(&members, &component.views, &refined, search);
    kept.retain(|k| confidence(&pose_supports[*k], &Witness::default()) >= TUNING.refuted);
    if kept.len() == members.len() || kept.len() < 2 || 2 * kept.len() < members.len() {
        return Ok((component.clone(), refined, pose_supports));
    }
    let rest = Component {
        views: kept.iter().map(|k| component.views[*k]).collect(),
        local_poses: kept.iter().map(|k| refined.local_poses[*k]).collect(),
        ..component.clone()
    };
    let members = search.seen(views, &rest.views);
    let refined = refine(&members, &rest.local_poses)?;
    let (pose_supports, _) = pose_supports_of(&members, &rest.views, &refined, search);
    Ok((rest, refined, pose_supports))
}

/// How the views of a refined component stand, and the places of those that hold together; `members` are its views.
fn pose_supports_of(
    members: &[View],
    views: &[usize],
    refined: &Outcome,
    search: &Search,
) -> (Vec<PoseSupport>, Vec<usize>) {
    let sharpness = sharpness(members, refined, resolution(members, refined));
    let (mut pose_supports, holding) = search.pose_supports(views, &refined.local_poses);
    for (support, sharpness) in pose_supports.iter_mut().zip(sharpness) {
        support.sharpness = sharpness.unwrap_or(0.0);
    }
    (pose_supports, holding)
}

/// The views of a refined component that still hang together, in the frame of the first.
fn held_together(
    set: &Set,
    component: &Component,
    refined: &Outcome,
    found: &[PoseSupport],
) -> Option<PlacedComponent> {
    let kept: Vec<usize> = (0..component.views.len()).filter(|k| refined.placed[*k]).collect();
    let scan_pose = |k: usize| set.views[component.views[k]].scan_pose(&refined.local_poses[k]);
    let world = scan_pose(*kept.first()?).inverse();
    if kept.len() < 2 {
        return None;
    }
    let members: Vec<View> = component.views.iter().map(|view| set.views[*view].clone()).collect();
    let names: Vec<String> = component.views.iter().map(|view| set.names[*view].clone()).collect();
    let sure = |support: &PoseSupport| confidence(support, &Witness::default());
    let confidences: Vec<f64> = found.iter().map(sure).collect();
    let surfaces = Surfaces::measure(&members, refined);
    let by_surfaces = Evidence::of_surfaces(&names, refined, &surfaces);
    let verdict = judge(&Evidence { confidences: Some(&confidences), ..by_surfaces });
    Some(PlacedComponent {
        views: kept.iter().map(|k| component.views[*k]).collect(),
        scan_poses: kept.iter().map(|k| world * scan_pose(*k)).collect(),
        verdict,
    })
}

/// A component's registration as one of all `n` views.
fn spread(component: &Component, refined: &Outcome, n: usize) -> Outcome {
    let mut result = Outcome { rounds: refined.rounds.clone(), ..Outcome::alone(n) };
    result.placed = vec![false; n];
    let mut rows = OverlapMatrix::identity(n).rows().to_vec();
    for (k, &view) in component.views.iter().enumerate() {
        result.local_poses[view] = refined.local_poses[k];
        result.initial[view] = refined.initial[k];
        result.placed[view] = refined.placed[k];
        for (l, &other) in component.views.iter().enumerate() {
            rows[view][other] = refined.overlaps.rows()[k][l];
        }
    }
    result.overlaps = OverlapMatrix::from_rows(rows);
    let renamed =
        |pair: &PairOutcome| PairOutcome { i: component.views[pair.i], j: component.views[pair.j], ..pair.clone() };
    result.pairs = refined.pairs.iter().map(renamed).collect();
    result
}

/// Moves the placed views into the world that most given poses agree on, else into the frame of the first; says where
/// each pose came from.
fn settle_world(views: &[View], given: &[Option<Motion>], result: &mut Outcome) -> Vec<Option<Origin>> {
    let placed: Vec<usize> = (0..views.len()).filter(|view| result.placed[*view]).collect();
    let near = |world: &Motion, view: usize| {
        given[view].is_some_and(|pose| {
            let difference = (world * result.local_poses[view]).inv_mul(&pose);
            let moved = difference.translation.vector.norm() + difference.rotation.angle() * views[view].radius;
            moved < TUNING.near * views[view].radius
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
        result.initial[view] = world * result.initial[view];
    }
    origins
}
