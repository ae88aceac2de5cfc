//! `/metrics`: how the service is doing, in the text that Prometheus reads (OpenMetrics).
//!
//! Requests are counted as they are answered; everything else is looked up when it is asked for.

use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::Registry;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::problem::Problem;
use super::responses;
use super::state::AppState;
use visage_service::app::figures::Footprint;

type Labels = Vec<(&'static str, String)>;

/// Upper ends of the steps in which latencies are counted, in seconds.
const STEPS: [f64; 13] = [0.002, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0];
const TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(show))
}

/// What is counted as it happens.
#[derive(Debug, Clone)]
pub struct Requests {
    answered: Family<Labels, Counter>,
    seconds: Family<Labels, Histogram, fn() -> Histogram>,
}

impl Default for Requests {
    fn default() -> Self {
        let steps: fn() -> Histogram = || Histogram::new(STEPS);
        Requests { answered: Family::default(), seconds: Family::new_with_constructor(steps) }
    }
}

/// Counts each request at its answer. Labels are of closed sets: clients can't make new ones.
pub async fn metered(State(requests): State<Arc<Requests>>, request: Request, next: Next) -> Response {
    let known = [Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE, Method::OPTIONS, Method::PATCH];
    let method = if known.contains(request.method()) { request.method().as_str() } else { "other" };
    let route = request.extensions().get::<MatchedPath>().map_or("none", MatchedPath::as_str);
    let mut labels = vec![("method", method.to_owned()), ("route", route.to_owned())];
    let begin = Instant::now();
    let response = next.run(request).await;
    requests.seconds.get_or_create(&labels).observe(begin.elapsed().as_secs_f64());
    labels.push(("status", response.status().as_u16().to_string()));
    requests.answered.get_or_create(&labels).inc();
    response
}

/// Figures about requests, jobs, stages, memory, disk, index and verdicts, for Prometheus.
#[utoipa::path(
    get, path = "/metrics", tag = "service", operation_id = "metrics",
    responses((status = 200, description = "The figures.", body = String, content_type = "application/openmetrics-text"),
              responses::Other)
)]
async fn show(State(state): State<AppState>) -> Result<Response, Problem> {
    let mut text = String::new();
    encode(&mut text, &registry(&state).await?).map_err(Problem::internal)?;
    Ok(([(header::CONTENT_TYPE, TYPE)], text).into_response())
}

/// Everything there is to tell.
async fn registry(state: &AppState) -> Result<Registry, Problem> {
    let mut all = Registry::with_prefix("visage");
    let requests = &state.requests;
    all.register("http_requests", "Requests that were answered", requests.answered.clone());
    all.register("http_request_seconds", "Seconds until the answer began", requests.seconds.clone());
    let connections = *state.connections.borrow();
    gauge(&mut all, "http_connections", "Connections that are open", connections.open as f64);
    jobs(&mut all, state).await?;
    stored(&mut all, state).await?;
    process(&mut all, state).await?;
    Ok(all)
}

async fn jobs(all: &mut Registry, state: &AppState) -> Result<(), Problem> {
    let done = state.context.monitor.figures.done();
    let runs = Family::<Labels, Counter>::default();
    for ((kind, end), count) in &done.jobs {
        runs.get_or_create(&vec![("kind", kind.clone()), ("end", (*end).to_owned())]).inc_by(*count);
    }
    all.register("job_runs", "Runs of jobs since the start, by how they ended", runs);
    let stages = Family::<Labels, Counter>::default();
    let seconds = Family::<Labels, Counter<f64, AtomicU64>>::default();
    for (stage, (count, spent)) in &done.stages {
        let labels = vec![("stage", stage.clone())];
        stages.get_or_create(&labels).inc_by(*count);
        seconds.get_or_create(&labels).inc_by(*spent);
    }
    let messages = Family::<Labels, Counter>::default();
    for (end, count) in &done.messages {
        messages.get_or_create(&vec![("end", (*end).to_owned())]).inc_by(*count);
    }
    all.register(
        "webhook_attempts",
        "Attempts to deliver messages to webhooks since the start, by what came of them",
        messages,
    );
    let left_behind = state.context.monitor.left_behind();
    gauge(
        all,
        "jobs_left_behind",
        "Threads that go on though their jobs have ended: they do not stop",
        left_behind as f64,
    );
    all.register("stage_runs", "Runs of jobs that came to a stage", stages);
    all.register("stage_seconds", "Seconds that runs of jobs took in a stage", seconds);
    Ok(())
}

