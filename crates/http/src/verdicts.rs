//! Verdicts on models as they go over the wire: figures, landmarks, the reason for a no.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::problem::Problem;
use super::queries::MethodView;
use super::schemas::{Corners, Landmarks};
use super::state::AppState;
use visage_domain::{ModelRecord, StandardRecord, StoredVerdict};
use visage_gallery::{Comparison, Evidence, Reason, SAME_PERSON_MM};
use visage_geometry::Point3;
use visage_service::app::standards;
use visage_shape::faces::{FaceStandard, MatchMethod, Signature, dense_fit, judge, judgement, standard};
use visage_shape::standards::Found;
use visage_shape::standards::limit::{self, Learned};

/// Named places: `{"nose_tip": [x, y, z], ...}`. Right and left are the subject's own.
pub type Places = BTreeMap<String, Vec<f64>>;

/// Why a model is no match.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Reason)]
pub struct ReasonView {
    /// `no_triangle`, `no_surface`, `surface_differs`, `triangle_differs`, `corners_differ`,
    /// `below_threshold` or `undescribable`.
    #[schema(example = "surface_differs")]
    pub code: String,
    /// The same in words, with the figure and its limit.
    pub text: String,
}

impl ReasonView {
    /// A reason, and what else speaks for another unit, if what it rests on is there.
    pub fn of(reason: Reason, evidence: Option<&Evidence>) -> Self {
        let doubt = evidence.and_then(|evidence| evidence.size_in_doubt.as_deref());
        let text = doubt.map_or_else(|| reason.to_string(), |doubt| format!("{reason}; {doubt}"));
        ReasonView { code: reason.code().to_owned(), text }
    }
}

/// How a model or a probe was judged against a standard.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Verdict)]
pub struct VerdictView {
    /// The class.
    #[schema(example = "face")]
    pub standard: String,
    /// How it was judged.
    pub method: MethodView,
    /// Whether the score reaches the threshold.
    pub is_match: bool,
    /// In [0, 1], high is good, calibrated.
    #[schema(minimum = 0, maximum = 1)]
    pub score: f64,
    /// From which score on it is a match.
    pub threshold: f64,
    /// What is left after the best triangle is moved, turned and scaled onto the standard one (least squares), in
    /// millimetres on the standard; null if there is no triangle.
    pub matching_error_mm: Option<f64>,
    /// The paper's total vertex distance of the same triangle; null if there is no triangle.
    pub sum_of_distances_mm: Option<f64>,
    /// How far its surface is from the standard's, in millimetres on the standard; null if they come nowhere near
    /// each other.
    pub dense_residual_mm: Option<f64>,
    /// The share of the standard's surface that could be seen on it.
    pub coverage: Option<f64>,
    /// The best triangle in the model's frame and unit (for faces: right eye, left eye, nose).
    #[schema(value_type = Option<Corners>)]
    pub triangle: Option<Vec<Vec<f64>>>,
    /// The landmarks in the model's frame and unit, by name; null if the standard's surface isn't there.
    #[schema(value_type = Option<Landmarks>)]
    pub landmarks: Option<Places>,
    /// Why it is no match; null if it is one.
    pub reason: Option<ReasonView>,
}

impl VerdictView {
    /// The verdict on a signature.
    pub fn of(standard: &FaceStandard, evidence: &Evidence) -> Self {
        let verdict = &evidence.verdict;
        let has_triangle = |figure: f64| verdict.triangle.map(|_| figure).filter(|figure| figure.is_finite());
        VerdictView {
            standard: standard.name.to_owned(),
            method: evidence.method.into(),
            is_match: evidence.is_match(),
            score: verdict.score,
            threshold: evidence.threshold,
            matching_error_mm: has_triangle(verdict.matching_error_mm),
            sum_of_distances_mm: has_triangle(verdict.sum_of_distances_mm),
            dense_residual_mm: verdict.fit.map(|fit| fit.residual_mm),
            coverage: verdict.fit.map(|fit| fit.observed),
            triangle: verdict.triangle.map(|corners| corners.map(|corner| corner.coords.as_slice().to_vec()).to_vec()),
            landmarks: places(&evidence.landmarks),
            reason: evidence.reason().map(|reason| ReasonView::of(reason, Some(evidence))),
        }
    }
}

