//! What arrives of a file, and what becomes of it when it is whole.

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use tokio::io::AsyncReadExt;

use super::receivers::Receiver;
use super::tus::Checksum;
use super::{parse_id, record, tus};
use crate::conditions::{ConditionHeaders, Conditions, ETag};
use crate::digest::{self, Hashers};
use crate::extract::{Path, media_type, wrong_media_type};
use crate::problem::{Code, Problem};
use crate::scan_sets::TAG;
use crate::schemas::FileContent;
use crate::state::{AppState, blocking, uninterrupted};
use crate::upload::{self, UploadedFile};
use crate::{body, responses, scans};
use visage_domain::UploadRecord;
use visage_service::app::arrival::CheckedScan;
use visage_service::app::uploads;
use visage_service::storage::{PieceWriter, StagedFile, StagedWriter};

/// How much of a file is in memory while it is copied or hashed.
const CHUNK: usize = 256 << 10;

/// What a piece says of itself, as the contract describes it.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only describes the headers")]
pub(super) struct PieceHeaders {
    /// Where in the file it begins: where the last one has ended, as HEAD says.
    #[param(rename = "Upload-Offset", minimum = 0)]
    upload_offset: u64,
    /// What it is held against: `sha1` or `sha256`, a blank, and the digest in base64. Nothing is kept of a piece that differs (460).
    #[param(rename = "Upload-Checksum", required = false, example = "sha1 qZk+NkcGgWq6PiVxeFDCbJzQ2J0=")]
    upload_checksum: String,
}