async fn stored(all: &mut Registry, state: &AppState) -> Result<(), Problem> {
    let database = &state.context.database;
    let census = database.census().await?;
    let jobs = census
        .jobs
        .iter()
        .map(|(kind, status, count)| (vec![("kind", kind.clone()), ("status", status.clone())], *count as f64));
    gauges(all, "jobs", "Jobs that are kept, by their status; those that wait are queued", jobs);
    let verdicts = census.verdicts.iter().map(|(verdict, count)| (vec![("verdict", verdict.clone())], *count as f64));
    gauges(all, "model_verdicts", "Registered models by the verdict on them", verdicts);
    for (name, help, value) in [
        ("scan_sets", "Scan sets that are kept", census.scan_sets),
        ("scans", "Scans that are kept", census.scans),
        ("models", "Models that are kept", census.models),
        ("standards", "Standards made by users", census.standards),
        ("webhook_messages_pending", "Messages to webhooks that wait to be delivered", census.messages_pending),
        ("webhook_messages_dead", "Messages to webhooks that could not be delivered", census.messages_dead),
        ("bin_entries", "Entries of the recycle bin", census.bin_entries),
        ("file_bytes", "Bytes of all files, those in the recycle bin included", census.file_bytes),
        ("database_bytes", "Bytes of the database", census.database_bytes),
    ] {
        gauge(all, name, help, value as f64);
    }
    let backlog = database.backlog().await?;
    gauge(
        all,
        "stale_signatures",
        "Models that are not searched until a job has described them anew",
        backlog.stale_signatures as f64,
    );
    gauge(
        all,
        "missing_verdicts",
        "Pairs of a model and a standard that are not judged yet",
        backlog.missing_verdicts as f64,
    );
    let searchable = state.context.gallery.ask(visage_gallery::Gallery::len).ok();
    gauge(all, "gallery_ready", "1 once the gallery is loaded", f64::from(u8::from(searchable.is_some())));
    let parts = state.context.gallery.whole_parts().len();
    gauge(all, "gallery_parts", "Parts of the gallery, of 256, that this server can search", parts as f64);
    gauge(all, "gallery_models", "Models that queries search", searchable.unwrap_or(0) as f64);
    Ok(())
}

async fn process(all: &mut Registry, state: &AppState) -> Result<(), Problem> {
    let objects = state.context.objects.clone();
    let free = super::state::blocking(move || objects.free_bytes()).await?;
    let (config, taken) = (&state.context.config, Footprint::now());
    for (name, help, value) in [
        ("disk_free_bytes", "Bytes that are free where files are kept", free),
        ("memory_bytes", "Memory of this process", taken.memory_bytes),
        ("memory_peak_bytes", "The most memory that this process has held", taken.peak_memory_bytes),
        ("job_memory_limit_bytes", "Memory that all running jobs together may take", config.job_memory_bytes),
    ] {
        if let Some(value) = value {
            gauge(all, name, help, value as f64);
        }
    }
    if let Some(seconds) = taken.cpu_seconds {
        let spent = Counter::<f64, AtomicU64>::default();
        spent.inc_by(seconds);
        all.register("cpu_seconds", "Seconds that processors have worked for this process", spent);
    }
    let accepting = !state.stop.is_cancelled();
    gauge(all, "accepting", "0 once a stop was asked for", f64::from(u8::from(accepting)));
    let roles = config.roles.list().map(|role| (vec![("role", role.name().to_owned())], 1.0));
    gauges(all, "role", "What this server does", roles);
    let version = vec![("version", env!("CARGO_PKG_VERSION").to_owned())];
    gauges(all, "build", "Which version runs", std::iter::once((version, 1.0)));
    Ok(())
}

fn gauge(all: &mut Registry, name: &str, help: impl Display, value: f64) {
    let gauge = Gauge::<f64, AtomicU64>::default();
    gauge.set(value);
    all.register(name, help.to_string(), gauge);
}

fn gauges(all: &mut Registry, name: &str, help: &str, values: impl Iterator<Item = (Labels, f64)>) {
    let family = Family::<Labels, Gauge<f64, AtomicU64>>::default();
    for (labels, value) in values {
        family.get_or_create(&labels).set(value);
    }
    all.register(name, help, family);
}
