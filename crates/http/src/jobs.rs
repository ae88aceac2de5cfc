//! `/v1/jobs`: asynchronous registration.

use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use bytes::Bytes;
use serde::Deserialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bin::DeletionQuery;
use super::conditions::{ConditionHeaders, Conditions};
use super::extract::{
    FORM, IdempotencyHeader, IdempotencyKey, Path, Query, is_json, media_type, parse_json, read_json, whole_numbers,
    wrong_media_type,
};
use super::idempotency::{Attempt, Created};
use super::job_views::{JobList, JobView, NewJobBody, NewJobForm};
use super::problem::{Code, Problem};
use super::scan_sets::{form_rules, from_form, parse_id as parse_scan_set_id};
use super::state::{AppState, deleted, uninterrupted};
use super::upload;
use super::{cursor, events, extract, hint_views, job_views, models, names, responses};
use visage_domain::options::{Declared, Options};
use visage_domain::{
    JobFilter, JobId, JobKind, JobRecord, JobStatus, NewJob, NewScanSet, NewSurfaceJob, PoseFile, ScanRecord,
};
use visage_service::app::looks::{self, Look};
use visage_service::app::models::base_for;
use visage_service::app::orders;
use visage_service::app::scan_sets::ReceivedScans;
use visage_service::jobs::admission;
use visage_service::jobs::memory::Budget;
use visage_service::storage::DatabaseError;

pub(super) const TAG: &str = "jobs";
const PARTS: &[&str] = &["poses", "options", "hints", "label", "name", "unit"];
/// The longest that `wait` may ask for.
const LONGEST_WAIT: u64 = 60;

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(create_from_form))
        .routes(routes!(get_one, delete))
        .routes(routes!(cancel))
        .routes(routes!(retry))
        .routes(routes!(events::events))
}

pub(super) fn parse_id(text: &str) -> Result<JobId, Problem> {
    JobId::parse(text)
        .ok_or_else(|| DatabaseError::NotFound { kind: "job", id: text.chars().take(64).collect() }.into())
}

/// A job as it stands now.
pub(super) async fn look_up(state: &AppState, id: JobId) -> Result<JobRecord, Problem> {
    Ok(orders::look_up(&state.context, id).await?)
}

/// The same, for many who wait.
pub(super) async fn look_at(state: &AppState, id: JobId) -> Result<Arc<Look>, Problem> {
    Ok(looks::look_at(&state.context, id).await?)
}

/// What is sent of it.
pub(super) fn shown(look: &Look) -> Result<Bytes, Problem> {
    look.shown(|job| serde_json::to_vec(&JobView::of(job)).map_err(Problem::internal))
}

/// What a request wants done.
struct Order {
    job: NewJob,
    /// A scan set that comes with it, and the files of that.
    upload: Option<(NewScanSet, ReceivedScans)>,
}

/// Register a scan set.
///
/// Accepted (202) only after it is durable. Refused at once when the scan set has fewer than two scans. Scans
/// without an initial pose are placed by their surface. With `base_model_id`, scans that the model has no pose for are
/// added to it. With `{"kind": "evaluate"}` the stored models are judged against all standards and old signatures are
/// made anew; where such a job waits already, it is the answer. With `{"kind": "surface", "model_id": ...}` the points of a
/// stored model get a mesh, as a model of its own without a signature. A form as for `POST /v1/jobs/upload` is taken here too.
#[utoipa::path(
    post, path = "/v1/jobs", tag = TAG, operation_id = "createJob",
    params(IdempotencyHeader),
    request_body(content = NewJobBody, example = json!({
        "scan_set_id": "0199c6a0-6d5b-7a35-9d2c-6f3b8d1e4a70", "options": {"threads": 2}, "label": "face",
    })),
    responses(
        (status = 202, description = "The job is queued.", body = JobView,
         headers(("Location" = String, description = "The address of the job."),
                 ("Retry-After" = u64, description = "Seconds until a look at it is worth while."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::TooLarge,
        responses::WrongType, responses::Unprocessable, responses::QueueFull, responses::Other,
    )
)]
async fn create(
    State(state): State<AppState>,
    IdempotencyKey(key): IdempotencyKey,
    request: Request,
) -> Result<Created, Problem> {
    let found = media_type(request.headers());
    if found == FORM {
        return register_form(state, key, request).await;
    }
    let mut attempt = begin(&state, key)?;
    if !is_json(&found) {
        return Err(wrong_media_type(&found, "application/json, or multipart/form-data with parts `scans`"));
    }
    let (body, bytes) = read_json::<NewJobBody>(&state, request).await?;
    if let Some(answer) = attempt.known(&state, || blake3::hash(&bytes).to_hex().to_string()).await? {
        return Ok(answer);
    }
    match body.kind {
        JobKind::Evaluate => return evaluate(state, attempt, body).await,
        JobKind::Surface => return surface(state, attempt, body).await,
        JobKind::Register => {}
    }
    let order = order_of_json(&state, body).await?;
    accept(state, attempt, order).await
}

/// Store scans and poses and register them, in one form.
///
/// As `POST /v1/scan-sets/upload` and `POST /v1/jobs` in one call: either all of it is stored and queued or nothing.
#[utoipa::path(
    post, path = "/v1/jobs/upload", tag = TAG, operation_id = "uploadJob",
    params(IdempotencyHeader),
    request_body(content = NewJobForm, content_type = "multipart/form-data"),
    responses(
        (status = 202, description = "The job is queued.", body = JobView,
         headers(("Location" = String, description = "The address of the job."),
                 ("Retry-After" = u64, description = "Seconds until a look at it is worth while."))),
        responses::BadRequest, responses::Stalled, responses::Conflict, responses::TooLarge, responses::WrongType,
        responses::Unprocessable, responses::QueueFull, responses::Other,
    )
)]
async fn create_from_form(
    State(state): State<AppState>,
    IdempotencyKey(key): IdempotencyKey,
    request: Request,
) -> Result<Created, Problem> {
    match media_type(request.headers()).as_str() {
        FORM => register_form(state, key, request).await,
        found => Err(wrong_media_type(found, "multipart/form-data with parts `scans`")),
    }
}

