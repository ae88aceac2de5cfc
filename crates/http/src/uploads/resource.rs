//! Uploads are begun, listed, looked at and given up.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::{parse_id, record, tus};
use crate::conditions::{ConditionHeaders, Conditions};
use crate::extract::Path;
use crate::problem::{Code, Problem};
use crate::scan_sets::{self, TAG};
use crate::state::{AppState, deleted, uninterrupted};
use crate::{names, responses, scans};
use visage_domain::{UploadId, UploadRecord};
use visage_service::app::uploads;

/// A file that comes piece by piece.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Upload)]
pub(super) struct UploadView {
    /// The upload's id.
    #[schema(format = "uuid")]
    id: String,
    /// The scan set that it is for.
    #[schema(format = "uuid")]
    scan_set_id: String,
    /// The name of the scan.
    #[schema(example = "bun045.ply")]
    name: String,
    /// Bytes of the whole file.
    bytes: u64,
    /// Bytes that have arrived and need not be sent again.
    offset: u64,
    /// What the whole file is held against at its end, as `Content-Digest` has it; null if its sender has not said it.
    digest: Option<String>,
    /// When it is given up if nothing more comes (UTC, RFC 3339).
    expires_at: String,
    /// Where its pieces go.
    #[schema(example = "/v1/uploads/01981c2e-8f4e-7bb0-a3c9-0242ac120002")]
    href: String,
}

/// The uploads of a set that are not done.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = UploadList)]
pub(super) struct UploadList {
    /// Oldest first.
    items: Vec<UploadView>,
}

impl UploadView {
    fn of(upload: UploadRecord, offset: u64) -> UploadView {
        UploadView {
            href: format!("/v1/uploads/{}", upload.id),
            id: upload.id.to_string(),
            scan_set_id: upload.scan_set_id.to_string(),
            name: upload.name,
            bytes: upload.bytes,
            offset,
            digest: upload.digest,
            expires_at: upload.expires_at.to_string(),
        }
    }
}

/// How an upload is begun, as the contract describes it.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only describes the headers")]
pub(super) struct CreationHeaders {
    /// Bytes of the whole file.
    #[param(rename = "Upload-Length", minimum = 1)]
    upload_length: u64,
    /// Keys with values in base64: `filename` is the name of the scan (or its path), `digest` what the whole file is held against
    /// at its end, written as in `Content-Digest` (`sha-256=:...:`). Other keys are passed over.
    #[param(rename = "Upload-Metadata", example = "filename YnVuMDQ1LnBseQ==")]
    upload_metadata: String,
}

/// Begin to send a scan piece by piece.
///
/// The protocol is tus 1.0 (tus.io) with creation, expiration, checksum and termination, so clients of tus can be used: this is
/// their endpoint. When all of the file has arrived it is read, checked and kept as by `PUT` of the scan.
#[utoipa::path(
    post, path = "/v1/scan-sets/{id}/uploads", tag = TAG, operation_id = "createUpload",
    params(("id" = String, Path, format = "uuid", description = "The scan set."), CreationHeaders, ConditionHeaders),
    responses(
        (status = 201, description = "Its pieces may come.", body = UploadView,
         headers(("Location" = String, description = "Where its pieces go."),
                 ("Upload-Expires" = String, description = "When it is given up if nothing comes."))),
        responses::BadRequest, responses::NotFound, responses::OtherState, responses::TooLarge,
        responses::Unprocessable, responses::Other,
    )
)]
pub(super) async fn create(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let set = scan_sets::parse_id(&id)?;
    let (bytes, tus::Metadata { name, digest }) = (tus::bytes(&headers, &tus::LENGTH)?, tus::metadata(&headers)?);
    let name = name.ok_or_else(|| {
        let hint = "send Upload-Metadata: filename and the name in base64";
        Problem::new(Code::InvalidName, "the upload has no file name", hint)
    })?;
    let name = names::scan_name(&name)?;
    check_size(&state, &name, bytes)?;
    if digest.as_ref().is_some_and(|digest| digest.len() > 255) {
        let hint = "write it as sha-256=:BASE64: (RFC 9530), or leave it out";
        return Err(Problem::new(Code::MalformedRequest, "the digest has more than 255 characters", hint));
    }
    scans::check_place(&state, set, &name, &conditions).await?;
    let expires_at = uploads::end(&state.context, jiff::Timestamp::now());
    let (id, is_done) = (UploadId::new(), false);
    let upload = UploadRecord { id, scan_set_id: set, name, bytes, digest, expires_at, is_done };
    let state = uninterrupted(async move {
        state.context.database.create_upload(&upload, state.limits().scans_per_set).await?;
        let headers = tus::state(&upload, 0)?;
        let view = UploadView::of(upload, 0);
        let location = HeaderValue::try_from(&view.href).map_err(Problem::internal)?;
        Ok((StatusCode::CREATED, headers, [(header::LOCATION, location)], Json(view)).into_response())
    });
    state.await
}

