//! A data folder is written to a stream.

use std::io::{self, Write};

use serde::Serialize;
use tokio::runtime::Handle;

use super::Place;
use super::layout::{
    FORMAT, FileEntry, HEAD, Head, JobEntry, ModelEntry, SIGNATURE, ScanSetEntry, SignatureEntry, StandardEntry, TAIL,
    Tail, VERSION, of_model, of_standard,
};
use crate::storage::inventory::{Storage, StorageError};
use crate::storage::{DatabaseError, ObjectError};
use visage_domain::{JobRecord, ModelFilter, ModelId, ModelRecord, PageRequest, StandardRecord};

/// Models that are looked up at a time.
const PAGE: usize = 100;

/// Why a gallery could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// It can't be read.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A file of it is gone.
    #[error("{place} is missing: put it back from a backup, or delete the model; `visage doctor` names all that are")]
    Missing {
        /// Where it would have stood.
        place: String,
    },
    /// The stream takes no more.
    #[error("writing the file: {0}")]
    Write(#[from] io::Error),
}

impl From<ObjectError> for ExportError {
    fn from(error: ObjectError) -> Self {
        ExportError::Storage(error.into())
    }
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Exported {
    /// Models,
    pub models: u64,
    /// standards,
    pub standards: u64,
    /// and bytes of their files.
    pub bytes: u64,
}

/// Writes all models and standards. Blocks, and must not run on an async thread.
///
/// # Errors
/// Something is missing, damaged or can't be written: what was written so far is no export.
pub fn export(storage: &Storage, runtime: &Handle, to: impl Write) -> Result<Exported, ExportError> {
    let mut writer = Writer { archive: tar::Builder::new(to), written: Exported::default() };
    let place = Place { storage, runtime };
    let head = Head { format: FORMAT.into(), version: VERSION, program: env!("CARGO_PKG_VERSION").into() };
    writer.json(HEAD, &head)?;
    let mut page = PageRequest { limit: PAGE, before: None };
    loop {
        let found = place.ask(storage.database.models(&ModelFilter::default(), &page))?;
        for model in &found.items {
            write_model(&place, &mut writer, model)?;
        }
        let Some(last) = found.items.last().filter(|_| found.more) else { break };
        page.before = Some(last.id.to_string());
    }
    for standard in place.ask(storage.database.standards())? {
        write_standard(&place, &mut writer, &standard)?;
    }
    let Exported { models, standards, .. } = writer.written;
    writer.json(TAIL, &Tail { models, standards })?;
    writer.archive.finish()?;
    writer.archive.get_mut().flush()?;
    Ok(writer.written)
}

fn write_model<W: Write>(place: &Place<'_>, writer: &mut Writer<W>, model: &ModelRecord) -> Result<(), ExportError> {
    let (database, id) = (&place.storage.database, model.id.to_string());
    let assets = place.ask(database.assets(model.id))?;
    let content = match &model.signature {
        Some(summary) => signature_of(place, model.id)?.map(|content| (summary, content)),
        None => None,
    };
    let job = model.job_id.map(|job| place.ask(database.job(job))).transpose()?;
    let set = model.scan_set_id.map(|set| place.ask(database.scan_set(set))).transpose()?;
    let entry = ModelEntry {
        id: id.clone(),
        name: model.name.clone(),
        label: model.label.clone(),
        unit: model.unit.name().into(),
        points: model.points,
        quality: model.quality.clone(),
        reading: model.reading.clone(),
        files: assets.iter().map(FileEntry::from).collect(),
        signature: content.as_ref().map(|(summary, content)| SignatureEntry {
            version: summary.version,
            summary: (*summary).clone(),
            file: FileEntry {
                name: SIGNATURE.into(),
                bytes: content.len() as u64,
                blake3: blake3::hash(content).to_hex().to_string(),
            },
        }),
        job: job.as_ref().map(job_entry).transpose()?,
        scan_set: set.map(|set| ScanSetEntry { id: set.id.to_string(), name: set.name, unit: set.unit.name().into() }),
    };
    writer.json(&of_model(&id, "model.json"), &entry)?;
    for asset in &assets {
        let at = of_model(&id, &asset.name);
        let content = place.storage.objects.read_asset(model.id, asset)?;
        writer.file(&at, &content.ok_or_else(|| ExportError::Missing { place: at.clone() })?)?;
    }
    if let Some((_, content)) = content {
        writer.file(&of_model(&id, SIGNATURE), &content)?;
    }
    writer.written.models += 1;
    Ok(())
}

/// The bytes of a signature. One that is damaged is sent empty: whoever reads that makes it anew.
fn signature_of(place: &Place<'_>, id: ModelId) -> Result<Option<Vec<u8>>, ExportError> {
    match place.ask(place.storage.database.signature(id)) {
        Err(StorageError::Database(DatabaseError::Damaged { .. })) => Ok(Some(Vec::new())),
        found => Ok(found?),
    }
}

fn job_entry(job: &JobRecord) -> Result<JobEntry, io::Error> {
    Ok(JobEntry {
        id: job.id.to_string(),
        kind: job.kind.name().into(),
        label: job.label.clone(),
        options: serde_json::to_value(&job.options)?,
        hints: (!job.hints.is_empty()).then(|| serde_json::to_value(&job.hints)).transpose()?,
        base_model_id: job.base.as_ref().map(|base| base.model_id.to_string()),
        stage: job.stage.clone(),
        stage_seconds: job.stage_seconds.clone(),
        attempts: job.attempts,
        started_at: job.started_at.map(|time| time.to_string()),
        finished_at: job.finished_at.map(|time| time.to_string()),
    })
}

fn write_standard<W: Write>(
    place: &Place<'_>,
    writer: &mut Writer<W>,
    standard: &StandardRecord,
) -> Result<(), ExportError> {
    let examples = place.ask(place.storage.database.examples(standard.id))?;
    let ids = |ids: &[ModelId]| ids.iter().map(ToString::to_string).collect();
    let entry = StandardEntry {
        id: standard.id.to_string(),
        name: standard.name.clone(),
        unit: standard.unit.name().into(),
        annotation: standard.annotation.clone(),
        positive: ids(&examples.positive),
        negative: ids(&examples.negative),
        file: FileEntry::from(&standard.asset),
    };
    writer.json(&of_standard(&entry.id, "standard.json"), &entry)?;
    let content = place.storage.objects.read_standard(standard.id, &standard.asset)?;
    writer.file(&of_standard(&entry.id, &standard.asset.name), &content)?;
    writer.written.standards += 1;
    Ok(())
}

struct Writer<W: Write> {
    archive: tar::Builder<W>,
    written: Exported,
}

impl<W: Write> Writer<W> {
    fn json(&mut self, place: &str, value: &impl Serialize) -> io::Result<()> {
        let text = serde_json::to_vec_pretty(value)?;
        self.file(place, &text)
    }

    fn file(&mut self, place: &str, content: &[u8]) -> io::Result<()> {
        let mut header = tar::Header::new_ustar();
        header.set_path(place)?;
        header.set_size(content.len() as u64);
        // whose faces these are is nobody else's business, wherever it is unpacked; and the same gallery is the same file
        header.set_mode(0o600);
        header.set_cksum();
        self.archive.append(&header, content)?;
        self.written.bytes += content.len() as u64;
        Ok(())
    }
}
