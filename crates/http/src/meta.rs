//! `/healthz`, `/readyz`, `/v1/info`: how the service is and what it offers.

use axum::Json;
use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::extract::LONGEST_KEY;
use super::option_views::{OptionInfo, infos};
use super::problem::Problem;
use super::responses;
use super::state::AppState;
use visage_domain::options::OPTIONS;
use visage_service::app::live_gallery::NotReady;
use visage_service::app::standards::MOST_STANDARDS;
use visage_service::config::Role;

const TAG: &str = "service";

/// The routes of the service itself.
pub fn router() -> OpenApiRouter<AppState> {
    health().routes(routes!(info))
}

/// Those by which it is watched.
pub fn health() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz))
}

/// A sign of life.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct Health {
    /// `ok`
    #[schema(example = "ok")]
    status: &'static str,
    /// What this server does: `api` answers requests, `worker` runs jobs.
    #[schema(example = json!(["api", "worker"]))]
    roles: Vec<&'static str>,
}

impl Health {
    fn of(state: &AppState) -> Json<Health> {
        Json(Health { status: "ok", roles: state.context.config.roles.list().map(Role::name).collect() })
    }
}

/// Whether the process answers at all.
#[utoipa::path(
    get, path = "/healthz", tag = TAG, operation_id = "health",
    responses((status = 200, description = "It does.", body = Health), responses::Other)
)]
async fn healthz(State(state): State<AppState>) -> Json<Health> {
    Health::of(&state)
}

/// Whether requests will be served: the database takes writes, the gallery is loaded, no shutdown is under way.
#[utoipa::path(
    get, path = "/readyz", tag = TAG, operation_id = "ready",
    responses((status = 200, description = "They will.", body = Health), responses::NotReady, responses::Other)
)]
async fn readyz(State(state): State<AppState>) -> Result<Json<Health>, Problem> {
    if state.stop.is_cancelled() {
        return Err(Problem::shutting_down());
    }
    state.context.database.ping().await?;
    state.context.database.check_writable().await.map_err(Problem::not_writable)?;
    let (roles, gallery) = (state.context.config.roles, &state.context.gallery);
    // a part of the index is there when it has been whole once
    let has_index = !roles.search || if roles.api { gallery.is_ready() } else { gallery.is_settled() };
    if !has_index {
        return Err(NotReady.into());
    }
    Ok(Health::of(&state))
}

/// Bounds on requests.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct LimitsView {
    /// Bytes of one request body.
    upload_bytes: u64,
    /// Bytes of one scan or model file.
    file_bytes: u64,
    /// Bytes of a JSON body.
    json_bytes: usize,
    /// Bytes of a pose file.
    pose_file_bytes: usize,
    /// Scans in one scan set.
    scans_per_set: usize,
    /// Points in one scan or model.
    points_per_scan: u64,
    /// Jobs that may wait.
    queued_jobs: usize,
    /// Worker threads of one job.
    threads_per_job: usize,
    /// Jobs that run at the same time.
    concurrent_jobs: usize,
    /// Bytes of memory that all running jobs together may take; null if that is not limited.
    job_memory_bytes: Option<u64>,
    /// Times a job is started before it counts as failed.
    attempts_per_job: u32,
    /// Requests of a key in a minute; null if that is not limited, as below.
    key_requests_per_minute: Option<u32>,
    /// Uploads of a key at the same time.
    key_uploads: Option<usize>,
    /// Jobs of a key that wait or run.
    key_queued_jobs: Option<u64>,
    /// Bytes that are kept of what a key has sent and had made.
    key_stored_bytes: Option<u64>,
    /// Days after which models are deleted; null if they are kept until somebody deletes them, as below.
    keep_models_days: Option<u32>,
    /// Days after which scan sets are deleted, with their jobs and models.
    keep_scan_sets_days: Option<u32>,
    /// Days after which entries of the audit log are deleted.
    keep_audit_days: Option<u32>,
    /// Days for which what was deleted can be put back; 0 if deleted is gone for good.
    bin_days: u32,
    /// Connections at the same time; others wait.
    connections: usize,
    /// Seconds that the head of a request may take, and that a connection may lie idle.
    head_seconds: u64,
    /// Seconds that the server waits for a body in all, plus the time that what has arrived takes at
    /// `body_bytes_per_second`.
    body_seconds: u64,
    /// The least rate of a body, bytes a second.
    body_bytes_per_second: u64,
    /// Seconds after which an upload that has come to a standstill is given up.
    upload_stall_seconds: u64,
    /// Seconds after which an answer that its client does not take is given up.
    answer_stall_seconds: u64,
    /// Seconds that a scan which comes piece by piece is waited for after its last piece.
    resumable_upload_seconds: u64,
    /// Characters of an idempotency key.
    idempotency_key_characters: usize,
    /// Standards made by users.
    standards: usize,
    /// Addresses below which scans may be fetched (`PUT /v1/scan-sets/{id}/scans/{name}/source`).
    fetch_from: Vec<String>,
}