impl VerdictView {
    /// By the built-in face.
    pub fn of_face(signature: &Signature) -> Self {
        let face = standard::face();
        VerdictView::of(&face, &Evidence::new(signature, &face, MatchMethod::default(), None))
    }

    /// As stored of a model, by a standard that a user has made; its own threshold applies if none is given.
    pub fn of_class(
        standard: &StandardRecord,
        learned: &Learned,
        verdict: &StoredVerdict,
        threshold: Option<f64>,
    ) -> Self {
        let looked_at = verdict.reason.as_deref().map_or(Ok(verdict.found.as_ref()), Err);
        VerdictView::of_found(standard, learned, looked_at, threshold)
    }

    /// By a standard that a user has made: where it was found, or why the model could not be looked at.
    pub fn of_found(
        standard: &StandardRecord,
        learned: &Learned,
        looked_at: Result<Option<&Found>, &str>,
        threshold: Option<f64>,
    ) -> Self {
        let threshold = threshold.unwrap_or(judgement::MATCH_SCORE);
        let residual_mm = |found: Option<&Found>| found.map_or(limit::NOTHING_FOUND_MM, |found| found.residual_mm);
        let score = looked_at.map_or(0.0, |found| learned.score(residual_mm(found)));
        let found = looked_at.ok().flatten();
        let is_there = score >= judgement::MATCH_SCORE.min(threshold);
        let in_model = |corner: &Point3, found: &Found| found.pose.point(corner).coords.as_slice().to_vec();
        let triangle = standard.definition.triangles.first().zip(found).map(|(triangle, found)| {
            triangle.annotated().corners.iter().map(|corner| in_model(corner, found)).collect()
        });
        let landmarks = found.filter(|_| is_there).map(|found| {
            let posed = standard.definition.posed_landmarks(&found.pose).into_iter();
            posed.map(|(name, place)| (name, place.coords.as_slice().to_vec())).collect()
        });
        VerdictView {
            standard: standard.name.clone(),
            method: MethodView::default(),
            is_match: score >= threshold,
            score,
            threshold,
            matching_error_mm: found.map(|found| found.matching_error_mm),
            // the paper's distance is that of its literal method, which is for faces
            sum_of_distances_mm: None,
            dense_residual_mm: found.map(|found| found.residual_mm),
            coverage: found.map(|found| found.observed),
            triangle,
            landmarks,
            reason: (score < threshold).then(|| ReasonView::of_class(learned, looked_at, score, threshold)),
        }
    }
}

impl ReasonView {
    fn of_class(learned: &Learned, looked_at: Result<Option<&Found>, &str>, score: f64, threshold: f64) -> Self {
        let residual_mm = match looked_at {
            Err(text) => return ReasonView { code: "undescribable".to_owned(), text: text.to_owned() },
            Ok(None) => return ReasonView::of(Reason::NoSurface, None),
            Ok(Some(_)) if score >= judgement::MATCH_SCORE => {
                return ReasonView::of(Reason::BelowThreshold { score, threshold }, None);
            }
            Ok(Some(found)) => found.residual_mm,
        };
        let most = learned.limit_mm;
        let text = format!("its surface differs from the standard's by {residual_mm:.2} mm; {most:.2} mm is the most");
        ReasonView { code: Reason::SurfaceDiffers { residual_mm }.code().to_owned(), text }
    }
}

/// What a stored model is by the face and by each standard that it is judged against already.
pub async fn on_model(state: &AppState, model: &ModelRecord) -> Result<Vec<VerdictView>, Problem> {
    let content = state.context.database.signature(model.id).await?;
    let signature = content.and_then(|content| Signature::from_bytes(&content).ok());
    let mut views: Vec<VerdictView> = signature.iter().map(VerdictView::of_face).collect();
    let judged = standards::verdicts_on(&state.context, model.id).await?;
    let by_class = |(standard, learned, verdict): &_| VerdictView::of_class(standard, learned, verdict, None);
    views.extend(judged.iter().map(by_class));
    Ok(views)
}

