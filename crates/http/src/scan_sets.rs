//! `/v1/scan-sets`: the scans of one object and their initial poses.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bin::DeletionQuery;
use super::conditions::{ConditionHeaders, Conditions};
use super::extract::{
    FORM, IdempotencyHeader, IdempotencyKey, PageQuery, Path, Query, is_json, media_type, read_json, wrong_media_type,
};
use super::idempotency::{Attempt, Created};
use super::problem::Problem;
use super::scan_set_views::{NewScanSetBody, ScanSetForm, ScanSetList, ScanSetView};
use super::state::{AppState, deleted, uninterrupted};
use super::upload::{self, Form, FormRules};
use super::{cursor, expiry, fetching, names, pictures, poses, reading_view, responses, scans};
use visage_domain::{FileId, NewScanSet, PoseFile, ScanRecord, ScanSetId, sort_naturally};
use visage_service::app::arrival::{self, CheckedScan};
use visage_service::app::scan_sets::{self, ReceivedScans};
use visage_service::jobs::admission::{self, PoseFit};
use visage_service::storage::DatabaseError;

pub(super) const TAG: &str = "scan sets";
const PARTS: &[&str] = &["poses", "name", "unit"];

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(create_from_form))
        .routes(routes!(get_one, delete))
        .routes(routes!(scans::put_scan, scans::delete_scan))
        .routes(routes!(fetching::fetch))
        .routes(routes!(poses::put_poses))
        .routes(routes!(expiry::get_expiry, expiry::put_expiry))
        .routes(routes!(poses::put_pose_file))
        .routes(routes!(pictures::get_of_set))
        .routes(routes!(pictures::get_of_scan))
}

pub(super) fn parse_id(text: &str) -> Result<ScanSetId, Problem> {
    ScanSetId::parse(text)
        .ok_or_else(|| DatabaseError::NotFound { kind: "scan set", id: text.chars().take(64).collect() }.into())
}

pub(super) fn form_rules(state: &AppState, texts: &'static [&'static str]) -> FormRules {
    FormRules { files: &["scans"], most_files: state.limits().scans_per_set, file_name: names::scans_file_name, texts }
}

/// Store a scan set that is empty yet.
///
/// Scans and poses are put into it one by one. A form as for `POST /v1/scan-sets/upload` is taken here too.
#[utoipa::path(
    post, path = "/v1/scan-sets", tag = TAG, operation_id = "createScanSet",
    params(IdempotencyHeader),
    request_body(content = NewScanSetBody, example = json!({"name": "bunny", "unit": "m"})),
    responses(
        (status = 201, description = "The scan set is stored.", body = ScanSetView,
         headers(("Location" = String, description = "The address of the scan set."))),
        responses::BadRequest, responses::Stalled, responses::Conflict, responses::TooLarge, responses::WrongType,
        responses::Unprocessable, responses::Other,
    )
)]
async fn create(
    State(state): State<AppState>,
    IdempotencyKey(key): IdempotencyKey,
    request: Request,
) -> Result<Created, Problem> {
    let found = media_type(request.headers());
    if found == FORM {
        return store_form(state, key, request).await;
    }
    let mut attempt = begin(&state, key)?;
    if !is_json(&found) {
        return Err(wrong_media_type(&found, "application/json, or multipart/form-data with parts `scans`"));
    }
    let (body, bytes) = read_json::<NewScanSetBody>(&state, request).await?;
    if let Some(answer) = attempt.known(&state, || blake3::hash(&bytes).to_hex().to_string()).await? {
        return Ok(answer);
    }
    store_new(state, attempt, body.new_set()?, Vec::new()).await
}

/// Store a scan set with its scans and poses, in one form.
///
/// The scans are streamed to disk and checked one by one: either all are kept or none. Archives are unpacked, and each scan of a
/// file that holds several is one of the set; what of an archive is not kept stands in `passed_over`.
#[utoipa::path(
    post, path = "/v1/scan-sets/upload", tag = TAG, operation_id = "uploadScanSet",
    params(IdempotencyHeader),
    request_body(content = ScanSetForm, content_type = "multipart/form-data"),
    responses(
        (status = 201, description = "The scan set is stored.", body = ScanSetView,
         headers(("Location" = String, description = "The address of the scan set."))),
        responses::BadRequest, responses::Stalled, responses::Conflict, responses::TooLarge, responses::WrongType,
        responses::Unprocessable, responses::Other,
    )
)]
async fn create_from_form(
    State(state): State<AppState>,
    IdempotencyKey(key): IdempotencyKey,
    request: Request,
) -> Result<Created, Problem> {
    match media_type(request.headers()).as_str() {
        FORM => store_form(state, key, request).await,
        found => Err(wrong_media_type(found, "multipart/form-data with parts `scans`")),
    }
}

/// A repeated request is known at either address.
fn begin(state: &AppState, key: Option<String>) -> Result<Attempt, Problem> {
    Attempt::begin(state, "POST /v1/scan-sets", key.as_deref())
}

