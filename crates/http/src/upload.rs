//! Uploads: streamed to disk chunk by chunk, hashed on the way, checked as soon as they are whole.

use std::collections::BTreeMap;

use axum::extract::Request;
use bytes::Bytes;

use super::body::{self, Room};
use super::digest::{Digests, Hashers};
use super::encoding::PackedDigests;
use super::multipart::{Part, Parts};
use super::names;
use super::problem::{Code, Problem};
use super::state::{AppState, blocking};
use visage_formats::{ReadLimits, Reading, same_name};
use visage_geometry::Surface;
use visage_service::app::arrival::{CheckedScan, giving_way};
use visage_service::config::Limits;
use visage_service::storage::{StagedFile, StagedWriter};

/// How much of a part's name an error shows.
const SHOWN_NAME: usize = 64;

/// Which parts a form may have.
#[derive(Debug, Clone, Copy)]
pub struct FormRules {
    /// Parts that hold a file and go to disk.
    pub files: &'static [&'static str],
    /// The most files in all.
    pub most_files: usize,
    /// Which names they may have.
    pub file_name: fn(&str) -> Result<String, Problem>,
    /// Parts that are kept in memory: text, and pose files.
    pub texts: &'static [&'static str],
}

/// A file on disk that belongs nowhere yet; its name is checked.
pub use visage_service::app::arrival::ReceivedFile as UploadedFile;

/// A part that is kept in memory.
#[derive(Debug)]
pub struct TextPart {
    /// The file name, if the part had one.
    pub file_name: Option<String>,
    /// Its content.
    pub content: Bytes,
}

/// A form that has arrived whole.
#[derive(Debug, Default)]
pub struct Form {
    /// The files, in the order in which they came.
    pub files: Vec<UploadedFile>,
    /// The other parts.
    pub texts: BTreeMap<String, TextPart>,
    hasher: blake3::Hasher,
}

impl Form {
    /// A hash of what was sent; the same for a repeated request, whatever its boundary.
    pub fn hash(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }

    /// The text of a part, if it was sent.
    pub fn text(&self, part: &str) -> Result<Option<&str>, Problem> {
        let Some(found) = self.texts.get(part) else { return Ok(None) };
        std::str::from_utf8(&found.content).map(Some).map_err(|_| {
            Problem::new(Code::InvalidField, format!("the part {part} is no UTF-8 text"), "send UTF-8 text")
        })
    }

    fn note(&mut self, part: &str, name: &str, checksum: &str) {
        for item in [part, name, checksum] {
            // with lengths, or ("ab", "c") and ("a", "bc") would be the same
            self.hasher.update(&(item.len() as u64).to_le_bytes());
            self.hasher.update(item.as_bytes());
        }
    }
}

/// Receives a form. Files go to disk, never through memory as a whole.
pub async fn read_form(state: &AppState, request: Request, rules: &FormRules) -> Result<Form, Problem> {
    let mut parts = Parts::of(request, state.limits().upload_bytes)?;
    let mut form = Form::default();
    let mut room = Room::new(state);
    while let Some(part) = parts.next().await? {
        read_part(state, rules, part, &mut form, &mut room).await?;
    }
    Ok(form)
}

async fn read_part(
    state: &AppState,
    rules: &FormRules,
    field: Part,
    form: &mut Form,
    room: &mut Room,
) -> Result<(), Problem> {
    let part = field.name().to_owned();
    if rules.files.contains(&part.as_str()) {
        if form.files.len() >= rules.most_files {
            let detail = format!("at most {} file(s) may be sent as {part}", rules.most_files);
            return Err(Problem::new(Code::TooManyScans, detail, "send fewer files; GET /v1/info states the limits"));
        }
        let name = (rules.file_name)(&field.file_name().unwrap_or_default())?;
        if let Some(other) = form.files.iter().find(|file| same_name(&file.name) == same_name(&name)) {
            return Err(Problem::duplicate(&other.name, &name));
        }
        let staged = receive_part(state, &name, field).await?;
        form.note(&part, &name, &staged.checksum);
        form.files.push(UploadedFile { name, staged });
        return Ok(());
    }
    if !rules.texts.contains(&part.as_str()) {
        let known = rules.files.iter().chain(rules.texts).copied().collect::<Vec<_>>().join(", ");
        let part: String = part.chars().take(SHOWN_NAME).collect();
        let detail = format!("the form has a part {part:?}, which this call does not know");
        return Err(Problem::new(Code::InvalidField, detail, format!("the parts are: {known}")));
    }
    let text = read_text(state.limits(), &part, field, room).await?;
    form.note(&part, text.file_name.as_deref().unwrap_or_default(), blake3::hash(&text.content).to_hex().as_str());
    if form.texts.insert(part.clone(), text).is_some() {
        return Err(Problem::new(Code::InvalidField, format!("the part {part} came twice"), "send it once"));
    }
    Ok(())
}

async fn receive_part(state: &AppState, name: &str, mut field: Part) -> Result<StagedFile, Problem> {
    let mut writer = state.context.objects.receive().await?;
    let mut counted = 0;
    while let Some(chunk) = field.chunk().await? {
        append(state.limits(), writer.as_mut(), name, &mut counted, &chunk).await?;
    }
    Ok(writer.finish().await?)
}

