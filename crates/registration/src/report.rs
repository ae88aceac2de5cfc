//! What a registration says of itself: its share of `result` in a model's report. What placement says is in
//! [`crate::global::report`], of the mesh in `visage_surface`, the whole `result` in `visage_pipeline::report`, and `run` (seconds,
//! memory, host) where jobs write their files, in `visage_service`.
//!
//! Lengths carry the scans' unit; those that end in `_spacings` are divided by the common spacing.

use serde::Serialize;

use crate::covariance::PoseCovariance;
use crate::covariance::weak_axes::{WeakAxis, weak_axes};
use crate::global::alternatives::AlternativesReport;
use crate::global::placement::Origin;
use crate::global::report::{ComponentReport, PlacementReport, ViewEvidence};
use crate::method::{Levels, Method};
use crate::outcome::{Outcome, PairOutcome, Round};
use crate::pairwise::trimmed_icp::IcpEnd;
use crate::quality::Verdict;
use crate::view::{View, common_spacing};
use visage_geometry::se3;

/// The registration's part of a report. Who knows more of the views puts rows of its own in the place of these.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegistrationReport<Row = ViewReport> {
    /// The method that was run.
    pub method: &'static str,
    /// The unit of all lengths that don't say otherwise.
    pub unit: &'static str,
    /// The median spacing of the scans, to which tolerances are tied.
    pub spacing: f64,
    /// The verdict and its reasons.
    pub verdict: Verdict,
    /// The views in order.
    pub views: Vec<Row>,
    /// The pairs of the last round.
    pub pairs: Vec<PairReport>,
    /// `overlaps[i][j]`: the share of view i's points that have a counterpart in view j.
    pub overlaps: Vec<Vec<f64>>,
    /// What each level of the method ran with, coarse to fine.
    pub levels: Levels,
    /// All rounds of overlap, ICP and averaging.
    pub rounds: Vec<Round>,
    /// How sure the whole is: as sure as its least sure placed view; null if poses were given and nothing else was
    /// tried.
    pub confidence: Option<f64>,
    /// Where views may lie that fit in several ways.
    pub alternatives: Vec<AlternativesReport>,
    /// The components of views that hang together; the first is the placed one.
    pub groups: Vec<ComponentReport>,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewReport {
    /// The scan's name.
    pub name: String,
    /// Points in it.
    pub points: usize,
    /// Its spacing L_r.
    pub spacing: f64,
    /// Its estimated range accuracy R_e.
    pub range_accuracy: f64,
    /// Whether it hangs together with the first view.
    pub placed: bool,
    /// Root mean square distance of the kept correspondences of all its pairs.
    pub residual: Option<f64>,
    /// The same in spacings.
    pub residual_spacings: Option<f64>,
    /// How well the pose is known; absent for view 0, to which it is relative, and for unplaced views.
    pub uncertainty: Option<UncertaintyReport>,
    /// Where its pose came from; null if it has none.
    pub pose: Option<Origin>,
    /// The probability that its pose is right; null if poses were given and nothing else was tried.
    pub confidence: Option<f64>,
    /// What that rests on.
    pub evidence: Option<ViewEvidence>,
    /// Why it has no place, if it has none.
    pub unplaced: Option<&'static str>,
    /// Its component, as an index into `groups`.
    pub group: Option<usize>,
    /// Moves its points from where they are in the model to where they were before refinement: 4x4, row by row, in the world. Null if it
    /// has no place, or scales were sought.
    pub start_from_final: Option<[[f64; 4]; 4]>,
}

/// How well a pose is known (`registration/covariance`).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UncertaintyReport {
    /// The view's centroid in the world, about which twists are taken.
    pub center: [f64; 3],
    /// 6x6, row by row, of the left twist in the axes of the world: translation (the scans' unit), then rotation
    /// vector (radians).
    pub covariance: [[f64; 6]; 6],
    /// Root mean square displacement of the view's surface by one standard deviation, in spacings.
    pub displacement_spacings: f64,
    /// The motions that hardly anything holds.
    pub weak_axes: Vec<WeakAxis>,
}

impl UncertaintyReport {
    fn new(pose: &PoseCovariance, spacing: f64) -> Self {
        UncertaintyReport {
            center: pose.center.coords.into(),
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| pose.covariance[(row, column)])),
            displacement_spacings: pose.displacement() / spacing,
            weak_axes: weak_axes(pose, spacing),
        }
    }
}

/// How a pair's registration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PairEnd {
    /// With that of all others.
    Joint,
    /// As its own ICP did.
    #[serde(untagged)]
    Icp(IcpEnd),
}