/// A repeated request is known at either address.
fn begin(state: &AppState, key: Option<String>) -> Result<Attempt, Problem> {
    Attempt::begin(state, "POST /v1/jobs", key.as_deref())
}

async fn register_form(state: AppState, key: Option<String>, request: Request) -> Result<Created, Problem> {
    let mut attempt = begin(&state, key)?;
    let form = upload::read_form(&state, request, &form_rules(&state, PARTS)).await?;
    if let Some(answer) = attempt.known(&state, || form.hash()).await? {
        return Ok(answer);
    }
    let order = order_of_form(&state, form).await?;
    accept(state, attempt, order).await
}

/// Queues a registration.
async fn accept(state: AppState, attempt: Attempt, order: Order) -> Result<Created, Problem> {
    let view = JobView::of_new(&order.job);
    let created = Created::new(StatusCode::ACCEPTED, job_views::address(order.job.id), &view)?.retry_after(1);
    let replay = attempt.replay(&created, order.job.id.to_string());
    uninterrupted(async move {
        let _attempt = attempt;
        let Order { job, upload } = order;
        Ok(orders::register(&state.context, &job, upload, replay.as_ref()).await?)
    })
    .await?;
    Ok(created)
}

/// Queues an evaluation; answers with the one that waits, if one does already.
async fn evaluate(state: AppState, attempt: Attempt, body: NewJobBody) -> Result<Created, Problem> {
    let NewJobBody { kind: _, scan_set_id, base_model_id, model_id, options, hints, label } = body;
    let has_model = base_model_id.is_some() || model_id.is_some();
    if scan_set_id.is_some() || has_model || options.is_some() || hints.is_some() || label.is_some() {
        let detail = "an evaluation works on all stored models and has no options";
        return Err(Problem::new(Code::InvalidField, detail, "send {\"kind\": \"evaluate\"} alone"));
    }
    uninterrupted(async move {
        let answer = |job: &JobRecord| -> Result<Created, Problem> {
            let created = Created::new(StatusCode::ACCEPTED, job_views::address(job.id), &JobView::of(job))?;
            Ok(created.retry_after(1))
        };
        let replay =
            |job: &JobRecord| answer(job).ok().and_then(|created| attempt.replay(&created, job.id.to_string()));
        answer(&orders::evaluate(&state.context, &replay).await?)
    })
    .await
}

/// Queues a job that gives a model a surface.
async fn surface(state: AppState, attempt: Attempt, body: NewJobBody) -> Result<Created, Problem> {
    let NewJobBody { kind: _, scan_set_id, base_model_id, model_id, options, hints, label } = body;
    if scan_set_id.is_some() || base_model_id.is_some() || hints.is_some() {
        let detail = "a surface is made of the points of a model, not of scans";
        return Err(Problem::new(Code::InvalidField, detail, "send model_id, and options and label if wanted"));
    }
    let model_id = model_id.ok_or_else(|| {
        let hint = "send {\"kind\": \"surface\", \"model_id\": \"...\"}";
        Problem::new(Code::InvalidField, "a job of kind surface needs a model_id", hint)
    })?;
    let model = state.context.database.model(models::parse_id(&model_id)?).await?;
    let options = options.map(options_of).transpose()?.unwrap_or_default();
    let label = label.map(|label| names::text("label", &label)).transpose()?;
    Budget(state.context.config.job_memory_bytes).admit(model.points)?;
    let job = NewSurfaceJob { id: JobId::new(), model_id: model.id, label, options };
    let view = JobView::of_new_surface(&job);
    let created = Created::new(StatusCode::ACCEPTED, job_views::address(job.id), &view)?.retry_after(1);
    let replay = attempt.replay(&created, job.id.to_string());
    uninterrupted(async move {
        let _attempt = attempt;
        Ok(orders::surface(&state.context, &job, replay.as_ref()).await?)
    })
    .await?;
    Ok(created)
}

