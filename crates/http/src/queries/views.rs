//! Questions and answers as they go over the wire.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::openapi::{OneOfBuilder, Ref, RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use super::super::scan_set_views::UnitView;
use super::super::schemas::{self, Corners, Landmarks, Point};
use super::super::verdicts::{ExplanationView, Places, ReasonView, VerdictView};
use super::placing::PlaceView;
use super::terms::FilterView;
use visage_gallery::{Likeness, MatchMethod};

/// How models are judged against a standard.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, ToSchema)]
#[schema(as = MatchMethod)]
#[serde(rename_all = "snake_case")]
pub enum MethodView {
    /// Triangles of salient regions with roles, chirality and normals find the place; then the standard's surface is
    /// fitted there, and its residual decides.
    #[default]
    Verified,
    /// The triangles alone.
    Descriptors,
    /// The paper's triangle alone: finds faces on anything; kept for comparison.
    Literal,
}

impl From<MatchMethod> for MethodView {
    fn from(method: MatchMethod) -> Self {
        match method {
            MatchMethod::Verified => MethodView::Verified,
            MatchMethod::Descriptors => MethodView::Descriptors,
            MatchMethod::Literal => MethodView::Literal,
        }
    }
}

impl From<MethodView> for MatchMethod {
    fn from(method: MethodView) -> Self {
        match method {
            MethodView::Verified => MatchMethod::Verified,
            MethodView::Descriptors => MatchMethod::Descriptors,
            MethodView::Literal => MatchMethod::Literal,
        }
    }
}

/// What makes models alike.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, ToSchema)]
#[schema(as = ProbeLikeness)]
#[serde(rename_all = "snake_case")]
pub enum LikenessView {
    /// Their faces if both have one, else their shapes as wholes.
    #[default]
    Shape,
    /// The paper's triangles of salient regions; kept for comparison.
    SalientRegions,
    /// That the probe is a single scan of the model.
    View,
}

impl From<LikenessView> for Likeness {
    fn from(likeness: LikenessView) -> Self {
        match likeness {
            LikenessView::Shape => Likeness::Shape,
            LikenessView::SalientRegions => Likeness::SalientRegions,
            LikenessView::View => Likeness::View,
        }
    }
}

/// A triangle: three corners in any order, or what tells it.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub enum TriangleView {
    /// Its corners.
    Corners([[f64; 3]; 3]),
    /// Its corners or sides, with more.
    Told(ToldTriangle),
}

// by hand: a derived schema would not say how many numbers a corner has
impl PartialSchema for TriangleView {
    fn schema() -> RefOr<Schema> {
        OneOfBuilder::new()
            .description(Some("A triangle: three corners in any order, or what tells it."))
            .item(Ref::from_schema_name(Corners::name()))
            .item(Ref::from_schema_name(ToldTriangle::name()))
            .into()
    }
}

impl ToSchema for TriangleView {
    fn name() -> Cow<'static, str> {
        "Triangle".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((Corners::name().into(), Corners::schema()));
        schemas.push((ToldTriangle::name().into(), ToldTriangle::schema()));
        ToldTriangle::schemas(schemas);
    }
}

/// A triangle: exactly one of `corners` and `sides`.
#[derive(Debug, Clone, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ToldTriangle {
    /// Its corners, in any order.
    #[schema(value_type = Option<Corners>)]
    pub corners: Option<[[f64; 3]; 3]>,
    /// The lengths of its sides, in any order; it is met from either side then.
    #[schema(min_items = 3, max_items = 3)]
    pub sides: Option<[f64; 3]>,
    /// The direction that is outside, for a triangle of corners; without it the triangle is met from either side, as
    /// is its mirror image.
    #[schema(value_type = Option<Point>)]
    pub outward: Option<[f64; 3]>,
    /// The unit of its lengths. With it, errors are millimetres on this triangle; without it, on one of the size of
    /// the standard face's. Which models are found is the same: the paper's error does not know size.
    #[serde(default)]
    pub unit: UnitView,
}

/// What is asked: exactly one of `standard`, `model_id` and `triangle`.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct QueryBody {
    /// A class: which models are faces?
    #[schema(example = "face")]
    pub standard: Option<String>,
    /// A stored model: which models are like it?
    #[schema(format = "uuid")]
    pub model_id: Option<String>,
    /// A bare triangle: on which models does it occur?
    pub triangle: Option<TriangleView>,
    /// How models are judged against a standard.
    pub method: Option<MethodView>,
    /// What makes models like a stored one.
    pub likeness: Option<LikenessView>,
    /// At most so many matches (1 to 1000, 20 if not given).
    #[schema(minimum = 1, maximum = 1000)]
    pub limit: Option<usize>,
    /// The score from which on a model is a match; the question's own if not given.
    #[schema(minimum = 0, maximum = 1)]
    pub threshold: Option<f64>,
    /// Leave out what is no match.
    pub only_matches: Option<bool>,
    /// Which models may be answered with.
    pub filter: Option<FilterView>,
    /// `next_cursor` of the page before.
    pub cursor: Option<String>,
    /// Tell each step's figure.
    pub explain: Option<bool>,
    /// Tell where the stored model lies on the first five matches of the page (ten with `likeness: view`), how far the surfaces agree, and how sure it
    /// is that both are the same object: some seconds of work.
    pub place: Option<bool>,
    /// Where several servers search the gallery and some of it can't be searched: answer with what the others find, marked as `partial`, rather
    /// than with an error.
    pub partial: Option<bool>,
}

