//! `/v1/keys`: keys are made, listed and revoked. The token of a key is told once, when it is made.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cursor;
use super::extract::{PageQuery, Path, Query, read_json};
use super::names;
use super::problem::Problem;
use super::responses;
use super::schemas::ShortText;
use super::state::{AppState, deleted, uninterrupted};
use visage_domain::{KeyId, KeyRecord, Scope};
use visage_service::app::access;
use visage_service::storage::DatabaseError;

const TAG: &str = "access";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create, list)).routes(routes!(revoke))
}

/// A key that is to be made.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewKeyBody {
    /// What it is for: a person or a program.
    #[schema(value_type = ShortText)]
    name: String,
    /// What it allows.
    scope: Scope,
    /// From when on it is not taken any more (RFC 3339); never, if not given.
    #[schema(value_type = Option<String>, format = DateTime)]
    expires_at: Option<String>,
}

/// A key.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Key)]
struct KeyView {
    /// Its id.
    #[schema(format = "uuid")]
    id: String,
    /// What it is for.
    name: String,
    /// What it allows.
    scope: Scope,
    /// When it was made (UTC, RFC 3339).
    created_at: String,
    /// From when on it is not taken any more; null if it does not expire.
    expires_at: Option<String>,
    /// Since when it is revoked; null if it isn't.
    revoked_at: Option<String>,
}

impl KeyView {
    fn of(key: &KeyRecord) -> KeyView {
        KeyView {
            id: key.id.to_string(),
            name: key.name.clone(),
            scope: key.scope,
            created_at: key.id.created_at().to_string(),
            expires_at: key.expires_at.map(|time| time.to_string()),
            revoked_at: key.revoked_at.map(|time| time.to_string()),
        }
    }
}

/// A key that was just made.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct NewKeyView {
    /// The key.
    #[serde(flatten)]
    key: KeyView,
    /// What has to be sent as `Authorization: Bearer`. It is told this once: the service keeps a hash.
    token: String,
}

/// Keys, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct KeyList {
    /// The keys.
    items: Vec<KeyView>,
    /// Where the next page begins; null on the last one.
    next_cursor: Option<String>,
}

/// Make a key. As soon as there was one, every request needs one.
#[utoipa::path(
    post, path = "/v1/keys", tag = TAG, operation_id = "createKey",
    request_body = NewKeyBody,
    responses((status = 201, description = "The key, with its token.", body = NewKeyView),
              responses::BadRequest, responses::Stalled, responses::TooLarge, responses::WrongType,
              responses::Unprocessable, responses::Other)
)]
async fn create(State(state): State<AppState>, request: Request) -> Result<Response, Problem> {
    let (body, _) = read_json::<NewKeyBody>(&state, request).await?;
    let name = names::text("name", &body.name)?;
    let expires_at = body.expires_at.as_deref().map(|text| names::time_to_come("expires_at", text)).transpose()?;
    let (key, token) = uninterrupted(async move {
        Ok(access::create_key(state.context.database.as_ref(), name, body.scope, expires_at).await?)
    })
    .await?;
    let view = NewKeyView { key: KeyView::of(&key), token: token.to_string() };
    let no_store = (header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok((StatusCode::CREATED, [no_store], Json(view)).into_response())
}

/// List keys, newest first; revoked ones too.
#[utoipa::path(
    get, path = "/v1/keys", tag = TAG, operation_id = "listKeys", params(PageQuery),
    responses((status = 200, description = "A page of keys.", body = KeyList), responses::BadRequest,
              responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(page): Query<PageQuery>) -> Result<Json<KeyList>, Problem> {
    let list = cursor::fingerprint(&[b"keys"]);
    let page = state.context.database.keys(&page.request(&list)?).await?;
    let next_cursor = page.next_cursor(|key| cursor::after_item(&list, key.id.number()));
    Ok(Json(KeyList { items: page.items.iter().map(KeyView::of).collect(), next_cursor }))
}

/// Revoke a key: it is not taken any more, and neither are its sessions. It stays in the list.
#[utoipa::path(
    delete, path = "/v1/keys/{id}", tag = TAG, operation_id = "revokeKey",
    params(("id" = String, Path, format = "uuid", description = "The key.")),
    responses((status = 204, description = "It is revoked."), responses::NotFound, responses::Other)
)]
async fn revoke(State(state): State<AppState>, Path(id): Path<String>) -> Result<StatusCode, Problem> {
    let id =
        KeyId::parse(&id).ok_or_else(|| DatabaseError::NotFound { kind: "key", id: id.chars().take(64).collect() })?;
    deleted(async move {
        state.context.database.revoke_key(id).await?;
        // streams that it has begun end
        state.context.monitor.announce_change();
        Ok(())
    })
    .await
}