async fn order_of_json(state: &AppState, body: NewJobBody) -> Result<Order, Problem> {
    if body.model_id.is_some() {
        let hint = "send base_model_id to add scans to a model, or kind surface to make a mesh of it";
        return Err(Problem::new(Code::InvalidField, "a registration has no model_id", hint));
    }
    let options = body.options.map(options_of).transpose()?.unwrap_or_default();
    let hints = body.hints.map(hint_views::parse).transpose()?.unwrap_or_default();
    let label = body.label.map(|label| names::text("label", &label)).transpose()?;
    let scan_set_id = body.scan_set_id.ok_or_else(|| {
        let detail = "a registration needs a scan_set_id";
        Problem::new(Code::InvalidField, detail, "send {\"scan_set_id\": \"...\"}, or {\"kind\": \"evaluate\"}")
    })?;
    let set = state.context.database.scan_set(parse_scan_set_id(&scan_set_id)?).await?;
    let base = match &body.base_model_id {
        Some(id) => Some(base_for(&state.context, models::parse_id(id)?, set.id).await?),
        None => None,
    };
    let job = NewJob { id: JobId::new(), scan_set_id: set.id, label, options, base, hints };
    admit(state, &set.scans, set.poses.as_ref(), &job)?;
    Ok(Order { job, upload: None })
}

fn options_of(mut value: serde_json::Value) -> Result<Options, Problem> {
    whole_numbers(&mut value);
    Ok(Options::parse(value)?)
}

async fn order_of_form(state: &AppState, form: upload::Form) -> Result<Order, Problem> {
    let options: Options = match form.text("options")? {
        Some(text) => options_of(parse_json("the part options", text.as_bytes())?)?,
        None => Options::default(),
    };
    let hints = form.text("hints")?.map(|text| hint_views::parse(parse_json("the part hints", text.as_bytes())?));
    let hints = hints.transpose()?.unwrap_or_default();
    let label = form.text("label")?.map(|label| names::text("label", label)).transpose()?;
    let (set, files) = from_form(state, form).await?;
    let job = NewJob { id: JobId::new(), scan_set_id: set.id, label, options, base: None, hints };
    admit(state, &set.scans, set.poses.as_ref(), &job)?;
    Ok(Order { job, upload: Some((set, files)) })
}

fn admit(state: &AppState, scans: &[ScanRecord], poses: Option<&PoseFile>, job: &NewJob) -> Result<(), Problem> {
    Ok(admission::admit_job(scans, poses, job, Budget(state.context.config.job_memory_bytes))?)
}

/// Which jobs to list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Only those of this status.
    status: Option<JobStatus>,
    /// Only those of this scan set.
    #[param(format = "uuid")]
    scan_set_id: Option<String>,
    /// At most so many items (1 to 100, 20 if not given).
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<usize>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
}

