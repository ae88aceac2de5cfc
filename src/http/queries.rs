//! `/v1/queries` and `/v1/standards`: which of the models are faces, which are like this one.

use std::collections::HashMap;

use axum::Json;
use axum::extract::{Request, State};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::extract::{is_json, media_type, read_json, wrong_media_type};
use super::models::parse_id as parse_model_id;
use super::problem::{Code, Problem};
use super::scan_set_views::UnitView;
use super::state::{AppState, blocking};
use super::upload::{self, Form, FormRules};
use super::{describe, model_views, names, responses};
use crate::faces::Signature;
use crate::retrieval::{self, Gallery, Match, MatchMethod};
use crate::store::ModelId;

const TAG: &str = "queries";
const RULES: FormRules = FormRules { files: &["probe"], most_files: 1, texts: &["unit", "limit", "threshold"] };
/// Matches in one answer.
const MOST_MATCHES: usize = 1000;
const DEFAULT_MATCHES: usize = 20;

/// The routes of these resources.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(ask)).routes(routes!(standards))
}

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
struct QueryBody {
    /// A class: which models are faces?
    #[schema(example = "face")]
    standard: Option<String>,
    /// A stored model: which models are like it?
    #[schema(format = "uuid")]
    model_id: Option<String>,
    /// How models are judged against a standard.
    method: Option<MethodView>,
    /// At most so many matches (1 to 1000, 20 if not given).
    #[schema(minimum = 1, maximum = 1000, default = 20)]
    limit: Option<usize>,
    /// The score from which on a model is a match; the standard's own if not given.
    #[schema(minimum = 0, maximum = 1)]
    threshold: Option<f64>,
}

/// The form by which an uploaded mesh or cloud is asked about. It is not stored.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only describes the form")]
struct ProbeForm {
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
struct MatchView {
    /// The model.
    #[schema(format = "uuid")]
    model_id: String,
    /// Its name.
    name: String,
    /// Its class, if it has one.
    label: Option<String>,
    /// High is good.
    #[schema(minimum = 0, maximum = 1)]
    score: f64,
    /// Whether the score reaches the threshold.
    is_match: bool,
    /// What is left after the best triangle is moved, turned and scaled onto the standard one, in millimetres on the
    /// standard (least squares); null if there is no triangle.
    matching_error_mm: Option<f64>,
    /// The paper's total vertex distance of the same triangle; null if there is no triangle.
    sum_of_distances_mm: Option<f64>,
    /// The triangle in the model's frame (for faces: right eye, left eye, nose); null if there is none.
    triangle: Option<Vec<Vec<f64>>>,
    /// The model's address.
    href: String,
}

/// The answer to a query.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct QueryAnswer {
    /// Best first, ties by id.
    matches: Vec<MatchView>,
    /// How many models were searched: those that have a signature.
    searched: usize,
}

/// Ask which models are faces, or which are like a given one.
#[utoipa::path(
    post, path = "/v1/queries", tag = TAG, operation_id = "query",
    request_body(content((QueryBody = "application/json"), (ProbeForm = "multipart/form-data"))),
    responses(
        (status = 200, description = "Ranked matches.", body = QueryAnswer),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::TooLarge, responses::WrongType,
        responses::Unprocessable, responses::NotReady, responses::Other,
    )
)]
async fn ask(State(state): State<AppState>, request: Request) -> Result<Json<QueryAnswer>, Problem> {
    let found = media_type(request.headers());
    let question = if found == "multipart/form-data" {
        question_of_form(&state, upload::read_form(&state, request, &RULES).await?).await?
    } else if is_json(&found) {
        let (body, _) = read_json::<QueryBody>(request, state.limits().text_bytes).await?;
        question_of_json(&state, body).await?
    } else {
        return Err(wrong_media_type(&found, "application/json, or multipart/form-data with a part `probe`"));
    };
    let gallery = state.shop.gallery.clone();
    let (matches, searched) =
        blocking(move || gallery.ask(|gallery| Ok::<_, Problem>((question.answer(gallery)?, gallery.len()))))
            .await???;
    Ok(Json(QueryAnswer { matches: named(&state, matches).await?, searched }))
}

/// A question to the gallery.
struct Question {
    about: About,
    limit: usize,
    threshold: Option<f64>,
}

enum About {
    Standard { name: String, method: MatchMethod },
    Probe { signature: Box<Signature>, stored: Option<ModelId> },
}

impl Question {
    fn answer(&self, gallery: &Gallery) -> Result<Vec<Match>, Problem> {
        match &self.about {
            About::Standard { name, method } => {
                gallery.by_standard(name, *method, self.limit, self.threshold).ok_or_else(|| {
                    let detail = format!("there is no standard {name:?}");
                    Problem::new(Code::UnknownStandard, detail, "GET /v1/standards lists those that can be asked for")
                })
            }
            About::Probe { signature, stored } => {
                Ok(gallery.by_probe(signature, stored.map(ModelId::number), self.limit, self.threshold))
            }
        }
    }
}

async fn question_of_json(state: &AppState, body: QueryBody) -> Result<Question, Problem> {
    let (limit, threshold) = bounds(body.limit, body.threshold)?;
    let about = match (body.standard, body.model_id) {
        (Some(name), None) => About::Standard { name, method: body.method.unwrap_or_default().into() },
        (None, Some(_)) if body.method.is_some() => {
            let detail = "method tells how models are judged against a standard";
            return Err(Problem::new(Code::InvalidField, detail, "leave it out when asking about a model"));
        }
        (None, Some(id)) => {
            let id = parse_model_id(&id)?;
            About::Probe { signature: Box::new(stored_signature(state, id).await?), stored: Some(id) }
        }
        _ => {
            let detail = "a query names either a standard or a model_id";
            return Err(Problem::new(
                Code::InvalidField,
                detail,
                "send {\"standard\": \"face\"} or {\"model_id\": \"...\"}",
            ));
        }
    };
    Ok(Question { about, limit, threshold })
}

