//! Questions and answers as they go over the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::scan_set_views::UnitView;
use crate::retrieval::MatchMethod;

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

impl From<MethodView> for MatchMethod {
    fn from(method: MethodView) -> Self {
        match method {
            MethodView::Verified => MatchMethod::Verified,
            MethodView::Descriptors => MatchMethod::Descriptors,
            MethodView::Literal => MatchMethod::Literal,
        }
    }
}

/// What is asked: exactly one of `standard` and `model_id`.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct QueryBody {
    /// A class: which models are faces?
    #[schema(example = "face")]
    pub standard: Option<String>,
    /// A stored model: which models are like it?
    #[schema(format = "uuid")]
    pub model_id: Option<String>,
    /// How models are judged against a standard.
    pub method: Option<MethodView>,
    /// At most so many matches (1 to 1000, 20 if not given).
    #[schema(minimum = 1, maximum = 1000, default = 20)]
    pub limit: Option<usize>,
    /// The score from which on a model is a match; the standard's own if not given.
    #[schema(minimum = 0, maximum = 1)]
    pub threshold: Option<f64>,
}

/// The form by which an uploaded mesh or cloud is asked about. It is not stored.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only describes the form")]
pub struct ProbeForm {
    /// A mesh or cloud: PLY, PCD or OBJ.
    #[schema(value_type = String, format = Binary)]
    probe: Vec<u8>,
    /// The unit of its coordinates.
    unit: Option<UnitView>,
    /// At most so many matches (1 to 1000, 20 if not given).
    #[schema(minimum = 1, maximum = 1000, default = 20)]
    limit: Option<usize>,
    /// The score from which on a model is a match.
    #[schema(minimum = 0, maximum = 1)]
    threshold: Option<f64>,
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
    /// High is good.
    #[schema(minimum = 0, maximum = 1)]
    pub score: f64,
    /// Whether the score reaches the threshold.
    pub is_match: bool,
    /// What is left after the best triangle is moved, turned and scaled onto the standard one, in millimetres on the
    /// standard (least squares); null if there is no triangle.
    pub matching_error_mm: Option<f64>,
    /// The paper's total vertex distance of the same triangle; null if there is no triangle.
    pub sum_of_distances_mm: Option<f64>,
    /// The triangle in the model's frame (for faces: right eye, left eye, nose); null if there is none.
    pub triangle: Option<Vec<Vec<f64>>>,
    /// The model's address.
    pub href: String,
}

/// The answer to a query.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct QueryAnswer {
    /// Best first, ties by id.
    pub matches: Vec<MatchView>,
    /// How many models were searched: those that have a signature.
    pub searched: usize,
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
