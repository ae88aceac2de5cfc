//! Descriptions of what comes, held against what this program may store.

use std::collections::BTreeSet;

use super::import::ImportError;
use super::layout::{JobEntry, ModelEntry, ScanSetEntry, SignatureEntry, StandardEntry};
use visage_domain::asset::{Asset, Origin};
use visage_domain::options::{Declared, Options};
use visage_domain::{
    AssetRecord, ImportedModel, JobBase, JobId, JobKind, JobRecord, JobStatus, ModelId, NewModel, NewScanSet,
    ScanSetId, StandardId, StoredSignature,
};
use visage_formats::Format;
use visage_geometry::Unit;
use visage_geometry::names::UnknownName;
use visage_shape::faces::Signature;

/// The most files of a model: there are seven kinds of results.
const MOST_FILES: usize = 16;
/// The longest name or label.
const LONGEST_TEXT: usize = 200;
/// A signature that is to be made anew is of this version, which no operator has.
const TO_BE_MADE: u32 = 0;

/// A model as it will be stored, without its signature.
pub(super) fn checked_model(
    entry: &ModelEntry,
    id: &str,
    wrong: &dyn Fn(String) -> ImportError,
) -> Result<ImportedModel, ImportError> {
    let id = ModelId::parse(id).filter(|_| entry.id == id).ok_or_else(|| wrong("its id is none".into()))?;
    for text in [Some(&entry.name), entry.label.as_ref(), entry.quality.as_ref()].into_iter().flatten() {
        one_line(text, wrong)?;
    }
    let origin = if entry.job.is_some() { Origin::Registered } else { Origin::Uploaded };
    let names: BTreeSet<&str> = entry.files.iter().map(|file| file.name.as_str()).collect();
    let unknown = names.iter().find(|name| Asset::named(name, origin).is_none());
    if let Some(name) = unknown {
        return Err(wrong(format!("no file of such a model is named {name:?}")));
    }
    if entry.files.is_empty() || names.len() != entry.files.len() || names.len() > MOST_FILES {
        return Err(wrong("a model has some files, each once".into()));
    }
    let scan_set = entry.scan_set.as_ref().map(|set| checked_set(set, wrong)).transpose()?;
    let job = entry.job.as_ref().map(|job| checked_job(job, scan_set.as_ref(), id, wrong)).transpose()?;
    if job.is_none() && scan_set.is_some() {
        return Err(wrong("an uploaded model has no scan set".into()));
    }
    let model = NewModel {
        id,
        origin: job.as_ref().map(|job| (job.id, job.scan_set_id)),
        name: entry.name.clone(),
        label: entry.label.clone(),
        unit: unit(&entry.unit, wrong)?,
        points: entry.points.min(i64::MAX as u64),
        quality: entry.quality.clone(),
        assets: entry.files.iter().map(AssetRecord::from).collect(),
        reading: entry.reading.clone(),
        signature: None,
    };
    Ok(ImportedModel { model, job, scan_set })
}

fn checked_set(set: &ScanSetEntry, wrong: &dyn Fn(String) -> ImportError) -> Result<NewScanSet, ImportError> {
    one_line(&set.name, wrong)?;
    Ok(NewScanSet {
        id: ScanSetId::parse(&set.id).ok_or_else(|| wrong("the id of its scan set is none".into()))?,
        name: set.name.clone(),
        unit: unit(&set.unit, wrong)?,
        scans: Vec::new(),
        poses: None,
        passed_over: Vec::new(),
    })
}

fn checked_job(
    job: &JobEntry,
    set: Option<&NewScanSet>,
    model: ModelId,
    wrong: &dyn Fn(String) -> ImportError,
) -> Result<JobRecord, ImportError> {
    let id = JobId::parse(&job.id).ok_or_else(|| wrong("the id of its job is none".into()))?;
    let kind: JobKind = job.kind.parse().map_err(|error: UnknownName| wrong(error.to_string()))?;
    let base = job.base_model_id.as_deref().map(ModelId::parse);
    let base = base.map(|id| id.ok_or_else(|| wrong("the id of its base is none".into()))).transpose()?;
    let fits = match kind {
        JobKind::Register => set.is_some(),
        JobKind::Surface => set.is_none() && base.is_some(),
        JobKind::Evaluate => false,
    };
    if !fits {
        return Err(wrong(format!("a job of kind {} has not made this model", kind.name())));
    }
    if let Some(text) = &job.label {
        one_line(text, wrong)?;
    }
    Ok(JobRecord {
        kind,
        scan_set_id: set.map(|set| set.id),
        label: job.label.clone(),
        // what a later program offers is in the model's report
        options: Options::parse(job.options.clone()).unwrap_or_default(),
        hints: job.hints.clone().and_then(|hints| serde_json::from_value(hints).ok()).unwrap_or_default(),
        base: base.map(|model_id| JobBase { model_id, poses: Vec::new() }),
        status: JobStatus::Succeeded,
        stage: job.stage.clone(),
        progress: 1.0,
        stage_seconds: job.stage_seconds.clone(),
        attempts: job.attempts,
        model_id: Some(model),
        started_at: time(job.started_at.as_deref(), wrong)?,
        finished_at: time(job.finished_at.as_deref(), wrong)?,
        ..JobRecord::waiting(id)
    })
}

/// The signature, if it is one of this program's; else one that is made anew.
pub(super) fn fitting(entry: &SignatureEntry, content: Vec<u8>) -> StoredSignature {
    let is_ours = entry.version == Signature::VERSION && Signature::from_bytes(&content).is_ok();
    let version = if is_ours { entry.version } else { TO_BE_MADE };
    let content = if is_ours { content } else { Vec::new() };
    StoredSignature { version, summary: entry.summary.clone(), content }
}

/// The id and the unit of a standard that can be stored.
pub(super) fn checked_standard(
    entry: &StandardEntry,
    id: &str,
    wrong: &dyn Fn(String) -> ImportError,
) -> Result<(StandardId, Unit), ImportError> {
    let id = StandardId::parse(id).filter(|_| entry.id == id).ok_or_else(|| wrong("its id is none".into()))?;
    let is_file = Format::surfaces().any(|format| Asset::Annotated(format).name() == entry.file.name);
    if !is_file || !is_standard_name(&entry.name) {
        return Err(wrong(format!("no standard is named {:?} or has a file {:?}", entry.name, entry.file.name)));
    }
    Ok((id, unit(&entry.unit, wrong)?))
}

fn unit(text: &str, wrong: &dyn Fn(String) -> ImportError) -> Result<Unit, ImportError> {
    text.parse().map_err(|error: UnknownName| wrong(error.to_string()))
}

fn time(text: Option<&str>, wrong: &dyn Fn(String) -> ImportError) -> Result<Option<jiff::Timestamp>, ImportError> {
    text.map(|text| text.parse().map_err(|error: jiff::Error| wrong(error.to_string()))).transpose()
}

fn one_line(text: &str, wrong: &dyn Fn(String) -> ImportError) -> Result<(), ImportError> {
    if text.chars().count() > LONGEST_TEXT || text.chars().any(char::is_control) {
        return Err(wrong(format!("names have at most {LONGEST_TEXT} characters in one line")));
    }
    Ok(())
}

/// As the API takes them.
fn is_standard_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    (1..=64).contains(&name.len()) && name.chars().all(is_plain) && StandardId::parse(name).is_none()
}