async fn question_of_form(state: &AppState, mut form: Form) -> Result<Question, Problem> {
    let limit = form.text("limit")?.map(|text| number("limit", text)).transpose()?;
    let threshold = form.text("threshold")?.map(|text| number("threshold", text)).transpose()?;
    let (limit, threshold) = bounds(limit, threshold)?;
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let file = form.files.pop().ok_or_else(|| {
        Problem::new(
            Code::InvalidField,
            "the form has no part `probe`",
            "send the mesh or cloud as a file named `probe`",
        )
    })?;
    let (file, surface) = upload::read_surface(state, file).await?;
    let signature = describe::describe(state, &file.name, surface, unit).await?;
    Ok(Question { about: About::Probe { signature: Box::new(signature), stored: None }, limit, threshold })
}

fn number<T: std::str::FromStr>(part: &str, text: &str) -> Result<T, Problem> {
    text.trim().parse().map_err(|_| {
        Problem::new(
            Code::InvalidField,
            format!("the part {part} is {text:?}, which is no number that fits"),
            "send a number",
        )
    })
}

fn bounds(limit: Option<usize>, threshold: Option<f64>) -> Result<(usize, Option<f64>), Problem> {
    let limit = limit.unwrap_or(DEFAULT_MATCHES);
    if !(1..=MOST_MATCHES).contains(&limit) {
        let detail = format!("limit is {limit}, which is not between 1 and {MOST_MATCHES}");
        return Err(Problem::new(Code::InvalidField, detail, "ask for fewer matches"));
    }
    if let Some(threshold) = threshold
        && !(0.0..=1.0).contains(&threshold)
    {
        let detail = format!("threshold is {threshold}, which is not between 0 and 1");
        return Err(Problem::new(Code::InvalidField, detail, "scores are between 0 and 1"));
    }
    Ok((limit, threshold))
}

async fn stored_signature(state: &AppState, id: ModelId) -> Result<Signature, Problem> {
    state.shop.store.model(id).await?;
    let refused = |reason: String| {
        let hint = "upload the model again, or register its scans again with signature: true";
        Problem::new(Code::NoSignature, format!("model {id} can't be asked about: {reason}"), hint)
    };
    let content = state.shop.store.signature(id).await?.ok_or_else(|| refused("it has no signature".to_owned()))?;
    Signature::from_bytes(&content).map_err(|error| refused(error.to_string()))
}

/// Puts names to the matches; a model that was deleted since the search is left out.
async fn named(state: &AppState, matches: Vec<Match>) -> Result<Vec<MatchView>, Problem> {
    let ids: Vec<ModelId> = matches.iter().map(|found| ModelId::from_number(found.model_id)).collect();
    let names = state.shop.store.model_names(&ids).await?;
    let mut names: HashMap<_, _> = names.into_iter().map(|(id, name, label)| (id, (name, label))).collect();
    let view = |found: Match| {
        let id = ModelId::from_number(found.model_id);
        let (name, label) = names.remove(&id)?;
        let has_triangle = found.triangle.is_some();
        Some(MatchView {
            model_id: id.to_string(),
            name,
            label,
            score: found.score,
            is_match: found.is_match,
            matching_error_mm: has_triangle.then_some(found.matching_error_mm).filter(|error| error.is_finite()),
            sum_of_distances_mm: has_triangle.then_some(found.sum_of_distances_mm).filter(|sum| sum.is_finite()),
            triangle: found.triangle.map(|corners| corners.map(|corner| corner.to_vec()).to_vec()),
            href: model_views::address(id),
        })
    };
    Ok(matches.into_iter().filter_map(view).collect())
}

/// The classes that can be asked for.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct StandardList {
    /// What is known of each: its name, its triangle in millimetres, its threshold.
    #[schema(value_type = Vec<Object>)]
    items: Vec<serde_json::Value>,
}

/// List the classes that can be asked for.
#[utoipa::path(
    get, path = "/v1/standards", tag = TAG, operation_id = "listStandards",
    responses((status = 200, description = "The built-in standards.", body = StandardList), responses::Other)
)]
async fn standards() -> Json<StandardList> {
    Json(StandardList { items: retrieval::standards() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_limit_and_threshold() {
        assert_eq!(bounds(None, None).expect("defaults"), (20, None));
        assert!(bounds(Some(0), None).is_err());
        assert!(bounds(Some(1001), None).is_err());
        assert!(bounds(None, Some(f64::NAN)).is_err());
        assert!(bounds(None, Some(1.5)).is_err());
        assert_eq!(bounds(Some(5), Some(0.5)).expect("in bounds"), (5, Some(0.5)));
    }

    #[test]
    fn methods_are_named_as_in_retrieval() {
        for method in [MethodView::Verified, MethodView::Descriptors, MethodView::Literal] {
            let ours = serde_json::to_value(method).expect("plain data");
            assert_eq!(ours, serde_json::to_value(MatchMethod::from(method)).expect("plain data"));
        }
        assert_eq!(MatchMethod::from(MethodView::default()), MatchMethod::default());
    }
}
