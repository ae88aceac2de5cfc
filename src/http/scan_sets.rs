//! `/v1/scan-sets`: the scans of one object and their initial poses.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::read_body;
use super::conditions::{Conditions, ETag};
use super::extract::{IdempotencyKey, PageQuery, Path, Query, is_json, media_type, read_json, wrong_media_type};
use super::idempotency::{Attempt, Created};
use super::problem::{Code, Problem};
use super::scan_set_views::{NewScanSetBody, PosesView, ScanSetForm, ScanSetList, ScanSetView, ScanView};
use super::state::{AppState, blocking, deleted, forget, uninterrupted};
use super::upload::{self, CheckedScan, Form, FormRules, UploadedFile};
use super::{cursor, digest, names, reading_view, responses};
use crate::jobs::admission::{self, PoseFit};
use crate::store::{
    FileId, NewScanSet, PoseFile, PutScan, ScanRecord, ScanSetId, ScanSetRecord, StoreError, sort_naturally,
};

const TAG: &str = "scan sets";
const PARTS: &[&str] = &["poses", "name", "unit"];

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(get_one, delete))
        .routes(routes!(put_scan, delete_scan))
        .routes(routes!(put_poses))
}

pub(super) fn parse_id(text: &str) -> Result<ScanSetId, Problem> {
    ScanSetId::parse(text)
        .ok_or_else(|| StoreError::NotFound { kind: "scan set", id: text.chars().take(64).collect() }.into())
}

pub(super) fn form_rules(state: &AppState, texts: &'static [&'static str]) -> FormRules {
    FormRules { files: &["scans"], most_files: state.limits().scans_per_set, texts }
}

/// Store a scan set, with its scans and poses or empty.
///
/// As a form, the scans are streamed to disk and checked one by one: either all are kept or none.
#[utoipa::path(
    post, path = "/v1/scan-sets", tag = TAG, operation_id = "createScanSet",
    params(("Idempotency-Key" = Option<String>, Header, description = "Makes a repeated request harmless.")),
    request_body(content((ScanSetForm = "multipart/form-data"), (NewScanSetBody = "application/json"))),
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
    let mut attempt = Attempt::begin(&state, "POST /v1/scan-sets", key.as_deref())?;
    let found = media_type(request.headers());
    let (set, files) = if found == "multipart/form-data" {
        let form = upload::read_form(&state, request, &form_rules(&state, PARTS)).await?;
        if let Some(answer) = attempt.known(&state, || form.hash()).await? {
            return Ok(answer);
        }
        from_form(&state, form).await?
    } else if is_json(&found) {
        let (body, bytes) = read_json::<NewScanSetBody>(&state, request).await?;
        if let Some(answer) = attempt.known(&state, || blake3::hash(&bytes).to_hex().to_string()).await? {
            return Ok(answer);
        }
        (body.new_set()?, Vec::new())
    } else {
        return Err(wrong_media_type(&found, "multipart/form-data with parts `scans`, or application/json"));
    };
    let view = ScanSetView::of_new(&set);
    let created = Created::new(StatusCode::CREATED, view.links.self_.clone(), &view)?;
    let replay = attempt.replay(&created, set.id.to_string());
    uninterrupted(async move {
        let _attempt = attempt;
        keep_files(&state, set.id, files).await?;
        let stored = state.shop.store.create_scan_set(&set, replay.as_ref()).await;
        undo_unless_stored(&state, set.id, stored).await
    })
    .await?;
    Ok(created)
}

/// Checks a form and makes a scan set of it. The files stay where they are for now.
pub(super) async fn from_form(
    state: &AppState,
    mut form: Form,
) -> Result<(NewScanSet, Vec<(FileId, UploadedFile)>), Problem> {
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let name = form.text("name")?.map(|name| names::text("name", name)).transpose()?;
    let poses = form.texts.remove("poses").map(|part| PoseFile {
        name: part.file_name.unwrap_or_else(|| "poses".to_owned()),
        content: part.content.to_vec(),
    });
    if let Some(poses) = &poses {
        let names: Vec<&str> = form.files.iter().map(|file| file.name.as_str()).collect();
        fit_poses(&names, poses)?;
    }
    let mut scans = Vec::new();
    let mut files = Vec::new();
    for checked in upload::check_scans(state, std::mem::take(&mut form.files)).await? {
        let record = record_of(&checked);
        files.push((record.file_id, checked.file));
        scans.push(record);
    }
    sort_naturally(&mut scans);
    let id = ScanSetId::new();
    Ok((NewScanSet { id, name: name.unwrap_or_else(|| format!("scan set {id}")), unit, scans, poses }, files))
}

