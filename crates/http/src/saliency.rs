//! `/v1/models/{id}/saliency.ply`: what stands out of a model, as a coloured surface.

use axum::extract::State;
use axum::response::Response;

use super::conditions::{ConditionHeaders, Conditions};
use super::extract::Path;
use super::models::{TAG, parse_id};
use super::problem::Problem;
use super::schemas::FileContent;
use super::state::AppState;
use super::{pictures, responses};
use visage_geometry::progress::Progress;
use visage_service::app::pictures::SaliencyMap;

/// The model in the colours of its saliency: how much each place stands out from what is about it.
///
/// A PLY whose vertices have the property `saliency`, 0 to 1, with the triangles of the model if it has some. Measured while the client
/// waits, and kept for a while.
#[utoipa::path(
    get, path = "/v1/models/{id}/saliency.ply", tag = TAG, operation_id = "paintSaliency",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders),
    responses(
        (status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream",
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::Unchanged, responses::NotFound, responses::OtherState, responses::Unprocessable, responses::NotReady,
        responses::Other,
    )
)]
pub async fn map(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let source = SaliencyMap::find(&state.context, parse_id(&id)?).await?;
    let what = format!("{}-saliency", source.tag);
    let (context, bytes) = (state.context.clone(), source.bytes());
    let make = move |progress: &Progress| source.made(&context, progress);
    pictures::answer(&state, &conditions, &what, "application/octet-stream", bytes, make).await
}
