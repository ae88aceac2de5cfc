//! What a report says of how the views came to their poses.

use serde::{Deserialize, Serialize};

use super::alternatives::{Alternatives, AlternativesReport};
use super::confidence::confidence;
use super::placement::{Origin, PlacedComponent, Placement};
use super::pose_support::PoseSupport;
use crate::outcome::Outcome;
use crate::quality::Quality;
use crate::quality::witness::Witness;
use crate::view::View;
use visage_geometry::{Motion, se3};

/// How the views came to their poses.
#[derive(Debug, Clone)]
pub struct PlacementReport {
    origins: Vec<Option<Origin>>,
    /// For each placed view how it is supported among the others; `None` if poses were given and nothing else was tried.
    pose_supports: Option<Vec<Option<PoseSupport>>>,
    /// What was learned of each view once all poses were final.
    witnesses: Vec<Witness>,
    /// For each view the probability that its pose is right; `None` as before.
    confidences: Option<Vec<f64>>,
    /// For each view why it has no pose.
    reasons: Vec<Option<&'static str>>,
    components: Vec<PlacedComponent>,
    alternatives: Vec<Alternatives>,
}

/// A component of views that hang together; the first is the one that is placed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComponentReport {
    /// Its scans.
    pub views: Vec<String>,
    /// For each its 4x4 row-major pose: scan to the frame of the component's first scan.
    pub poses: Vec<[[f64; 4]; 4]>,
    /// The verdict on these poses by themselves,
    pub quality: Quality,
    /// and why it is not better.
    pub reasons: Vec<String>,
}

/// What the confidence of a view rests on, as a report holds it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ViewEvidence {
    /// How it stands among the others.
    #[serde(flatten)]
    pub support: PoseSupport,
    /// What was learned once all poses were final.
    #[serde(flatten)]
    pub witness: Witness,
}

impl PlacementReport {
    /// All poses were given, and refined from there.
    pub fn of_given(result: &Outcome) -> Self {
        PlacementReport {
            origins: result.placed.iter().map(|placed| placed.then_some(Origin::Given)).collect(),
            pose_supports: None,
            witnesses: Vec::new(),
            confidences: None,
            reasons: result.placed.iter().map(|placed| (!placed).then_some(APART)).collect(),
            components: Vec::new(),
            alternatives: Vec::new(),
        }
    }

    /// The views were placed by their surface.
    pub fn of(placement: &Placement) -> Self {
        let in_another_group =
            |view: usize| placement.components.iter().any(|component| component.views.contains(&view));
        let reason = |view: usize| match (placement.result.placed[view], placement.ambiguous[view]) {
            (true, _) => None,
            (false, true) => Some(AMBIGUOUS),
            (false, false) if in_another_group(view) => Some(OTHER_GROUP),
            (false, false) => Some(APART),
        };
        PlacementReport {
            origins: placement.origins.clone(),
            pose_supports: Some(placement.pose_supports.clone()),
            witnesses: Vec::new(),
            confidences: Some(placement.confidences.clone()),
            reasons: (0..placement.origins.len()).map(reason).collect(),
            components: placement.components.clone(),
            alternatives: placement.alternatives.clone(),
        }
    }

    /// The motion between the local frames of two views, from j's to i's, if both are placed or in one component.
    pub fn relative(&self, result: &Outcome, views: &[View], i: usize, j: usize) -> Option<Motion> {
        if result.placed[i] && result.placed[j] {
            return Some(result.local_poses[i].inv_mul(&result.local_poses[j]));
        }
        let pose = |component: &PlacedComponent, view: usize| {
            let place = component.views.iter().position(|other| *other == view)?;
            Some(views[view].local_pose(&component.scan_poses[place]))
        };
        self.components.iter().find_map(|component| Some(pose(component, i)?.inv_mul(&pose(component, j)?)))
    }

    /// For each view the probability that its pose is right; `None` if poses were given and nothing else was tried.
    pub fn confidences(&self) -> Option<&[f64]> {
        self.confidences.as_deref()
    }

    /// The poses of the placed component are those of `result`.
    pub(crate) fn move_placed(&mut self, views: &[View], result: &Outcome) {
        let placed = |component: &&mut PlacedComponent| component.views.iter().all(|view| result.placed[*view]);
        for component in self.components.iter_mut().filter(placed) {
            let pose = |view: usize| views[view].scan_pose(&result.local_poses[view]);
            let first = pose(component.views[0]);
            component.scan_poses = component.views.iter().map(|view| first.inv_mul(&pose(*view))).collect();
        }
    }

    /// Says anew how sure the poses are, from what was learned once they were final.
    pub fn hear(&mut self, witnesses: Vec<Witness>, placed: &[bool]) {
        let Some(pose_supports) = &self.pose_supports else { return };
        let sure = |(view, support): (usize, &Option<PoseSupport>)| match support {
            Some(support) if placed[view] => confidence(support, &witnesses[view]),
            _ => 0.0,
        };
        self.confidences = Some(pose_supports.iter().enumerate().map(sure).collect());
        self.witnesses = witnesses;
    }

    /// What the confidence of a view rests on.
    pub(crate) fn evidence(&self, view: usize) -> Option<ViewEvidence> {
        let support = self.pose_supports.as_ref()?[view].filter(|_| self.origins[view].is_some())?;
        Some(ViewEvidence { support, witness: *self.witnesses.get(view)? })
    }

    /// How sure the whole is: as sure as its least sure placed view.
    pub(crate) fn confidence(&self) -> Option<f64> {
        let sure = self.confidences.as_ref()?;
        let placed = self.origins.iter().zip(sure).filter(|(origin, _)| origin.is_some());
        placed.map(|(_, sure)| *sure).min_by(f64::total_cmp)
    }

    /// Where a view's pose came from.
    pub(crate) fn origin(&self, view: usize) -> Option<Origin> {
        self.origins[view]
    }

    /// Why a view has no place, if it has none.
    pub(crate) fn reason(&self, view: usize) -> Option<&'static str> {
        self.reasons[view]
    }

    /// The component that a view is in.
    pub(crate) fn group(&self, view: usize) -> Option<usize> {
        self.components.iter().position(|component| component.views.contains(&view))
    }

    /// The components.
    pub(crate) fn components(&self, names: &[String]) -> Vec<ComponentReport> {
        self.components.iter().map(|component| component_report(component, names)).collect()
    }

    /// The places of views that fit in several ways.
    pub(crate) fn alternatives(&self, names: &[String]) -> Vec<AlternativesReport> {
        self.alternatives.iter().flat_map(|alternatives| alternatives.report(names)).collect()
    }
}

const APART: &str = "no other view's surface bears out a place for it: it shows something else, or overlaps too little";
const OTHER_GROUP: &str = "it hangs together with other scans than the placed ones, see `groups`: another object, or a part that overlaps the rest too little";
const AMBIGUOUS: &str =
    "it fits the others in several ways that are equally good: the object looks the same from several sides";

fn component_report(component: &PlacedComponent, names: &[String]) -> ComponentReport {
    ComponentReport {
        views: component.views.iter().map(|view| names[*view].clone()).collect(),
        poses: component.scan_poses.iter().map(se3::to_rows).collect(),
        quality: component.verdict.quality,
        reasons: component.verdict.reasons.clone(),
    }
}