/// Holds a pose file against scans; one that fits none of them is refused, unless there are no scans yet.
fn fit_poses(names: &[&str], poses: &PoseFile) -> Result<PoseFit, Problem> {
    let fit = admission::fit_poses(names, poses).map_err(|error| Problem::unreadable_poses(&error))?;
    admission::check_fit(names, poses, &fit)?;
    Ok(fit)
}

fn record_of(CheckedScan { file, points, dropped }: &CheckedScan) -> ScanRecord {
    ScanRecord {
        name: file.name.clone(),
        file_id: FileId::new(),
        points: *points,
        bytes: file.staged.bytes,
        checksum: file.staged.checksum.clone(),
        reading: reading_view::stored(dropped),
    }
}

/// Moves received scans to where they belong.
pub(super) async fn keep_files(
    state: &AppState,
    set: ScanSetId,
    files: Vec<(FileId, UploadedFile)>,
) -> Result<(), Problem> {
    let blobs = state.shop.blobs.clone();
    blocking(move || -> Result<(), Problem> {
        for (id, file) in &files {
            blobs.keep_scan(&file.staged, set, *id)?;
        }
        Ok(())
    })
    .await?
}

/// Removes the files of a new scan set whose rows were refused.
pub(super) async fn undo_unless_stored(
    state: &AppState,
    set: ScanSetId,
    stored: Result<(), StoreError>,
) -> Result<(), Problem> {
    match stored {
        Ok(()) => Ok(()),
        // whether a failed commit took place is not known: the sweep at the next start will tell
        Err(error @ StoreError::Database(_)) => Err(error.into()),
        Err(refused) => {
            let blobs = state.shop.blobs.clone();
            blocking(move || blobs.remove_scan_set(set)).await??;
            Err(refused.into())
        }
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
    let page = state.shop.store.scan_sets(&page.request(&list)?).await?;
    let next_cursor = page.next_cursor(|set| cursor::after_item(&list, set.id.number()));
    Ok(Json(ScanSetList { items: page.items.iter().map(ScanSetView::of).collect(), next_cursor }))
}

/// Look at one scan set.
#[utoipa::path(
    get, path = "/v1/scan-sets/{id}", tag = TAG, operation_id = "getScanSet",
    params(("id" = String, Path, description = "The scan set.")),
    responses((status = 200, description = "The scan set.", body = ScanSetView), responses::NotFound,
              responses::OtherState, responses::Other)
)]
async fn get_one(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    conditions.answer(&ScanSetView::of(&state.shop.store.scan_set(parse_id(&id)?).await?))
}

/// Delete a scan set with everything derived from it: jobs, models, files, signatures.
#[utoipa::path(
    delete, path = "/v1/scan-sets/{id}", tag = TAG, operation_id = "deleteScanSet",
    params(("id" = String, Path, description = "The scan set.")),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::Conflict,
              responses::OtherState, responses::Other)
)]
async fn delete(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    deleted(async move {
        let _turn = conditions.turn(&state).await;
        if conditions.any() {
            conditions.check_view(&ScanSetView::of(&state.shop.store.scan_set(id).await?))?;
        }
        let models = state.shop.store.delete_scan_set(id).await?;
        state.shop.board.announce_change();
        // whichever fails, the other is done
        let of_models = forget(&state, models).await;
        let blobs = state.shop.blobs.clone();
        blocking(move || blobs.remove_scan_set(id)).await??;
        of_models
    })
    .await
}

