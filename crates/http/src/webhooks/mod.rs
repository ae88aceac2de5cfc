//! `/v1/webhooks`: addresses that are sent a message when a job ends and when a model is added or deleted.

mod views;

use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::access::Caller;
use super::extract::{PageQuery, Path, Query, read_json};
use super::problem::{Code, Problem};
use super::state::{AppState, deleted, uninterrupted};
use super::{cursor, names, outgoing, responses};
use views::{DeliveryList, DeliveryView, NewWebhookBody, NewWebhookView, ReplayedView, WebhookList, WebhookView};
use visage_domain::{DeliveryId, DeliveryStatus, WebhookId};
use visage_service::app::webhooks::{self, Unreached, WebhookError};
use visage_service::config::{Address, NoAddress};
use visage_service::storage::DatabaseError;

const TAG: &str = "webhooks";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(show, delete))
        .routes(routes!(ping))
        .routes(routes!(deliveries))
        .routes(routes!(replay_dead))
        .routes(routes!(replay))
}

/// Make a webhook. What is told are ids: the receiver asks for the rest, with a key of its own.
#[utoipa::path(
    post, path = "/v1/webhooks", tag = TAG, operation_id = "createWebhook",
    request_body = NewWebhookBody,
    responses((status = 201, description = "The webhook, with its secret.", body = NewWebhookView,
               headers(("Location" = String, description = "Its address."))),
              responses::BadRequest, responses::Stalled, responses::TooLarge, responses::WrongType,
              responses::Unprocessable, responses::Other)
)]
async fn create(
    State(state): State<AppState>,
    Extension(caller): Extension<Caller>,
    request: Request,
) -> Result<Response, Problem> {
    let (body, _) = read_json::<NewWebhookBody>(&state, request).await?;
    let name = names::text("name", &body.name)?;
    let address: Address = body.url.parse().map_err(|error: NoAddress| {
        Problem::new(Code::InvalidField, format!("url: {error}"), "send one such as https://app.example/hooks")
    })?;
    let mut events = body.events;
    events.sort();
    events.dedup();
    if events.is_empty() {
        let detail = "events is empty";
        return Err(Problem::new(Code::InvalidField, detail, "name at least one kind, such as job.succeeded"));
    }
    outgoing::check(&address, &state.context.config.webhooks)?;
    let key = caller.key.map(|key| key.id);
    let (webhook, secret) = uninterrupted(async move {
        let database = state.context.database.as_ref();
        let (id, secret) = webhooks::create(database, key, name, &address, events).await?;
        Ok((database.webhook(id).await?, secret))
    })
    .await?;
    let view = NewWebhookView { webhook: WebhookView::of(webhook), secret: webhooks::written_secret(&secret) };
    let location = HeaderValue::try_from(view.webhook.href()).map_err(Problem::internal)?;
    let no_store = HeaderValue::from_static("no-store");
    let headers = [(header::LOCATION, location), (header::CACHE_CONTROL, no_store)];
    Ok((StatusCode::CREATED, headers, Json(view)).into_response())
}

/// List webhooks, newest first.
#[utoipa::path(
    get, path = "/v1/webhooks", tag = TAG, operation_id = "listWebhooks", params(PageQuery),
    responses((status = 200, description = "A page of webhooks.", body = WebhookList), responses::BadRequest,
              responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(page): Query<PageQuery>) -> Result<Json<WebhookList>, Problem> {
    let list = cursor::fingerprint(&[b"webhooks"]);
    let page = state.context.database.webhooks(&page.request(&list)?).await?;
    let next_cursor = page.next_cursor(|webhook| cursor::after_item(&list, webhook.id.number()));
    Ok(Json(WebhookList { items: page.items.into_iter().map(WebhookView::of).collect(), next_cursor }))
}

/// One webhook, with how many messages wait and how many are dead.
#[utoipa::path(
    get, path = "/v1/webhooks/{id}", tag = TAG, operation_id = "getWebhook",
    params(("id" = String, Path, format = "uuid", description = "The webhook.")),
    responses((status = 200, description = "The webhook.", body = WebhookView), responses::NotFound, responses::Other)
)]
async fn show(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<WebhookView>, Problem> {
    Ok(Json(WebhookView::of(state.context.database.webhook(parse_id(&id)?).await?)))
}

/// Delete a webhook with all messages to it.
#[utoipa::path(
    delete, path = "/v1/webhooks/{id}", tag = TAG, operation_id = "deleteWebhook",
    params(("id" = String, Path, format = "uuid", description = "The webhook.")),
    responses((status = 204, description = "It is deleted."), responses::NotFound, responses::Other)
)]
async fn delete(State(state): State<AppState>, Path(id): Path<String>) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    deleted(async move { Ok(state.context.database.delete_webhook(id).await?) }).await
}