/// Receives a raw body as one file.
pub async fn receive_body(state: &AppState, name: &str, request: Request) -> Result<(StagedFile, Digests), Problem> {
    use futures_util::StreamExt;
    let packed = request.extensions().get::<PackedDigests>().cloned();
    let mut writer = state.context.objects.receive().await?;
    let mut hashers = Hashers::wanted_by(request.headers());
    let mut counted = 0;
    let mut body = request.into_body().into_data_stream();
    while let Some(chunk) = body.next().await {
        let chunk = chunk.map_err(|error| body::broken("the file", &error).scan(name))?;
        hashers.update(&chunk);
        append(state.limits(), writer.as_mut(), name, &mut counted, &chunk).await?;
    }
    // a digest of a content that is packed is that of what is sent (RFC 9530)
    let digests = packed.map_or_else(|| hashers.finish(), PackedDigests::finish);
    Ok((writer.finish().await?, digests))
}

async fn append(
    limits: &Limits,
    writer: &mut dyn StagedWriter,
    name: &str,
    counted: &mut u64,
    chunk: &[u8],
) -> Result<(), Problem> {
    *counted += chunk.len() as u64;
    if *counted > limits.file_bytes {
        return Err(Problem::file_too_large(name, limits.file_bytes));
    }
    Ok(writer.write(chunk).await?)
}

async fn read_text(limits: &Limits, part: &str, mut field: Part, room: &mut Room) -> Result<TextPart, Problem> {
    let limit = if part == "poses" { limits.pose_file_bytes } else { limits.text_bytes };
    let file_name = field.file_name().map(|name| names::file_name(&name)).transpose()?;
    let mut content = Vec::new();
    while let Some(chunk) = field.chunk().await? {
        if content.len() + chunk.len() > limit {
            let detail = format!("the part {part} may have at most {limit} bytes");
            return Err(Problem::new(Code::TooLarge, detail, "send less; GET /v1/info states the limits"));
        }
        room.take(chunk.len())?;
        content.extend_from_slice(&chunk);
    }
    Ok(TextPart { file_name, content: content.into() })
}

/// The same without what was not taken of the file.
pub async fn read_surface(state: &AppState, file: UploadedFile) -> Result<(UploadedFile, Surface), Problem> {
    read(state, file).await.map(|(file, reading)| (file, reading.surface))
}

/// Reads a received file as a scan or model.
pub async fn read(state: &AppState, file: UploadedFile) -> Result<(UploadedFile, Reading), Problem> {
    read_as(state, file, |name, bytes, limits| {
        visage_formats::read(name, bytes, limits).map_err(|error| Problem::unreadable(name, &error))
    })
    .await
}

/// Reads a received file. Bounded: only a few files are in memory at a time.
async fn read_as<T: Send + 'static>(
    state: &AppState,
    file: UploadedFile,
    read: fn(&str, &[u8], &ReadLimits) -> Result<T, Problem>,
) -> Result<(UploadedFile, T), Problem> {
    let permit = state.checks.clone().acquire_owned().await.map_err(Problem::internal)?;
    let limits = state.limits().read_limits();
    let objects = state.context.objects.clone();
    blocking(move || {
        let _permit = permit;
        let bytes = objects.read_staged(&file.staged)?;
        let read = giving_way(|| read(&file.name, &bytes, &limits))?;
        Ok((file, read))
    })
    .await?
}

/// The file as it is kept under the name of its format: one that came packed is unpacked.
pub async fn unpacked(state: &AppState, file: UploadedFile) -> Result<UploadedFile, Problem> {
    let Some(inner) = visage_formats::packed::inner_name(&file.name).map(str::to_owned) else { return Ok(file) };
    let permit = state.checks.clone().acquire_owned().await.map_err(Problem::internal)?;
    let limits = state.limits().read_limits();
    let objects = state.context.objects.clone();
    let bytes = blocking(move || {
        let bytes = objects.read_staged(&file.staged)?;
        let unpack = || visage_formats::packed::unpacked(&file.name, &bytes, &limits);
        let unpacked = giving_way(unpack).map(|(_, bytes)| bytes.into_owned());
        unpacked.map_err(|error| Problem::unreadable(&file.name, &error))
    })
    .await??;
    let mut writer = state.context.objects.receive().await?;
    writer.write(&bytes).await?;
    drop(permit);
    Ok(UploadedFile { name: inner, staged: writer.finish().await? })
}

/// Checks a received scan. United, the scans of a file would be one that no scanner has taken.
pub async fn check_scan(state: &AppState, file: UploadedFile) -> Result<CheckedScan, Problem> {
    read_as(state, file, |name, bytes, limits| {
        let mut scans = visage_formats::read_scans(name, bytes, limits).map_err(|e| Problem::unreadable(name, &e))?;
        match (scans.pop(), scans.len()) {
            (Some(scan), 0) => Ok((scan.reading.surface.cloud.len() as u64, scan.reading.dropped)),
            (_, others) => Err(Problem::several_scans(name, others + 1)),
        }
    })
    .await
    .map(|(file, (points, dropped))| CheckedScan { file, points, dropped })
}
