//! `/v1/queries`: which of the models are faces, which are like this one.
//!
//! - `question`: what is asked, read from JSON or from a form; `triangle`: a bare triangle
//! - `terms`: what every question may add: limit, threshold, filter
//! - `answer`: ranked matches with what is stored of their models; `class`: those of a class that a user has made
//! - `views`: all of it as it goes over the wire

mod answer;
mod class;
mod question;
mod terms;
mod triangle;
mod views;

use axum::Json;
use axum::extract::{Request, State};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::extract::{is_json, media_type, read_json, wrong_media_type};
use super::problem::Problem;
use super::state::AppState;
use super::{responses, upload};
use views::{ProbeForm, QueryAnswer, QueryBody};

pub(super) use question::{unknown_standard, verified_alone};
pub use views::MethodView;

pub(super) const TAG: &str = "queries";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(ask))
}

/// Ask which models are faces, which are like a given one, or on which a triangle occurs; or judge a probe.
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
        question::of_form(&state, upload::read_form(&state, request, &question::RULES).await?).await?
    } else if is_json(&found) {
        let (body, _) = read_json::<QueryBody>(&state, request).await?;
        question::of_json(&state, body).await?
    } else {
        return Err(wrong_media_type(&found, "application/json, or multipart/form-data with a part `probe`"));
    };
    match answer::verdict(&question) {
        Some(verdict) => Ok(Json(verdict)),
        None => answer::answer(&state, question).await.map(Json),
    }
}