/// Try a webhook: a message `webhook.ping` is queued for it, whatever it wants to be told.
#[utoipa::path(
    post, path = "/v1/webhooks/{id}/ping", tag = TAG, operation_id = "pingWebhook",
    params(("id" = String, Path, format = "uuid", description = "The webhook.")),
    responses((status = 202, description = "The message, which is being sent.", body = DeliveryView),
              responses::NotFound, responses::Other)
)]
async fn ping(
    State(state): State<AppState>,
    Path(id): Path<String>,
) -> Result<(StatusCode, Json<DeliveryView>), Problem> {
    let id = parse_id(&id)?;
    queued(&state, async { state.context.database.ping_webhook(id).await }).await
}

/// Which messages to list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct DeliveriesQuery {
    /// Only those that stand here; `dead` are those that could not be delivered.
    #[param(inline)]
    status: Option<DeliveryStatus>,
    /// At most so many items (1 to 100, 20 if not given).
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<usize>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
}

/// Messages to a webhook and what came of them, newest first. Delivered ones are kept for 7 days, dead ones for 30.
#[utoipa::path(
    get, path = "/v1/webhooks/{id}/deliveries", tag = TAG, operation_id = "listDeliveries",
    params(("id" = String, Path, format = "uuid", description = "The webhook."), DeliveriesQuery),
    responses((status = 200, description = "A page of messages.", body = DeliveryList), responses::BadRequest,
              responses::NotFound, responses::Unprocessable, responses::Other)
)]
async fn deliveries(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<DeliveriesQuery>,
) -> Result<Json<DeliveryList>, Problem> {
    let id = parse_id(&id)?;
    let status = query.status.map_or("", DeliveryStatus::name);
    let list = cursor::fingerprint(&[b"deliveries", id.to_string().as_bytes(), status.as_bytes()]);
    let page = PageQuery { limit: query.limit, cursor: query.cursor }.request(&list)?;
    let page = state.context.database.deliveries(id, query.status, &page).await?;
    let next_cursor = page.next_cursor(|delivery| cursor::after_item(&list, delivery.id.number()));
    Ok(Json(DeliveryList { items: page.items.into_iter().map(DeliveryView::of).collect(), next_cursor }))
}

/// Send all dead messages to a webhook once more, under their ids.
#[utoipa::path(
    post, path = "/v1/webhooks/{id}/replay", tag = TAG, operation_id = "replayDeadDeliveries",
    params(("id" = String, Path, format = "uuid", description = "The webhook.")),
    responses((status = 202, description = "They are queued.", body = ReplayedView), responses::NotFound,
              responses::Other)
)]
async fn replay_dead(
    State(state): State<AppState>,
    Path(id): Path<String>,
) -> Result<(StatusCode, Json<ReplayedView>), Problem> {
    let replayed = state.context.database.replay_dead(parse_id(&id)?).await?;
    state.context.monitor.announce_change();
    Ok((StatusCode::ACCEPTED, Json(ReplayedView { replayed })))
}

/// Send a message that has ended once more, under its id.
#[utoipa::path(
    post, path = "/v1/webhooks/{id}/deliveries/{delivery_id}/replay", tag = TAG, operation_id = "replayDelivery",
    params(("id" = String, Path, format = "uuid", description = "The webhook."),
           ("delivery_id" = String, Path, format = "uuid", description = "The message.")),
    responses((status = 202, description = "It is queued.", body = DeliveryView), responses::NotFound,
              responses::Conflict, responses::Other)
)]
async fn replay(
    State(state): State<AppState>,
    Path((id, delivery)): Path<(String, String)>,
) -> Result<(StatusCode, Json<DeliveryView>), Problem> {
    let id = parse_id(&id)?;
    let delivery = DeliveryId::parse(&delivery).ok_or_else(|| not_found("delivery", &delivery))?;
    queued(&state, async { state.context.database.replay_delivery(id, delivery).await }).await
}

/// Answers with a message that was queued, after its sender was told.
async fn queued(
    state: &AppState,
    queueing: impl Future<Output = Result<visage_domain::DeliveryRecord, DatabaseError>>,
) -> Result<(StatusCode, Json<DeliveryView>), Problem> {
    let delivery = queueing.await?;
    state.context.monitor.announce_change();
    Ok((StatusCode::ACCEPTED, Json(DeliveryView::of(delivery))))
}

fn parse_id(text: &str) -> Result<WebhookId, Problem> {
    WebhookId::parse(text).ok_or_else(|| not_found("webhook", text))
}

fn not_found(kind: &'static str, id: &str) -> Problem {
    DatabaseError::NotFound { kind, id: id.chars().take(64).collect() }.into()
}

impl From<WebhookError> for Problem {
    fn from(error: WebhookError) -> Self {
        match error {
            WebhookError::Database(error) => error.into(),
            WebhookError::Randomness(error) => Problem::internal(error),
        }
    }
}

impl From<Unreached> for Problem {
    fn from(error: Unreached) -> Self {
        let hint = "send an https address of the public network, or ask the operator to allow the network it is in";
        Problem::new(Code::ForbiddenAddress, error.to_string(), hint)
    }
}