/// The form by which an uploaded mesh or cloud is asked about. It is not stored.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only describes the form")]
pub struct ProbeForm {
    #[schema(schema_with = schemas::model)]
    probe: Vec<u8>,
    /// The unit of its coordinates; not known if not given.
    #[schema(required = false)]
    unit: UnitView,
    /// Judge the probe against this class, `face` or one of your own, rather than look for models like it.
    #[schema(required = false, example = "face")]
    standard: String,
    /// How it is judged against a standard.
    #[schema(required = false)]
    method: MethodView,
    /// What makes models like the probe.
    #[schema(required = false)]
    likeness: LikenessView,
    /// At most so many matches (1 to 1000, 20 if not given).
    #[schema(required = false, minimum = 1, maximum = 1000)]
    limit: usize,
    /// The score from which on a model, or the probe, is a match.
    #[schema(required = false, minimum = 0, maximum = 1)]
    threshold: f64,
    /// Leave out what is no match.
    #[schema(required = false)]
    only_matches: bool,
    /// Which models may be answered with, as JSON.
    #[schema(required = false)]
    filter: FilterView,
    /// `next_cursor` of the page before; send the same probe again.
    #[schema(required = false)]
    cursor: String,
    /// Tell each step's figure.
    #[schema(required = false)]
    explain: bool,
    /// Tell where the probe lies on the first five matches of the page (ten with `likeness: view`), how far the surfaces agree, and how sure it is that
    /// both are the same object: some seconds of work.
    #[schema(required = false)]
    place: bool,
    /// Answer with what is found where some of the gallery can't be searched, marked as `partial`, rather than with an error.
    #[schema(required = false)]
    partial: bool,
}

/// One ranked answer.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Match)]
pub struct MatchView {
    /// The model.
    #[schema(format = "uuid")]
    pub model_id: String,
    /// Its name.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates, and so of `triangle` and `landmarks`.
    pub unit: UnitView,
    /// High is good.
    #[schema(minimum = 0, maximum = 1)]
    pub score: f64,
    /// Whether the score reaches the threshold.
    pub is_match: bool,
    /// What is left after the best triangle is moved, turned and scaled onto the standard one, in millimetres on the
    /// standard (least squares); null if there is no triangle. By probe or triangle: onto that of the question.
    pub matching_error_mm: Option<f64>,
    /// The paper's total vertex distance of the same triangle; null if there is no triangle.
    pub sum_of_distances_mm: Option<f64>,
    /// How far its surface is from the standard face's, in millimetres on the standard; null if they come nowhere
    /// near each other.
    pub dense_residual_mm: Option<f64>,
    /// The share of the standard face's surface that could be seen on it.
    pub coverage: Option<f64>,
    /// The triangle in the model's frame and unit (for faces: right eye, left eye, nose); null if there is none.
    #[schema(value_type = Option<Corners>)]
    pub triangle: Option<Vec<Vec<f64>>>,
    /// The landmarks of its face in the model's frame and unit, by name; null if it has none.
    #[schema(value_type = Option<Landmarks>)]
    pub landmarks: Option<Places>,
    /// Why it is no match; null if it is one.
    pub reason: Option<ReasonView>,
    /// Each step's figure, if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explain: Option<ExplanationView>,
    /// Where the probe lies on it, if asked for and found; of the first `placed` matches of the page.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<PlaceView>,
    /// The model's address.
    pub href: String,
}

/// The answer to a query.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct QueryAnswer {
    /// Best first, ties by id. With `place` and `likeness: view` those that the scan surely lies on (`place.same_object` from 0.5 on) come before
    /// all others of the page, the surest first.
    pub matches: Vec<MatchView>,
    /// How many models the gallery holds that have a signature; filters are not counted.
    pub searched: usize,
    /// Models that are not judged against the standard yet: while there are any, the answer is not complete. Always 0 for
    /// the face, probes and triangles.
    pub pending: u64,
    /// True if a part of the gallery could not be searched and `partial` was asked for: its models are missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partial: Option<bool>,
    /// How many matches of the page the probe was laid onto, if that was asked for: ten of a single scan at most, else five.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placed: Option<usize>,
    /// What to send as `cursor` for the next page; null on the last one.
    pub next_cursor: Option<String>,
    /// How an uploaded probe was judged, if asked with a `standard`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdict: Option<VerdictView>,
    /// Each step's figure of that verdict, if asked for; by the face alone, since the verdict by a standard of your own
    /// holds all there is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explain: Option<ExplanationView>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_named_as_in_retrieval() {
        for method in [MethodView::Verified, MethodView::Descriptors, MethodView::Literal] {
            let ours = serde_json::to_value(method).expect("plain data");
            assert_eq!(ours, serde_json::to_value(MatchMethod::from(method)).expect("plain data"));
        }
        assert_eq!(MatchMethod::from(MethodView::default()), MatchMethod::default());
    }
}