/// One registered pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairReport {
    /// The target view's index.
    pub i: usize,
    /// The moved view's index.
    pub j: usize,
    /// Share of i's points with a counterpart in j.
    pub overlap_i_j: f64,
    /// Share of j's points with a counterpart in i.
    pub overlap_j_i: f64,
    /// Correspondences kept.
    pub correspondences: usize,
    /// Root mean square distance of those.
    pub trimmed_rms: f64,
    /// ICP fits in the last round.
    pub iterations: usize,
    /// How ICP ended.
    pub end: PairEnd,
    /// The threshold that was to end its ICP, a squared length; null if none was.
    pub e_thr: Option<f64>,
    /// How far the pair disagrees with the averaged poses.
    pub disagreement: f64,
    /// Robust weight in averaging, in (0, 1].
    pub trust: f64,
}

/// A finished registration, as its report is made of it.
#[derive(Debug, Clone, Copy)]
pub struct Finished<'a> {
    /// The scans' names.
    pub names: &'a [String],
    /// The views.
    pub views: &'a [View],
    /// What came out.
    pub result: &'a Outcome,
    /// How the views came to their poses.
    pub placement: &'a PlacementReport,
    /// How well the poses are known.
    pub poses: &'a [Option<PoseCovariance>],
}

impl RegistrationReport {
    /// Gathers the report of a finished registration.
    pub fn new(method: Method, unit: &'static str, finished: &Finished<'_>, verdict: Verdict) -> Self {
        let Finished { names, views, result, placement, poses } = *finished;
        let spacing = common_spacing(views);
        let view_report = |view: usize| ViewReport {
            uncertainty: poses[view].as_ref().map(|pose| UncertaintyReport::new(pose, spacing)),
            pose: placement.origin(view),
            confidence: placement.confidences().map(|sure| sure[view]),
            evidence: placement.evidence(view),
            unplaced: placement.reason(view),
            group: placement.group(view),
            ..view_report(view, names, views, result, spacing)
        };
        RegistrationReport {
            method: method.name(),
            unit,
            spacing,
            verdict,
            views: (0..views.len()).map(view_report).collect(),
            pairs: pair_reports(result),
            overlaps: result.overlaps.rows().to_vec(),
            levels: method.levels(),
            rounds: result.rounds.clone(),
            confidence: placement.confidence(),
            alternatives: placement.alternatives(names),
            groups: placement.components(names),
        }
    }
}

impl<Row> RegistrationReport<Row> {
    /// The same with other rows for the views, made of these in order.
    pub fn with_rows<Other>(self, row: impl FnMut((usize, Row)) -> Other) -> RegistrationReport<Other> {
        RegistrationReport {
            method: self.method,
            unit: self.unit,
            spacing: self.spacing,
            verdict: self.verdict,
            views: self.views.into_iter().enumerate().map(row).collect(),
            pairs: self.pairs,
            overlaps: self.overlaps,
            levels: self.levels,
            rounds: self.rounds,
            confidence: self.confidence,
            alternatives: self.alternatives,
            groups: self.groups,
        }
    }
}

fn view_report(index: usize, names: &[String], views: &[View], result: &Outcome, spacing: f64) -> ViewReport {
    let (mut sum, mut count) = (0.0, 0.0);
    for pair in result.pairs.iter().filter(|pair| (pair.i == index || pair.j == index) && pair.correspondences > 0) {
        sum += pair.mean_distance2 * pair.correspondences as f64;
        count += pair.correspondences as f64;
    }
    let residual = (count > 0.0).then(|| (sum / count).sqrt());
    ViewReport {
        name: names[index].clone(),
        points: views[index].points().len(),
        spacing: views[index].spacing,
        range_accuracy: views[index].range_accuracy,
        placed: result.placed[index],
        residual,
        residual_spacings: residual.map(|r| r / spacing),
        uncertainty: None,
        pose: None,
        confidence: None,
        evidence: None,
        unplaced: None,
        group: None,
        // a scaled view has another local frame than the one that it began with
        start_from_final: (result.placed[index] && views[index].scale == 1.0)
            .then(|| se3::to_rows(&result.initial_from_final(index))),
    }
}

fn pair_reports(result: &Outcome) -> Vec<PairReport> {
    let report = |pair: &PairOutcome| PairReport {
        i: pair.i,
        j: pair.j,
        overlap_i_j: result.overlaps.directed(pair.i, pair.j),
        overlap_j_i: result.overlaps.directed(pair.j, pair.i),
        correspondences: pair.correspondences,
        trimmed_rms: pair.mean_distance2.sqrt(),
        iterations: pair.icp.map_or(0, |icp| icp.iterations),
        end: pair.icp.map_or(PairEnd::Joint, |icp| PairEnd::Icp(icp.end)),
        e_thr: pair.icp.and_then(|icp| icp.threshold),
        disagreement: pair.disagreement,
        trust: pair.trust,
    };
    result.pairs.iter().map(report).collect()
}