/// List jobs, newest first.
#[utoipa::path(
    get, path = "/v1/jobs", tag = TAG, operation_id = "listJobs", params(ListQuery),
    responses((status = 200, description = "A page of jobs.", body = JobList), responses::BadRequest,
              responses::NotFound, responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(query): Query<ListQuery>) -> Result<Json<JobList>, Problem> {
    let scan_set_id = query.scan_set_id.as_deref().map(parse_scan_set_id).transpose()?;
    let filter = JobFilter { status: query.status, scan_set_id };
    let list = cursor::fingerprint(&[b"jobs", format!("{filter:?}").as_bytes()]);
    let page = extract::PageQuery { limit: query.limit, cursor: query.cursor }.request(&list)?;
    let mut page = state.context.database.jobs(&filter, &page).await?;
    for job in &mut page.items {
        state.context.monitor.refresh(job);
    }
    let next_cursor = page.next_cursor(|job| cursor::after_item(&list, job.id.number()));
    Ok(Json(JobList { items: page.items.iter().map(JobView::of).collect(), next_cursor }))
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct WaitQuery {
    /// Answer only when the job has ended, or after so many seconds (at most 60).
    #[param(minimum = 0, maximum = 60)]
    wait: Option<u64>,
}

/// Look at a job, at once or at its end.
#[utoipa::path(
    get, path = "/v1/jobs/{id}", tag = TAG, operation_id = "getJob",
    params(("id" = String, Path, format = "uuid", description = "The job."), WaitQuery, ConditionHeaders),
    responses((status = 200, description = "The job.", body = JobView,
               headers(("ETag" = String, description = "Changes with the content."))),
              responses::Unchanged, responses::BadRequest, responses::NotFound, responses::OtherState,
              responses::Unprocessable, responses::Other)
)]
async fn get_one(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<WaitQuery>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let id = parse_id(&id)?;
    let wait = query.wait.unwrap_or(0);
    if wait > LONGEST_WAIT {
        let detail = format!("wait is {wait}, which is more than {LONGEST_WAIT}");
        return Err(Problem::new(Code::InvalidField, detail, "ask several times, or follow the job's events"));
    }
    let end = tokio::time::Instant::now() + Duration::from_secs(wait);
    loop {
        // the bell is armed before the look, so that nothing is missed between the two
        let mut changes = state.context.monitor.status_changes();
        let look = look_at(&state, id).await?;
        if look.job().status.is_finished() || wait == 0 || state.stop.is_cancelled() {
            return conditions.answer_with(shown(&look)?);
        }
        let news = async {
            // an error would mean that the monitor is gone, and the state holds it; of a job that runs here only the end counts
            while changes.changed().await.is_ok() && state.context.monitor.runs(id) {}
        };
        tokio::select! {
            () = news => {}
            () = state.stop.cancelled() => {}
            () = tokio::time::sleep_until(end) => {
                return conditions.answer_with(shown(look_at(&state, id).await?.as_ref())?);
            }
        }
    }
}

/// Refuses a change of a job that is not as the request wants it.
async fn check(state: &AppState, id: JobId, conditions: &Conditions) -> Result<(), Problem> {
    if conditions.any() { conditions.check_view(&JobView::of(&look_up(state, id).await?)) } else { Ok(()) }
}

/// Stop a job.
///
/// A waiting job is canceled at once, a running one within a second: look at it again, or wait for it.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/cancel", tag = TAG, operation_id = "cancelJob",
    params(("id" = String, Path, format = "uuid", description = "The job."), ConditionHeaders),
    responses((status = 202, description = "The stop is asked for.", body = JobView), responses::NotFound,
              responses::Conflict, responses::OtherState, responses::Other)
)]
async fn cancel(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<(StatusCode, Json<JobView>), Problem> {
    let id = parse_id(&id)?;
    let _turn = conditions.turn(&state).await?;
    check(&state, id, &conditions).await?;
    Ok((StatusCode::ACCEPTED, Json(JobView::of(&orders::cancel(&state.context, id).await?))))
}

/// Run a failed or canceled job again, from its beginning.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/retry", tag = TAG, operation_id = "retryJob",
    params(("id" = String, Path, format = "uuid", description = "The job."), ConditionHeaders),
    responses((status = 202, description = "The job is queued again.", body = JobView), responses::NotFound,
              responses::Conflict, responses::OtherState, responses::Unprocessable, responses::QueueFull,
              responses::Other)
)]
async fn retry(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<(StatusCode, Json<JobView>), Problem> {
    let id = parse_id(&id)?;
    let _turn = conditions.turn(&state).await?;
    check(&state, id, &conditions).await?;
    // the scan set may have changed since the job ended
    let job = state.context.database.job(id).await?;
    if let Some(set) = job.scan_set_id {
        let set = state.context.database.scan_set(set).await?;
        admit(&state, &set.scans, set.poses.as_ref(), &job.again(set.id))?;
    }
    Ok((StatusCode::ACCEPTED, Json(JobView::of(&orders::retry(&state.context, id).await?))))
}

/// Delete a finished job with the model it made.
///
/// Where there is a recycle bin both can be put back for a while, unless they are deleted `permanently`.
#[utoipa::path(
    delete, path = "/v1/jobs/{id}", tag = TAG, operation_id = "deleteJob",
    params(("id" = String, Path, format = "uuid", description = "The job."), ConditionHeaders, DeletionQuery),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::Conflict, responses::OtherState,
              responses::Other)
)]
async fn delete(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<DeletionQuery>,
    conditions: Conditions,
) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    let removal = query.removal(&state);
    deleted(async move {
        let _turn = conditions.turn(&state).await?;
        check(&state, id, &conditions).await?;
        Ok(orders::delete(&state.context, id, removal).await?)
    })
    .await
}
