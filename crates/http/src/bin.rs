//! `/v1/bin`: what was deleted and can still be put back.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use jiff::SignedDuration;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::base::link;
use super::conditions::Turn;
use super::extract::{PageQuery, Path, Query};
use super::problem::Problem;
use super::state::{AppState, deleted, uninterrupted};
use super::{cursor, responses};
use visage_domain::{BinRecord, Deletable};
use visage_service::app::recycle_bin::{self, Removal};

const TAG: &str = "recycle bin";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(show, purge)).routes(routes!(restore))
}

/// How something is deleted.
#[derive(Debug, Clone, Copy, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct DeletionQuery {
    /// Whether nothing of it is kept in the recycle bin; without one nothing is kept anyway.
    #[serde(default)]
    #[param(required = false)]
    permanently: bool,
}

impl DeletionQuery {
    /// What the deletion does.
    pub(super) fn removal(self, state: &AppState) -> Removal {
        Removal::by(&state.context.config.retention, self.permanently)
    }
}

/// What was deleted.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum BinKind {
    /// A scan set with its jobs and models.
    ScanSet,
    /// A job with its model.
    Job,
    /// A model.
    Model,
}

/// Something that was deleted and can still be put back.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = BinEntry)]
struct BinEntryView {
    /// The id that it had, and will have again.
    #[schema(format = "uuid")]
    id: String,
    /// What it is.
    kind: BinKind,
    /// A name for people.
    name: String,
    /// Its class, if it has one.
    label: Option<String>,
    /// Models that were deleted with it, itself included.
    models: u64,
    /// Bytes of its files; they count for the quota of their key.
    bytes: u64,
    /// When it was deleted (UTC, RFC 3339).
    #[schema(format = DateTime)]
    deleted_at: String,
    /// When it is gone for good (UTC, RFC 3339), give or take an hour, or sooner, if it becomes older than the operator allows.
    #[schema(format = DateTime)]
    expires_at: String,
    /// Where it is, once it was put back.
    href: String,
}

impl BinEntryView {
    fn of(state: &AppState, entry: &BinRecord) -> BinEntryView {
        let (kind, place) = match entry.thing {
            Deletable::ScanSet(_) => (BinKind::ScanSet, "scan-sets"),
            Deletable::Job(_) => (BinKind::Job, "jobs"),
            Deletable::Model(_) => (BinKind::Model, "models"),
        };
        let deleted_at = entry.id.created_at();
        let kept = SignedDuration::from_hours(24 * i64::from(state.context.config.retention.bin));
        BinEntryView {
            id: entry.thing.to_string(),
            kind,
            name: entry.name.clone(),
            label: entry.label.clone(),
            models: entry.models,
            bytes: entry.bytes,
            deleted_at: deleted_at.to_string(),
            expires_at: deleted_at.saturating_add(kept).unwrap_or(deleted_at).to_string(),
            href: link(&format!("/v1/{place}/{}", entry.thing)),
        }
    }
}

/// A page of the recycle bin.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct BinList {
    /// The entries.
    items: Vec<BinEntryView>,
    /// What to send as `cursor` for the next page; null on the last one.
    next_cursor: Option<String>,
}

/// List what was deleted and can still be put back, the last deleted first.
#[utoipa::path(
    get, path = "/v1/bin", tag = TAG, operation_id = "listBin", params(PageQuery),
    responses((status = 200, description = "A page of the recycle bin.", body = BinList), responses::BadRequest,
              responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(page): Query<PageQuery>) -> Result<Json<BinList>, Problem> {
    let list = cursor::fingerprint(&[b"bin"]);
    let page = state.context.database.bin(&page.request(&list)?).await?;
    let next_cursor = page.next_cursor(|entry| cursor::after_item(&list, entry.id.number()));
    Ok(Json(BinList { items: page.items.iter().map(|entry| BinEntryView::of(&state, entry)).collect(), next_cursor }))
}

/// Look at one entry of the recycle bin.
#[utoipa::path(
    get, path = "/v1/bin/{id}", tag = TAG, operation_id = "getBinEntry",
    params(("id" = String, Path, format = "uuid", description = "What was deleted, by the id that it had.")),
    responses((status = 200, description = "The entry.", body = BinEntryView), responses::NotFound, responses::Other)
)]
async fn show(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<BinEntryView>, Problem> {
    let entry = state.context.database.binned(&id).await?;
    Ok(Json(BinEntryView::of(&state, &entry)))
}

/// Put back what was deleted, with all that was deleted with it. The next query finds its models.
///
/// A model whose job or scan set was deleted after it comes back once that has.
#[utoipa::path(
    post, path = "/v1/bin/{id}/restore", tag = TAG, operation_id = "restoreFromBin",
    params(("id" = String, Path, format = "uuid", description = "What was deleted, by the id that it had.")),
    responses((status = 200, description = "It is back, at `href`.", body = BinEntryView), responses::NotFound,
              responses::OriginDeleted, responses::Other)
)]
async fn restore(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<BinEntryView>, Problem> {
    uninterrupted(async move {
        let _turn = Turn::take(&state, false).await?;
        let entry = recycle_bin::restore(&state.context, &id).await?;
        Ok(Json(BinEntryView::of(&state, &entry)))
    })
    .await
}

/// Remove what was deleted for good, with what was made of it and is in the recycle bin, too.
#[utoipa::path(
    delete, path = "/v1/bin/{id}", tag = TAG, operation_id = "purgeFromBin",
    params(("id" = String, Path, format = "uuid", description = "What was deleted, by the id that it had.")),
    responses((status = 204, description = "It is gone for good."), responses::NotFound, responses::Other)
)]
async fn purge(State(state): State<AppState>, Path(id): Path<String>) -> Result<StatusCode, Problem> {
    deleted(async move { Ok(recycle_bin::purge(&state.context, &id).await?) }).await
}
