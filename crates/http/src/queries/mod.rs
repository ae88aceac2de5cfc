//! `/v1/queries`: which of the models are faces, which are like this one.
//!
//! - `question`: what is asked, read from JSON or from a form; `triangle`: a bare triangle
//! - `terms`: what every question may add: limit, threshold, filter
//! - `answer`: ranked matches and verdicts; `placing`: where a probe lies on them
//! - `views`: all of it as it goes over the wire

mod answer;
mod placing;
mod question;
mod terms;
mod triangle;
mod views;

use axum::Json;
use axum::extract::{Request, State};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::extract::{FORM, is_json, media_type, read_json, wrong_media_type};
use super::problem::Problem;
use super::state::AppState;
use super::{responses, upload};
use views::{ProbeForm, QueryAnswer, QueryBody};

pub(super) use placing::PlaceView;
pub(super) use question::{unknown_standard, verified_alone};
pub use views::MethodView;

pub(super) const TAG: &str = "queries";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(ask)).routes(routes!(ask_by_probe))
}

/// Ask which models are faces, which are like a stored one, or on which a triangle occurs.
///
/// A form as for `POST /v1/queries/probe` is taken here too.
#[utoipa::path(
    post, path = "/v1/queries", tag = TAG, operation_id = "query",
    request_body(content = QueryBody, examples(
        ("faces" = (value = json!({"standard": "face", "limit": 5, "only_matches": true}))),
        ("like a model" = (value = json!({"model_id": "0199c6a0-6d5b-7a35-9d2c-6f3b8d1e4a71"}))),
        ("a triangle" = (value = json!({"triangle": {"sides": [31.0, 52.5, 52.5], "unit": "mm"}}))),
    )),
    responses(
        (status = 200, description = "Ranked matches.", body = QueryAnswer),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::TooLarge, responses::WrongType,
        responses::Unprocessable, responses::NotReady, responses::Other,
    )
)]
async fn ask(State(state): State<AppState>, request: Request) -> Result<Json<QueryAnswer>, Problem> {
    let found = media_type(request.headers());
    if found == FORM {
        return ask_form(state, request).await;
    }
    if !is_json(&found) {
        return Err(wrong_media_type(&found, "application/json, or multipart/form-data with a part `probe`"));
    }
    let (body, _) = read_json::<QueryBody>(&state, request).await?;
    let question = question::of_json(&state, body).await?;
    answer::answer(&state, question::Asked::Gallery(Box::new(question))).await.map(Json)
}

/// Ask which models are like an uploaded mesh or cloud, or judge it against a standard.
///
/// What is uploaded is not stored.
#[utoipa::path(
    post, path = "/v1/queries/probe", tag = TAG, operation_id = "queryByProbe",
    request_body(content = ProbeForm, content_type = "multipart/form-data"),
    responses(
        (status = 200, description = "Ranked matches, or the verdict.", body = QueryAnswer),
        responses::BadRequest, responses::Stalled, responses::TooLarge, responses::WrongType, responses::Unprocessable,
        responses::NotReady, responses::Other,
    )
)]
async fn ask_by_probe(State(state): State<AppState>, request: Request) -> Result<Json<QueryAnswer>, Problem> {
    match media_type(request.headers()).as_str() {
        FORM => ask_form(state, request).await,
        found => Err(wrong_media_type(found, "multipart/form-data with a part `probe`")),
    }
}

async fn ask_form(state: AppState, request: Request) -> Result<Json<QueryAnswer>, Problem> {
    let form = upload::read_form(&state, request, &question::RULES).await?;
    let asked = question::of_form(&state, form).await?;
    answer::answer(&state, asked).await.map(Json)
}