/// Versions of what shapes the answers.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct Versions {
    /// Of visage.
    #[schema(example = "0.1.0")]
    visage: &'static str,
    /// Of the interface.
    #[schema(example = "v1")]
    api: &'static str,
    /// Of the operator that makes signatures.
    signature: u32,
    /// Of the operator that makes standards and judges models against them.
    class: u32,
}

/// How many there are.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct Load {
    /// Jobs that wait.
    queued_jobs: u64,
    /// Jobs that run.
    running_jobs: u64,
    /// Models that queries search; null while the gallery is being loaded, and where others search it.
    searchable_models: Option<usize>,
    /// Models whose signature is of another version and so is not searched, until a job has made it anew.
    stale_signatures: u64,
    /// Pairs of a model and a standard made by a user that are not judged yet.
    missing_verdicts: u64,
    /// Standards made by users.
    standards: u64,
}

/// What the service offers.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct Info {
    /// Versions.
    versions: Versions,
    /// Limits: beyond them requests are refused with 413, 422 or 429.
    limits: LimitsView,
    /// Options of a job.
    job_options: Vec<OptionInfo>,
    /// Endings of the files that are read.
    file_formats: Vec<&'static str>,
    /// Units of length.
    units: [&'static str; 5],
    /// How busy it is.
    load: Load,
}

/// Limits, versions and the options of jobs with types, ranges, defaults and explanations.
#[utoipa::path(
    get, path = "/v1/info", tag = TAG, operation_id = "info",
    responses((status = 200, description = "What the service offers.", body = Info), responses::Other)
)]
async fn info(State(state): State<AppState>) -> Result<Json<Info>, Problem> {
    state.context.settled().await?;
    let config = &state.context.config;
    let limits = &config.limits;
    let (queued_jobs, running_jobs) = state.context.database.queue_length().await?;
    let backlog = state.context.database.backlog().await?;
    Ok(Json(Info {
        versions: Versions {
            visage: env!("CARGO_PKG_VERSION"),
            api: "v1",
            signature: visage_shape::faces::Signature::VERSION,
            class: visage_shape::standards::Standard::VERSION,
        },
        limits: LimitsView {
            upload_bytes: limits.upload_bytes,
            file_bytes: limits.file_bytes,
            json_bytes: limits.text_bytes,
            pose_file_bytes: limits.pose_file_bytes,
            scans_per_set: limits.scans_per_set,
            points_per_scan: limits.points_per_scan,
            queued_jobs: limits.queued_jobs,
            threads_per_job: config.threads,
            concurrent_jobs: config.concurrent_jobs,
            job_memory_bytes: config.job_memory_bytes,
            attempts_per_job: config.queue.max_attempts,
            key_requests_per_minute: config.quotas.requests_per_minute,
            key_uploads: config.quotas.uploads,
            key_queued_jobs: config.quotas.queued_jobs,
            key_stored_bytes: config.quotas.stored_bytes,
            keep_models_days: config.retention.models,
            keep_scan_sets_days: config.retention.scan_sets,
            keep_audit_days: config.retention.audit,
            bin_days: config.retention.bin,
            connections: config.edge.connections,
            head_seconds: config.edge.head_time.as_secs(),
            body_seconds: config.edge.body_time.as_secs(),
            body_bytes_per_second: config.edge.body_rate,
            upload_stall_seconds: config.edge.body_stall.as_secs(),
            answer_stall_seconds: config.edge.answer_stall.as_secs(),
            resumable_upload_seconds: limits.upload_life.as_secs(),
            idempotency_key_characters: LONGEST_KEY,
            standards: MOST_STANDARDS,
            fetch_from: config.fetch_from.iter().map(ToString::to_string).collect(),
        },
        job_options: infos(OPTIONS),
        file_formats: visage_formats::surface_endings(),
        units: ["mm", "cm", "m", "in", "unknown"],
        load: Load {
            queued_jobs,
            running_jobs,
            searchable_models: state.context.gallery.ask(visage_gallery::Gallery::len).ok(),
            stale_signatures: backlog.stale_signatures,
            missing_verdicts: backlog.missing_verdicts,
            standards: backlog.standards,
        },
    }))
}