/// Refuses what is sure to be refused or not to fit when it has come.
fn check_size(state: &AppState, name: &str, bytes: u64) -> Result<(), Problem> {
    let most = state.limits().file_bytes;
    if bytes > most {
        return Err(Problem::file_too_large(name, most));
    }
    if bytes == 0 {
        let detail = format!("{name} has no bytes");
        return Err(Problem::new(Code::UnreadableScan, detail, "send a file with a scan in it").scan(name));
    }
    if state.context.objects.free_bytes().is_some_and(|free| free < bytes) {
        return Err(Problem::storage_full(&format!("{name} has {bytes} bytes")));
    }
    Ok(())
}

/// The scans that are being sent to this set piece by piece.
///
/// Whoever was broken off finds its uploads here, and goes on with those whose `digest` is that of its file.
#[utoipa::path(
    get, path = "/v1/scan-sets/{id}/uploads", tag = TAG, operation_id = "listUploads",
    params(("id" = String, Path, format = "uuid", description = "The scan set.")),
    responses((status = 200, description = "Those that are not done.", body = UploadList), responses::NotFound,
              responses::Other)
)]
pub(super) async fn list(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<UploadList>, Problem> {
    let set = state.context.database.scan_set(scan_sets::parse_id(&id)?).await?;
    let now = jiff::Timestamp::now();
    let mut items = Vec::new();
    for upload in state.context.database.uploads_of(set.id).await? {
        if upload.expires_at > now {
            let offset = uploads::acknowledged(&state.context, &upload).await?;
            items.push(UploadView::of(upload, offset));
        }
    }
    Ok(Json(UploadList { items }))
}

/// What of tus is spoken here.
#[utoipa::path(
    options, path = "/v1/scan-sets/{id}/uploads", tag = TAG, operation_id = "describeUploads",
    params(("id" = String, Path, format = "uuid", description = "The scan set.")),
    responses(
        (status = 204, description = "Versions, extensions and limits of tus.",
         headers(("Tus-Version" = String, description = "Versions that are spoken."),
                 ("Tus-Extension" = String, description = "Extensions."),
                 ("Tus-Max-Size" = u64, description = "Bytes of the largest file."),
                 ("Tus-Checksum-Algorithm" = String, description = "Checksums of pieces that are known."))),
        responses::NotFound, responses::Other,
    )
)]
pub(super) async fn capabilities(
    State(state): State<AppState>,
    Path(id): Path<String>,
) -> Result<(StatusCode, HeaderMap), Problem> {
    state.context.database.scan_set(scan_sets::parse_id(&id)?).await?;
    Ok((StatusCode::NO_CONTENT, tus::capabilities(state.limits().file_bytes)))
}

/// How far an upload is.
#[utoipa::path(
    head, path = "/v1/uploads/{id}", tag = TAG, operation_id = "getUpload",
    params(("id" = String, Path, format = "uuid", description = "The upload.")),
    responses(
        (status = 200, description = "How much of it has arrived.",
         headers(("Upload-Offset" = u64, description = "Bytes that need not be sent again."),
                 ("Upload-Length" = u64, description = "Bytes of the whole file."),
                 ("Upload-Expires" = String, description = "When it is given up if nothing more comes."))),
        responses::NotFound, responses::Other,
    )
)]
pub(super) async fn look(State(state): State<AppState>, Path(id): Path<String>) -> Result<Response, Problem> {
    let upload = record(&state, parse_id(&id)?).await?;
    let offset = uploads::acknowledged(&state.context, &upload).await?;
    let no_store = [(header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];
    Ok((StatusCode::OK, tus::state(&upload, offset)?, no_store).into_response())
}

/// Give an upload up; what has arrived is removed.
#[utoipa::path(
    delete, path = "/v1/uploads/{id}", tag = TAG, operation_id = "deleteUpload",
    params(("id" = String, Path, format = "uuid", description = "The upload.")),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::Other)
)]
pub(super) async fn give_up(State(state): State<AppState>, Path(id): Path<String>) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    deleted(async move {
        let _receiver = state.receivers.take_over(id).await;
        record(&state, id).await?;
        Ok(uploads::discard(&state.context, id).await?)
    })
    .await
}