/// Landmarks by name; `None` if there are none.
pub fn places(landmarks: &[(&'static str, Point3)]) -> Option<Places> {
    let place = |(name, point): &(&'static str, Point3)| ((*name).to_owned(), point.coords.as_slice().to_vec());
    (!landmarks.is_empty()).then(|| landmarks.iter().map(place).collect())
}

/// The scores by each method.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct MethodScores {
    /// By the dense check.
    pub verified: f64,
    /// By triangles with descriptors.
    pub descriptors: f64,
    /// By the paper's triangle.
    pub literal: f64,
}

/// How two models compare.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Likeness)]
pub struct LikenessView {
    /// How far the triangles of the probe's salient regions occur on the model, in [0, 1].
    pub region_triangles: f64,
    /// How alike their shapes are as wholes, in [0, 1].
    pub shape: f64,
    /// How surely both are faces, in [0, 1].
    pub both_faces: f64,
    /// How far their faces are apart, in millimetres on the standard; null unless both have one.
    pub signature_distance_mm: Option<f64>,
}

impl From<Comparison> for LikenessView {
    fn from(comparison: Comparison) -> Self {
        LikenessView {
            region_triangles: comparison.region_triangles,
            shape: comparison.shape,
            both_faces: comparison.both_faces,
            signature_distance_mm: comparison.dense_distance_mm,
        }
    }
}

/// The limits that the steps decide by.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Thresholds {
    /// On the score.
    pub score: f64,
    /// `verified`: the most residual of the dense check, in millimetres on the standard.
    pub dense_residual_mm: f64,
    /// `verified`: with less of the standard seen there is no verdict.
    pub coverage: f64,
    /// `descriptors`: the most that a triangle may cost.
    pub triangle_cost: f64,
    /// `literal`: `Thres_FT`, the most total vertex distance, in millimetres on the standard.
    pub sum_of_distances_mm: f64,
    /// By probe: where one person's and two people's faces are equally likely, in millimetres on the standard.
    pub signature_distance_mm: f64,
}

/// Each step's figure.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Explanation)]
pub struct ExplanationView {
    /// Salient regions of the model.
    pub regions: usize,
    /// Facial triangles that its detector kept.
    pub candidates: usize,
    /// What the cheapest of them costs; null if there is none.
    pub triangle_cost: Option<f64>,
    /// How many of the model's units a millimetre on the standard is; null without a fit.
    pub scale: Option<f64>,
    /// The scores against the standard face by each method.
    pub scores: MethodScores,
    /// By probe: how the two compare.
    pub likeness: Option<LikenessView>,
    /// The limits that the steps decide by.
    pub thresholds: Thresholds,
}

impl ExplanationView {
    /// The figures of a signature; `threshold` is the question's.
    pub fn of(signature: &Signature, standard: &FaceStandard, threshold: f64, comparison: Option<Comparison>) -> Self {
        let verdict = |method| judge(signature, standard, method);
        let (verified, descriptors) = (verdict(MatchMethod::Verified), verdict(MatchMethod::Descriptors));
        ExplanationView {
            regions: signature.regions().count(),
            candidates: signature.candidates().count(),
            triangle_cost: descriptors.cost.map(|cost| cost.total()),
            scale: verified.fit.map(|fit| fit.pose.scale),
            scores: MethodScores {
                verified: verified.score,
                descriptors: descriptors.score,
                literal: verdict(MatchMethod::Literal).score,
            },
            likeness: comparison.map(LikenessView::from),
            thresholds: Thresholds {
                score: threshold,
                dense_residual_mm: judgement::RESIDUAL_AT_HALF_MM,
                coverage: dense_fit::LEAST_OBSERVED,
                triangle_cost: judgement::COST_AT_HALF,
                sum_of_distances_mm: judgement::THRES_FT_MM,
                signature_distance_mm: SAME_PERSON_MM,
            },
        }
    }
}
