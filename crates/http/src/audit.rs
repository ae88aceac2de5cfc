//! `/v1/audit`: who did what to what.

use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cursor;
use super::extract::{PageQuery, Query};
use super::problem::{Code, Problem};
use super::responses;
use super::state::AppState;
use visage_domain::{AuditEntry, AuditFilter, KeyId};

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list))
}

/// Which entries to list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Only those of what has this id or name.
    target: Option<String>,
    /// Only those of this key.
    #[param(format = "uuid")]
    key_id: Option<String>,
    /// At most so many items (1 to 100, 20 if not given).
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<usize>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
}

/// A request that changed something, or wanted to.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = AuditEntry)]
struct EntryView {
    /// When (UTC, RFC 3339).
    at: String,
    /// The key that was shown; null for who needed none.
    #[schema(format = "uuid")]
    key_id: Option<String>,
    /// The address that it came from; behind a proxy as that tells, if it is trusted.
    client: Option<String>,
    /// What the log has it under: `x-request-id` of its answer.
    request: String,
    /// The method.
    method: String,
    /// The path, as the contract writes it.
    route: String,
    /// The id or name of what it was done to, or of what was made.
    target: Option<String>,
    /// The status of the answer; 499 if the client left before.
    status: u16,
}

impl EntryView {
    fn of(entry: AuditEntry) -> EntryView {
        EntryView {
            at: entry.id.created_at().to_string(),
            key_id: entry.key.map(|key| key.to_string()),
            client: entry.client,
            request: entry.request,
            method: entry.method,
            route: entry.route,
            target: entry.target,
            status: entry.status,
        }
    }
}

/// Entries, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct AuditList {
    /// The entries.
    items: Vec<EntryView>,
    /// Where the next page begins; null on the last one.
    next_cursor: Option<String>,
}

/// Who did what to what: requests that changed something or were refused a change, newest first.
#[utoipa::path(
    get, path = "/v1/audit", tag = "access", operation_id = "listAudit", params(ListQuery),
    responses((status = 200, description = "A page of the audit log.", body = AuditList), responses::BadRequest,
              responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(query): Query<ListQuery>) -> Result<Json<AuditList>, Problem> {
    let key = query.key_id.as_deref().map(|text| {
        let refused = || Problem::new(Code::InvalidField, "key_id is no id of a key", "GET /v1/keys lists them");
        KeyId::parse(text).ok_or_else(refused)
    });
    let filter = AuditFilter { target: query.target, key: key.transpose()? };
    let list = cursor::fingerprint(&[b"audit", format!("{filter:?}").as_bytes()]);
    let page = PageQuery { limit: query.limit, cursor: query.cursor }.request(&list)?;
    let page = state.context.database.audit(&filter, &page).await?;
    let next_cursor = page.next_cursor(|entry| cursor::after_item(&list, entry.id.number()));
    Ok(Json(AuditList { items: page.items.into_iter().map(EntryView::of).collect(), next_cursor }))
}
