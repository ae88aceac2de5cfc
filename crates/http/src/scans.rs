//! `/v1/scan-sets/{id}/scans/{name}`: scans one by one.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};

use super::conditions::{ConditionHeaders, Conditions, ETag};
use super::extract::Path;
use super::problem::Problem;
use super::scan_set_views::ScanView;
use super::scan_sets::{TAG, parse_id, record_of};
use super::schemas::{FileContent, ScanName};
use super::state::{AppState, deleted, uninterrupted};
use super::upload::{self, UploadedFile};
use super::{digest, names, responses};
use visage_domain::{PutScan, ScanRecord, ScanSetId, ScanSetRecord};
use visage_formats::same_name;
use visage_service::app::arrival::CheckedScan;
use visage_service::app::scan_sets;
use visage_service::storage::StagedFile;

/// What a body is held against, as the contract describes it.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only describes the header")]
struct DigestHeader {
    /// RFC 9530, sha-256 or sha-512; checked.
    #[param(
        rename = "Content-Digest",
        required = false,
        example = "sha-256=:47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=:"
    )]
    content_digest: String,
}

/// Add one scan, or replace the one of the same name.
///
/// Retryable scan by scan: after a lost connection only the scan under way has to be sent again.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/scans/{name}", tag = TAG, operation_id = "putScan",
    params(("id" = String, Path, format = "uuid", description = "The scan set."),
           ("name" = ScanName, Path, description = "The scan's file name, or its path with slashes as %2F; its ending tells the format."),
           DigestHeader, ConditionHeaders),
    request_body(content = inline(FileContent), content_type = "application/octet-stream",
                 description = "The file itself."),
    responses(
        (status = 200, description = "It replaces the scan of the same name.", body = ScanView,
         headers(("ETag" = String, description = "Changes with the content."))),
        (status = 201, description = "It is added.", body = ScanView,
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState,
        responses::TooLarge, responses::Unprocessable, responses::Other,
    )
)]
pub(super) async fn put_scan(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    let id = parse_id(&id)?;
    let name = names::scan_name(&name)?;
    check_place(&state, id, &name, &conditions).await?;
    let staged = receive(&state, &name, request).await?;
    store(state, id, name, staged, conditions).await
}

/// Receives the file of a scan, and holds it against the digests that came with it.
pub(super) async fn receive(state: &AppState, name: &str, request: Request) -> Result<StagedFile, Problem> {
    let headers = request.headers().clone();
    let (staged, digests) = upload::receive_body(state, name, request).await?;
    digest::check(&headers, name, &digests)?;
    Ok(staged)
}

/// Checks a scan that has arrived, keeps it, and answers.
pub(super) async fn store(
    state: AppState,
    id: ScanSetId,
    name: String,
    staged: StagedFile,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let checked = upload::check_scan(&state, UploadedFile { name, staged }).await?;
    uninterrupted(async move {
        let (put, scan) = keep(&state, id, checked, &conditions).await?;
        let status = match put {
            PutScan::Created => StatusCode::CREATED,
            PutScan::Replaced(_) => StatusCode::OK,
        };
        let etag = ETag::of_checksum(&scan.checksum).header()?;
        Ok((status, [etag], Json(ScanView::of(&scan))).into_response())
    })
    .await
}

/// Keeps a scan that has arrived and was checked, if the set is as the request wants it. Must run to its end.
pub(super) async fn keep(
    state: &AppState,
    set: ScanSetId,
    checked: CheckedScan,
    conditions: &Conditions,
) -> Result<(PutScan, ScanRecord), Problem> {
    let _turn = conditions.turn(state).await?;
    conditions.check(scan_tag(state, set, &checked.file.name).await?.as_ref())?;
    let scan = record_of(&checked);
    let put = scan_sets::put_scan(&state.context, set, &scan, checked.file.staged).await?;
    Ok((put, scan))
}

/// Refuses a scan that would be refused whatever is in its file: before megabytes are sent in vain.
pub(super) async fn check_place(
    state: &AppState,
    set: ScanSetId,
    name: &str,
    conditions: &Conditions,
) -> Result<(), Problem> {
    let set = state.context.database.scan_set(set).await?;
    check_name(&set, name)?;
    conditions.check(tag_in(&set, name).as_ref())
}

/// Refuses a name that is not that of a scan, but that some system takes for one.
fn check_name(set: &ScanSetRecord, name: &str) -> Result<(), Problem> {
    let names = || set.scans.iter().map(|scan| scan.name.as_str());
    let alike =
        names().find(|other| same_name(other) == same_name(name)).filter(|_| names().all(|other| other != name));
    alike.map_or(Ok(()), |other| Err(Problem::duplicate(other, name)))
}

/// The tag of the scan of this name, if the set has one.
async fn scan_tag(state: &AppState, set: ScanSetId, name: &str) -> Result<Option<ETag>, Problem> {
    Ok(tag_in(&state.context.database.scan_set(set).await?, name))
}

fn tag_in(set: &ScanSetRecord, name: &str) -> Option<ETag> {
    set.scans.iter().find(|scan| scan.name == name).map(|scan| ETag::of_checksum(&scan.checksum))
}

/// Take one scan out of a scan set.
#[utoipa::path(
    delete, path = "/v1/scan-sets/{id}/scans/{name}", tag = TAG, operation_id = "deleteScan",
    params(("id" = String, Path, format = "uuid", description = "The scan set."),
           ("name" = ScanName, Path, description = "The scan."), ConditionHeaders),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::Conflict,
              responses::OtherState, responses::Other)
)]
pub(super) async fn delete_scan(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    conditions: Conditions,
) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    deleted(async move {
        let _turn = conditions.turn(&state).await?;
        // one that is not there is a 404 below
        if let Some(etag) = scan_tag(&state, id, &name).await? {
            conditions.check(Some(&etag))?;
        }
        Ok(scan_sets::delete_scan(&state.context, id, &name).await?)
    })
    .await
}