/// Add one scan, or replace the one of the same name.
///
/// Retryable scan by scan: after a lost connection only the scan under way has to be sent again.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/scans/{name}", tag = TAG, operation_id = "putScan",
    params(("id" = String, Path, description = "The scan set."),
           ("name" = String, Path, description = "The scan's file name; its ending tells the format.", example = "bun045.ply"),
           ("Content-Digest" = Option<String>, Header, description = "RFC 9530, sha-256 or sha-512; checked.")),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "The file itself."),
    responses(
        (status = 200, description = "It replaces the scan of the same name.", body = ScanView),
        (status = 201, description = "It is added.", body = ScanView),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState,
        responses::TooLarge, responses::Unprocessable, responses::Other,
    )
)]
async fn put_scan(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    let id = parse_id(&id)?;
    let name = names::surface_file_name(&name)?;
    // before megabytes are sent in vain
    conditions.check(scan_tag(&state, id, &name).await?.as_ref())?;
    let headers = request.headers().clone();
    let (staged, digests) = upload::receive_body(&state, &name, request).await?;
    digest::check(&headers, &name, &digests)?;
    let mut checked = upload::check_scans(&state, vec![UploadedFile { name, staged }]).await?;
    let checked = checked.pop().ok_or_else(|| Problem::internal("a checked scan vanished"))?;
    uninterrupted(async move {
        let _turn = conditions.turn(&state).await;
        conditions.check(scan_tag(&state, id, &checked.file.name).await?.as_ref())?;
        let scan = record_of(&checked);
        keep_files(&state, id, vec![(scan.file_id, checked.file)]).await?;
        let put = state.shop.store.put_scan(id, &scan, state.limits().scans_per_set).await;
        let (unused, status) = match &put {
            Ok(PutScan::Created) => (None, StatusCode::CREATED),
            Ok(PutScan::Replaced(old)) => (Some(*old), StatusCode::OK),
            Err(_) => (Some(scan.file_id), StatusCode::INTERNAL_SERVER_ERROR),
        };
        if let Some(file) = unused {
            let blobs = state.shop.blobs.clone();
            blocking(move || blobs.remove_scan(id, file)).await??;
        }
        put?;
        let etag = ETag::of_checksum(&scan.checksum).header()?;
        Ok((status, [etag], Json(ScanView::of(&scan))).into_response())
    })
    .await
}

/// The tag of the scan of this name, if the set has one.
async fn scan_tag(state: &AppState, set: ScanSetId, name: &str) -> Result<Option<ETag>, Problem> {
    let set = state.shop.store.scan_set(set).await?;
    Ok(set.scans.iter().find(|scan| scan.name == name).map(|scan| ETag::of_checksum(&scan.checksum)))
}

/// Take one scan out of a scan set.
#[utoipa::path(
    delete, path = "/v1/scan-sets/{id}/scans/{name}", tag = TAG, operation_id = "deleteScan",
    params(("id" = String, Path, description = "The scan set."), ("name" = String, Path, description = "The scan.")),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::Conflict,
              responses::OtherState, responses::Other)
)]
async fn delete_scan(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    conditions: Conditions,
) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    deleted(async move {
        let _turn = conditions.turn(&state).await;
        // one that is not there is a 404 below
        if let Some(etag) = scan_tag(&state, id, &name).await? {
            conditions.check(Some(&etag))?;
        }
        let file = state.shop.store.delete_scan(id, &name).await?;
        let blobs = state.shop.blobs.clone();
        Ok(blocking(move || blobs.remove_scan(id, file)).await??)
    })
    .await
}

/// Set the initial poses of a scan set.
///
/// A Stanford `.conf`, JSON `{"scan name": 4x4}` or `{"poses": {...}}`, or text blocks of a name and 4 rows. The
/// format is told by the content. A pose maps its scan into the world frame; matrices are row-major.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/poses", tag = TAG, operation_id = "putPoses",
    params(("id" = String, Path, description = "The scan set.")),
    request_body(content((String = "text/plain"), (serde_json::Value = "application/json")), description = "The pose file."),
    responses(
        (status = 200, description = "The poses are stored.", body = PosesView),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState,
        responses::TooLarge, responses::Unprocessable, responses::Other,
    )
)]
async fn put_poses(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    let id = parse_id(&id)?;
    // before all of it is sent in vain
    conditions.check(poses_tag(&state.shop.store.scan_set(id).await?).as_ref())?;
    let name = if is_json(&media_type(request.headers())) { "poses.json" } else { "poses" };
    let content = read_body(&state, request, state.limits().pose_file_bytes).await?.to_vec();
    if content.is_empty() {
        let hint = "send a Stanford .conf, JSON {\"scan name\": 4x4}, or text blocks of a name and 4 rows";
        return Err(Problem::new(Code::UnreadablePoses, "the pose file is empty", hint));
    }
    let poses = PoseFile { name: name.to_owned(), content };
    let _turn = conditions.turn(&state).await;
    let set = state.shop.store.scan_set(id).await?;
    conditions.check(poses_tag(&set).as_ref())?;
    let names: Vec<&str> = set.scans.iter().map(|scan| scan.name.as_str()).collect();
    let fit = fit_poses(&names, &poses)?;
    state.shop.store.put_poses(id, &poses).await?;
    let etag = ETag::of_bytes(&poses.content).header()?;
    Ok(([etag], Json(PosesView::of(&poses.name, &fit))).into_response())
}

/// The tag of a set's pose file, if it has one.
fn poses_tag(set: &ScanSetRecord) -> Option<ETag> {
    set.poses.as_ref().map(|poses| ETag::of_bytes(&poses.content))
}