/// Send the next piece of a file.
///
/// What arrives before the connection is lost is kept, unless the piece has a checksum. The last piece is answered when the file
/// has been read, checked and kept as a scan, with the errors of `PUT` of the scan; if its content is refused the upload is gone. A
/// newer request takes over from one that is under way.
#[utoipa::path(
    patch, path = "/v1/uploads/{id}", tag = TAG, operation_id = "sendPiece",
    params(("id" = String, Path, format = "uuid", description = "The upload."), PieceHeaders, ConditionHeaders),
    request_body(content = inline(FileContent), content_type = "application/offset+octet-stream",
                 description = "The piece."),
    responses(
        (status = 204, description = "It has arrived; with the last piece, the scan is kept.",
         headers(("Upload-Offset" = u64, description = "Bytes that have arrived in all."),
                 ("Upload-Expires" = String, description = "When it is given up if nothing more comes."),
                 ("ETag" = String, description = "That of the scan, with the last piece."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::PieceConflict, responses::OtherState,
        responses::TooLarge, responses::WrongType, responses::Unprocessable, responses::Other,
    )
)]
pub(super) async fn add(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    let id = parse_id(&id)?;
    let (parts, body) = request.into_parts();
    let found = media_type(&parts.headers);
    if found != tus::PIECE {
        return Err(wrong_media_type(&found, tus::PIECE));
    }
    let piece = Piece {
        offset: tus::bytes(&parts.headers, &tus::OFFSET)?,
        checksum: Checksum::of(&parts.headers)?,
        declared: tus::bytes(&parts.headers, &header::CONTENT_LENGTH).ok(),
        body,
    };
    // what arrives is kept, and whole pieces become a scan, though the client may be gone
    uninterrupted(async move {
        let receiver = state.receivers.take_over(id).await;
        let mut upload = record(&state, id).await?;
        upload.expires_at = uploads::end(&state.context, jiff::Timestamp::now());
        state.context.database.extend_upload(id, upload.expires_at).await?;
        if !arrive(&state, &upload, piece, &receiver).await? {
            let offset = uploads::acknowledged(&state.context, &upload).await?;
            return answer(&upload, offset, HeaderMap::new());
        }
        let etag = become_scan(&state, &upload, &conditions).await?;
        answer(&upload, upload.bytes, HeaderMap::from_iter([etag.header()?]))
    })
    .await
}

fn answer(upload: &UploadRecord, offset: u64, more: HeaderMap) -> Result<Response, Problem> {
    let mut headers = tus::state(upload, offset)?;
    headers.extend(more);
    headers.remove(tus::LENGTH);
    Ok((StatusCode::NO_CONTENT, headers).into_response())
}

/// A piece that is arriving.
struct Piece {
    offset: u64,
    checksum: Option<Checksum>,
    /// How many bytes it has, if it says so.
    declared: Option<u64>,
    body: Body,
}

/// Takes a piece in; answers whether the file is whole.
async fn arrive(state: &AppState, upload: &UploadRecord, piece: Piece, receiver: &Receiver) -> Result<bool, Problem> {
    let acknowledged = uploads::acknowledged(&state.context, upload).await?;
    if piece.offset != acknowledged {
        let detail = format!("{acknowledged} bytes have arrived, the piece begins at {}", piece.offset);
        let hint = "ask by HEAD how much has arrived, and go on from there";
        return Err(Problem::new(Code::OffsetMismatch, detail, hint).scan(&upload.name));
    }
    let left = upload.bytes - acknowledged;
    if piece.declared.is_some_and(|declared| declared > left) {
        return Err(too_long(upload));
    }
    let objects = &state.context.objects;
    let held = objects.held(upload.id).await?;
    let mut sink = match &piece.checksum {
        // it is all here, and may be a scan already: what comes once more is not written again
        _ if held >= upload.bytes => Sink::Nowhere,
        None => Sink::Pieces(objects.resume(upload.id).await?),
        Some(checksum) => Sink::Apart(objects.receive().await?, checksum.hasher()),
    };
    let received = receive(upload, piece.body, left, receiver, &mut sink).await;
    match sink {
        Sink::Nowhere => Ok(received? == left && !upload.is_done),
        Sink::Pieces(writer) => {
            // what has come counts, however the piece has ended
            writer.finish().await?;
            Ok(held + received? == upload.bytes)
        }
        Sink::Apart(writer, hasher) => {
            let received = received?;
            if Some(hasher.finish()) != piece.checksum {
                let detail = format!("the piece of {} from {} on has another checksum", upload.name, piece.offset);
                return Err(Problem::new(Code::ChecksumMismatch, detail, "send it again").scan(&upload.name));
            }
            append(state, upload, &writer.finish().await?).await?;
            Ok(held + received == upload.bytes)
        }
    }
}

/// Puts a piece that was kept apart behind what has arrived.
async fn append(state: &AppState, upload: &UploadRecord, piece: &StagedFile) -> Result<(), Problem> {
    let mut reader = state.context.objects.open_staged(piece).await?;
    let mut writer = state.context.objects.resume(upload.id).await?;
    let mut chunk = vec![0; CHUNK];
    loop {
        match reader.read(&mut chunk).await.map_err(Problem::internal)? {
            0 => return Ok(writer.finish().await?),
            count => writer.write(&chunk[..count]).await?,
        }
    }
}

/// Where a piece goes.
enum Sink {
    /// It is here already.
    Nowhere,
    /// Behind what has arrived.
    Pieces(Box<dyn PieceWriter>),
    /// A file of its own, until its checksum is known.
    Apart(Box<dyn StagedWriter>, tus::Hasher),
}

impl Sink {
    async fn take(&mut self, chunk: &[u8]) -> Result<(), Problem> {
        match self {
            Sink::Nowhere => {}
            Sink::Pieces(writer) => writer.write(chunk).await?,
            Sink::Apart(writer, hasher) => {
                hasher.update(chunk);
                writer.write(chunk).await?;
            }
        }
        Ok(())
    }
}

/// Receives a piece to its end; answers with its bytes.
async fn receive(
    upload: &UploadRecord,
    body: Body,
    most: u64,
    receiver: &Receiver,
    sink: &mut Sink,
) -> Result<u64, Problem> {
    let mut received = 0;
    let mut body = body.into_data_stream();
    loop {
        let chunk = tokio::select! {
            biased;
            () = receiver.taken_over.cancelled() => {
                let detail = format!("a newer request goes on with {}", upload.name);
                return Err(Problem::new(Code::RequestInProgress, detail, "send pieces one after the other").retry_after(1));
            }
            chunk = body.next() => chunk,
        };
        let Some(chunk) = chunk else { return Ok(received) };
        let chunk = chunk.map_err(|error| body::broken("the piece", &error).scan(&upload.name))?;
        if chunk.len() as u64 > most - received {
            return Err(too_long(upload));
        }
        sink.take(&chunk).await?;
        received += chunk.len() as u64;
    }
}

fn too_long(upload: &UploadRecord) -> Problem {
    let detail =
        format!("with this piece {} would have more than the {} bytes it began with", upload.name, upload.bytes);
    Problem::new(Code::TooLarge, detail, "send what is left and no more").scan(&upload.name)
}

/// Makes the whole file a scan. If the fault is in the file, nothing of it is kept: it could only fail again.
async fn become_scan(state: &AppState, upload: &UploadRecord, conditions: &Conditions) -> Result<ETag, Problem> {
    let checked = match check(state, upload).await {
        Ok(checked) => checked,
        Err(problem) => {
            if problem.code().status().is_client_error() {
                uploads::discard(&state.context, upload.id).await?;
            }
            return Err(problem);
        }
    };
    let (_, scan) = scans::keep(state, upload.scan_set_id, checked, conditions).await?;
    uploads::finish(&state.context, upload.id).await?;
    Ok(ETag::of_checksum(&scan.checksum))
}

async fn check(state: &AppState, upload: &UploadRecord) -> Result<CheckedScan, Problem> {
    let (objects, id) = (state.context.objects.clone(), upload.id);
    let staged = blocking(move || objects.stage_held(id)).await??;
    if let Some(digest) = &upload.digest {
        let digests = hashed(state, &staged).await?;
        digest::check_values(&[digest], &upload.name, &digests)?;
    }
    upload::check_scan(state, UploadedFile { name: upload.name.clone(), staged }).await
}

async fn hashed(state: &AppState, staged: &StagedFile) -> Result<digest::Digests, Problem> {
    let mut reader = state.context.objects.open_staged(staged).await?;
    let (mut hashers, mut chunk) = (Hashers::default(), vec![0; CHUNK]);
    loop {
        match reader.read(&mut chunk).await.map_err(Problem::internal)? {
            0 => return Ok(hashers.finish()),
            count => hashers.update(&chunk[..count]),
        }
    }
}
