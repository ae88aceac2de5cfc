//! The table of contents: resources, fallbacks and layers, and the contract made from the same routes.

use std::any::Any;
use std::sync::Arc;

use axum::Router;
use axum::extract::{DefaultBodyLimit, Request};
use axum::http::{HeaderName, HeaderValue, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tower::ServiceBuilder;
use tower_http::ServiceBuilderExt;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::request_id::{MakeRequestId, RequestId};
use tower_http::trace::TraceLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;

use super::forwarded::{self, Client};
use super::problem::{Code, Problem, ProblemBody};
use super::schemas::{
    CloudFormat, MeshFormat, PictureKind, PicturePlane, PictureSide, PictureSize, PlotKind, PosesFormat, ScansFormat,
    SurfaceFile,
};
use super::state::AppState;
use super::{
    access, access_log, audit, base, bin, body, duplicates, encoding, evaluation, headers, hosts, jobs, keys, meta,
    metrics, models, page, queries, scan_sets, searching, session, standards, uploads, webhooks,
};
use visage_service::config::{BasePath, Network};
use visage_service::panics::panic_message;
use visage_service::traces::Traces;

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

#[derive(OpenApi)]
#[openapi(
    info(
        title = "visage",
        description = "Registers batches of 3D range scans into one model and finds faces among the models it keeps.\n\n\
            Every error is `application/problem+json` (RFC 9457) with a stable `code`, the `scan` concerned and a \
            `hint`. Lists are paged: send `next_cursor` as `cursor`. POSTs that create something take an \
            `Idempotency-Key`: the same key with the same body gives the same answer for a day, with another body a 422.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
    ),
    components(schemas(
        ProblemBody, SurfaceFile, CloudFormat, MeshFormat, PosesFormat, ScansFormat, PictureKind, PlotKind, PictureSize,
        PictureSide, PicturePlane,
    )),
    tags(
        (name = "scan sets", description = "The ordered scans of one object, with their initial poses."),
        (name = "jobs", description = "Asynchronous registration: queued, running, succeeded, failed, canceled."),
        (name = "models", description = "Registered objects, and finished models uploaded to the gallery."),
        (name = "queries", description = "Which models are faces, and which are like a given one."),
        (name = "standards", description = "The classes that can be asked for: the built-in face, and those of users."),
        (name = "recycle bin", description = "What was deleted and can still be put back, if the operator keeps it for a while."),
        (name = "access", description = "Keys, and signing in by a browser."),
        (name = "webhooks", description = "Addresses that are sent a signed message when a job ends and when a model is added or deleted."),
        (name = "service", description = "Health, limits, versions."),
    )
)]
struct Contract;

fn resources() -> OpenApiRouter<AppState> {
    OpenApiRouter::with_openapi(Contract::openapi())
        .merge(scan_sets::router())
        .merge(uploads::router())
        .merge(jobs::router())
        .merge(models::router())
        .merge(queries::router())
        .merge(evaluation::router())
        .merge(duplicates::router())
        .merge(standards::router())
        .merge(bin::router())
        .merge(keys::router())
        .merge(session::router())
        .merge(audit::router())
        .merge(webhooks::router())
        .merge(meta::router())
        .merge(metrics::router())
}

/// The contract, made from the routes that are served.
pub(super) fn contract() -> utoipa::openapi::OpenApi {
    let mut document = resources().into_openapi();
    access::tell(&mut document);
    document
}

/// The contract as YAML.
pub fn openapi_yaml() -> Result<String, OpenApiError> {
    contract().to_yaml().map_err(|error| OpenApiError(error.to_string()))
}

/// The contract as a service tells it that is served below a path.
fn served_contract(base: &BasePath) -> utoipa::openapi::OpenApi {
    let mut document = contract();
    if !base.as_str().is_empty() {
        document.servers = Some(vec![utoipa::openapi::Server::new(base.as_str())]);
    }
    document
}

/// The contract could not be written.
#[derive(Debug, thiserror::Error)]
#[error("the contract can't be written: {0}")]
pub struct OpenApiError(String);

