//! `/v1/scan-sets/{id}/expiry`: when a scan set is deleted by itself, with everything made of it.

use axum::Json;
use axum::extract::{Request, State};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::extract::{Path, read_json};
use super::names;
use super::problem::Problem;
use super::responses;
use super::scan_sets::{TAG, parse_id};
use super::state::{AppState, uninterrupted};

/// When a scan set is to be deleted.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpiryBody {
    /// The time (RFC 3339), which is to come; null if it is kept until somebody deletes it.
    #[schema(value_type = Option<String>, format = DateTime, required)]
    // a body that forgets it must not take back what was said
    #[serde(deserialize_with = "Option::deserialize")]
    expires_at: Option<String>,
}

/// When a scan set is deleted.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Expiry)]
pub(super) struct ExpiryView {
    /// The time (UTC, RFC 3339), give or take an hour; null if it is kept until somebody deletes it, or until it is older than the
    /// operator allows.
    expires_at: Option<String>,
}

/// When a scan set will be deleted.
#[utoipa::path(
    get, path = "/v1/scan-sets/{id}/expiry", tag = TAG, operation_id = "getExpiry",
    params(("id" = String, Path, format = "uuid", description = "The scan set.")),
    responses((status = 200, description = "When.", body = ExpiryView), responses::NotFound, responses::Other)
)]
pub(super) async fn get_expiry(
    State(state): State<AppState>,
    Path(id): Path<String>,
) -> Result<Json<ExpiryView>, Problem> {
    let at = state.context.database.expiry(parse_id(&id)?).await?;
    Ok(Json(ExpiryView { expires_at: at.map(|time| time.to_string()) }))
}

/// Say when a scan set is to be deleted, with its scans and with every job and model made of it.
///
/// A set that an unfinished job needs is deleted when that has ended.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/expiry", tag = TAG, operation_id = "putExpiry",
    params(("id" = String, Path, format = "uuid", description = "The scan set.")),
    request_body = ExpiryBody,
    responses((status = 200, description = "It is said.", body = ExpiryView), responses::BadRequest,
              responses::NotFound, responses::Stalled, responses::TooLarge, responses::WrongType,
              responses::Unprocessable, responses::Other)
)]
pub(super) async fn put_expiry(
    State(state): State<AppState>,
    Path(id): Path<String>,
    request: Request,
) -> Result<Json<ExpiryView>, Problem> {
    let id = parse_id(&id)?;
    let (body, _) = read_json::<ExpiryBody>(&state, request).await?;
    let at = body.expires_at.as_deref().map(|text| names::time_to_come("expires_at", text)).transpose()?;
    uninterrupted(async move { Ok(state.context.database.set_expiry(id, at).await?) }).await?;
    Ok(Json(ExpiryView { expires_at: at.map(|time| time.to_string()) }))
}