async fn store_form(state: AppState, key: Option<String>, request: Request) -> Result<Created, Problem> {
    let mut attempt = begin(&state, key)?;
    let form = upload::read_form(&state, request, &form_rules(&state, PARTS)).await?;
    if let Some(answer) = attempt.known(&state, || form.hash()).await? {
        return Ok(answer);
    }
    let (set, files) = from_form(&state, form).await?;
    store_new(state, attempt, set, files).await
}

async fn store_new(
    state: AppState,
    attempt: Attempt,
    set: NewScanSet,
    files: ReceivedScans,
) -> Result<Created, Problem> {
    let view = ScanSetView::of_new(&set);
    let created = Created::new(StatusCode::CREATED, view.links.self_.clone(), &view)?;
    let replay = attempt.replay(&created, set.id.to_string());
    uninterrupted(async move {
        let _attempt = attempt;
        Ok(scan_sets::add(&state.context, &set, files, replay.as_ref()).await?)
    })
    .await?;
    Ok(created)
}

/// Checks a form and makes a scan set of it. The files stay where they are for now.
pub(super) async fn from_form(state: &AppState, mut form: Form) -> Result<(NewScanSet, ReceivedScans), Problem> {
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let name = form.text("name")?.map(|name| names::text("name", name)).transpose()?;
    let poses = form.texts.remove("poses").map(|part| PoseFile {
        name: part.file_name.unwrap_or_else(|| "poses".to_owned()),
        content: part.content.to_vec(),
    });
    let files = std::mem::take(&mut form.files);
    let arrival = arrival::take_in(&state.context, &state.checks, files, poses.is_some()).await?;
    let mut scans = Vec::new();
    let mut files = Vec::new();
    for checked in arrival.scans {
        names::scan_name(&checked.file.name)?;
        let record = record_of(&checked);
        files.push((record.file_id, checked.file.staged));
        scans.push(record);
    }
    sort_naturally(&mut scans);
    let poses = poses.or(arrival.poses);
    if let Some(poses) = &poses {
        let names: Vec<&str> = scans.iter().map(|scan| scan.name.as_str()).collect();
        fit_poses(&names, poses)?;
    }
    let id = ScanSetId::new();
    let name = name.unwrap_or_else(|| format!("scan set {id}"));
    Ok((NewScanSet { id, name, unit, scans, poses, passed_over: arrival.passed_over }, files))
}

/// Holds a pose file against scans; one that fits none of them is refused, unless there are no scans yet.
pub(super) fn fit_poses(names: &[&str], poses: &PoseFile) -> Result<PoseFit, Problem> {
    let fit = admission::fit_poses(names, poses).map_err(|error| Problem::unreadable_poses(&error))?;
    admission::check_fit(names, poses, &fit)?;
    Ok(fit)
}

pub(super) fn record_of(CheckedScan { file, points, dropped }: &CheckedScan) -> ScanRecord {
    ScanRecord {
        name: file.name.clone(),
        file_id: FileId::new(),
        points: *points,
        bytes: file.staged.bytes,
        checksum: file.staged.checksum.clone(),
        reading: reading_view::stored(dropped),
    }
}

/// List scan sets, newest first.
#[utoipa::path(
    get, path = "/v1/scan-sets", tag = TAG, operation_id = "listScanSets", params(PageQuery),
    responses((status = 200, description = "A page of scan sets.", body = ScanSetList), responses::BadRequest,
              responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(page): Query<PageQuery>) -> Result<Json<ScanSetList>, Problem> {
    let list = cursor::fingerprint(&[b"scan sets"]);
    let page = state.context.database.scan_sets(&page.request(&list)?).await?;
    let next_cursor = page.next_cursor(|set| cursor::after_item(&list, set.id.number()));
    Ok(Json(ScanSetList { items: page.items.iter().map(ScanSetView::of).collect(), next_cursor }))
}

/// Look at one scan set.
#[utoipa::path(
    get, path = "/v1/scan-sets/{id}", tag = TAG, operation_id = "getScanSet",
    params(("id" = String, Path, format = "uuid", description = "The scan set."), ConditionHeaders),
    responses((status = 200, description = "The scan set.", body = ScanSetView,
               headers(("ETag" = String, description = "Changes with the content."))),
              responses::Unchanged, responses::NotFound, responses::OtherState, responses::Other)
)]
async fn get_one(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    conditions.answer(&ScanSetView::of(&state.context.database.scan_set(parse_id(&id)?).await?))
}

/// Delete a scan set with everything derived from it: jobs, models, files, signatures.
///
/// Where there is a recycle bin all of it can be put back for a while, unless it is deleted `permanently`. What has arrived of files that
/// come piece by piece is given up.
#[utoipa::path(
    delete, path = "/v1/scan-sets/{id}", tag = TAG, operation_id = "deleteScanSet",
    params(("id" = String, Path, format = "uuid", description = "The scan set."), ConditionHeaders, DeletionQuery),
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
        if conditions.any() {
            conditions.check_view(&ScanSetView::of(&state.context.database.scan_set(id).await?))?;
        }
        Ok(scan_sets::delete(&state.context, id, removal).await?)
    })
    .await
}