/// Why there is no router.
#[derive(Debug, thiserror::Error)]
pub enum RouterError {
    /// The contract can't be made.
    #[error(transparent)]
    Contract(#[from] OpenApiError),
    /// A name that is allowed makes no origin of pages.
    #[error("--host: {0}")]
    Host(#[from] tower_http::csrf::ConfigError),
}

/// The whole service.
pub fn router(state: AppState) -> Result<Router, RouterError> {
    let served = served_contract(&state.context.config.base_path);
    let yaml = served.to_yaml().map_err(|error| OpenApiError(error.to_string()))?;
    let contract = move || {
        let yaml = yaml.clone();
        async move { ([(header::CONTENT_TYPE, "application/yaml")], yaml) }
    };
    let json = served.to_json().map_err(|error| OpenApiError(error.to_string()))?;
    let contract_as_json = move || {
        let json = json.clone();
        async move { ([(header::CONTENT_TYPE, "application/json")], json) }
    };
    let is_api = state.context.config.roles.api;
    let served = if is_api { resources() } else { OpenApiRouter::new().merge(meta::health()).merge(metrics::router()) };
    let (mut router, _) = served.split_for_parts();
    if is_api {
        router = router
            .route("/openapi.yaml", get(contract))
            .route("/openapi.json", get(contract_as_json))
            .merge(page::routes());
    }
    let config = &state.context.config;
    let searching = (config.roles.search && config.is_shared()).then(|| searching::router(&state));
    let proxies: Arc<[Network]> = state.context.config.trusted_proxies.clone().into();
    let base = state.context.config.base_path.clone();
    let traces = state.context.traces.clone();
    let span = move |request: &Request| request_span(request, traces.as_ref());
    let outside = ServiceBuilder::new()
        .map_request(without_request_id)
        .set_request_id(REQUEST_ID, NewRequestId)
        .layer(from_fn_with_state(proxies, forwarded::noted))
        .layer(TraceLayer::new_for_http().make_span_with(span).on_request(()).on_response(()).on_failure(()))
        .layer(from_fn(access_log::logged))
        .layer(from_fn_with_state(state.requests.clone(), metrics::metered))
        .layer(from_fn(headers::said))
        .propagate_request_id(REQUEST_ID)
        .map_response(distrusted)
        .layer(CatchPanicLayer::custom(panicked));
    let origins = &state.context.config.cors_origins;
    let cors = (!origins.is_empty()).then(|| headers::cors(origins));
    let admitted = ServiceBuilder::new()
        .layer(from_fn_with_state(state.clone(), body::paced))
        .layer(from_fn_with_state(state.hosts.clone(), hosts::known_host))
        // preflights bring no key: what they may is answered before
        .option_layer(cors)
        .layer(state.hosts.same_origin(origins)?)
        .layer(from_fn_with_state(state.clone(), access::permitted));
    let router = router
        .fallback(not_found)
        .method_not_allowed_fallback(method_not_allowed)
        .with_state(state)
        // how much of a body is read is for each call to say
        .layer(DefaultBodyLimit::disable())
        .layer(from_fn(encoding::unpacked))
        .layer(admitted);
    let router = searching.into_iter().fold(router, Router::merge).layer(outside);
    Ok(base::below(base, router))
}

/// What says nothing of itself is not trusted by browsers.
fn distrusted<B>(mut response: axum::http::Response<B>) -> axum::http::Response<B> {
    for (name, value) in page::distrust() {
        response.headers_mut().entry(name).or_insert(value);
    }
    response
}

/// Ids of requests are ours: what a client sends could be anything.
fn without_request_id(mut request: Request) -> Request {
    request.headers_mut().remove(REQUEST_ID);
    request
}

/// A new id for each request.
#[derive(Clone, Copy)]
struct NewRequestId;

impl MakeRequestId for NewRequestId {
    fn make_request_id<B>(&mut self, _request: &axum::http::Request<B>) -> Option<RequestId> {
        HeaderValue::try_from(uuid::Uuid::now_v7().to_string()).ok().map(RequestId::new)
    }
}

fn request_span(request: &Request, traces: &dyn Traces) -> tracing::Span {
    let id = request.headers().get(REQUEST_ID).and_then(|id| id.to_str().ok()).unwrap_or_default();
    // the path alone: a query may hold what does not belong into logs
    let client = Client::of(request).map(|client| tracing::field::display(client.address));
    let span = tracing::info_span!("request", id, client, method = %request.method(), path = request.uri().path());
    if let Some(Ok(traceparent)) = request.headers().get("traceparent").map(HeaderValue::to_str) {
        traces.go_on(&span, traceparent);
    }
    span
}

async fn not_found(request: Request) -> Problem {
    let detail = format!("there is nothing at {}", request.uri().path());
    Problem::new(Code::NotFound, detail, "/openapi.yaml lists what there is")
}

async fn method_not_allowed(request: Request) -> Problem {
    let detail = format!("{} does not know {}", request.uri().path(), request.method());
    Problem::new(Code::MethodNotAllowed, detail, "/openapi.yaml lists the methods of each resource")
}

fn panicked(payload: Box<dyn Any + Send + 'static>) -> Response {
    Problem::internal(format!("panic in a handler: {}", panic_message(&*payload))).into_response()
}
