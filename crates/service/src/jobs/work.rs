//! One job from scans to stored files: blocking work on a thread and a rayon pool of its own.

use std::collections::BTreeMap;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use tokio::runtime::Handle;

use super::admission::Plan;
use super::{admission, artifacts};
use crate::app::engine::Engine;
use crate::app::tracker::Tracker;
use crate::config::Limits;
use crate::machine::workers;
use crate::panics::panic_message;
use crate::storage::{Database, DatabaseError, ObjectError, ObjectStore, StagedModel};
use visage_domain::asset::Asset;
use visage_domain::{AssetRecord, JobError, JobRecord, ModelId, NewModel, ScanRecord, ScanSetRecord, StoredFile};
use visage_formats::{DeclaredUnit, Dropped};
use visage_geometry::Unit;
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_pipeline::{NamedScan, PipelineError, RegisteredModel, units};
use visage_shape::faces::Signature;

/// Everything one job needs.
pub(super) struct Work {
    pub job: JobRecord,
    pub set: ScanSetRecord,
    pub database: Arc<dyn Database>,
    /// The runtime that the database runs on; this work runs on a thread of its own.
    pub runtime: Handle,
    pub objects: Arc<dyn ObjectStore>,
    pub engine: Arc<dyn Engine>,
    pub limits: Limits,
    /// Threads of the pool.
    pub threads: usize,
    pub tracker: Arc<Tracker>,
    pub progress: Progress,
}

/// A model whose files are where they belong, but which no row knows yet.
pub(super) struct Made {
    pub model: NewModel,
    pub signature: Option<Signature>,
}

/// Why there is no model.
#[derive(Debug)]
pub(super) enum WorkError {
    /// A stop was asked for.
    Stopped,
    /// An evaluation gives way to registrations that wait.
    GivesWay,
    /// It can't be done at the moment and is tried again in a while: the machine is out of descriptors, threads, memory
    /// or disk, another program holds the database, or what keeps files can't be reached.
    Later(String),
    /// The job failed.
    Failed(JobError),
}

impl From<Canceled> for WorkError {
    fn from(_: Canceled) -> Self {
        WorkError::Stopped
    }
}

impl From<ObjectError> for WorkError {
    fn from(error: ObjectError) -> Self {
        if error.is_shortage() || error.is_unreachable() {
            return WorkError::Later(error.to_string());
        }
        let (code, hint) = if error.is_storage_full() {
            ("storage_full", "free space on the server's disk, then retry the job")
        } else {
            ("storage_failed", "look into the server's log and at its disk, then retry the job")
        };
        failed(code, error.to_string(), None, hint)
    }
}

impl From<DatabaseError> for WorkError {
    fn from(error: DatabaseError) -> Self {
        match error {
            DatabaseError::Full => {
                failed("storage_full", error.to_string(), None, "free space on the server's disk, then retry the job")
            }
            DatabaseError::Locked | DatabaseError::Busy => WorkError::Later(error.to_string()),
            error if error.is_shortage() || error.is_unreachable() => WorkError::Later(error.to_string()),
            error => {
                failed("storage_failed", error.to_string(), None, "look into the server's log, then retry the job")
            }
        }
    }
}

/// Has files kept from a job's thread. While what keeps them can't be reached it is tried again, as long as the job may: what was
/// computed is worth more. Each attempt takes some seconds by itself, and is announced anew: what was expected for an hour counts
/// as given up.
pub(super) fn kept(
    progress: &Progress,
    expect: impl Fn() -> Result<(), WorkError>,
    keep: impl Fn() -> Result<(), ObjectError>,
) -> Result<(), WorkError> {
    loop {
        expect()?;
        match keep() {
            Err(error) if error.is_unreachable() => {
                tracing::warn!("the job's files wait to be kept: {error}");
                progress.waits()?;
            }
            done => return Ok(done?),
        }
    }
}

/// Waits for the database from a job's thread. While another program holds the database's lock, or its server can't be
/// reached, it is tried again: what was computed is worth more than a few seconds.
pub(super) fn stored<T, F: Future<Output = Result<T, DatabaseError>>>(
    runtime: &Handle,
    progress: &Progress,
    ask: impl Fn() -> F,
) -> Result<T, WorkError> {
    loop {
        match runtime.block_on(ask()) {
            Err(DatabaseError::Locked | DatabaseError::Busy) => progress.waits()?,
            Err(error) if error.is_unreachable() => progress.waits()?,
            done => return Ok(done?),
        }
    }
}

impl From<PipelineError> for WorkError {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Canceled(Canceled) => WorkError::Stopped,
            PipelineError::Unusable { code, scan, message, hint } => failed(code, message, scan, hint),
        }
    }
}

impl From<serde_json::Error> for WorkError {
    /// A report that can't be written.
    fn from(error: serde_json::Error) -> Self {
        defect(error.to_string())
    }
}

pub(super) fn failed(
    code: &str,
    message: impl Into<String>,
    scan: Option<String>,
    hint: impl Into<String>,
) -> WorkError {
    WorkError::Failed(JobError { code: code.to_owned(), message: message.into(), scan, hint: hint.into() })
}

fn defect(message: String) -> WorkError {
    failed(
        "internal_panic",
        message,
        None,
        "this is a defect of visage, not of the scans: please report it with the job's id; other jobs are not affected",
    )
}

/// Runs work inside a rayon pool of its own. A panic anywhere ends this work alone.
pub(super) fn pooled<T: Send>(
    threads: usize,
    work: impl FnOnce() -> Result<T, WorkError> + Send,
) -> Result<T, WorkError> {
    let pool = workers("job-worker", threads)
        .map_err(|error| WorkError::Later(format!("starting {threads} threads: {error}")))?;
    // nothing that the work holds is looked at after a panic
    std::panic::catch_unwind(AssertUnwindSafe(|| pool.install(work)))
        .unwrap_or_else(|payload| Err(defect(format!("a stage ended in a panic: {}", panic_message(&*payload)))))
}

/// A scan, what of its file was not taken, and the unit that it declares.
type Loaded = (NamedScan, Dropped, Option<DeclaredUnit>);

impl Work {
    /// Does the job. A panic anywhere ends this job alone.
    pub(super) fn run(self) -> Result<Made, WorkError> {
        pooled(self.threads, || self.make())
    }

    fn make(&self) -> Result<Made, WorkError> {
        let mut plan = self.plan()?;
        let mut scans = Vec::new();
        let mut dropped = BTreeMap::new();
        let mut declared = Vec::new();
        for (scan, of_scan, unit) in self.load(&plan.names)? {
            dropped.insert(scan.name.clone(), of_scan);
            declared.push(unit);
            scans.push(scan);
        }
        let given = Some(self.set.unit).filter(|unit| *unit != Unit::Unknown);
        let units: Vec<_> = plan.names.iter().map(String::as_str).zip(declared).collect();
        let mut settled = units::settle(given, &units, &plan.start.hints.units)?;
        settled.apply(&mut scans, &mut plan.start);
        let mut outcome = self.engine.register(scans, &plan.start, settled.unit, &self.job.options, &self.progress)?;
        settled.undo(&plan.names, &mut outcome);
        artifacts::add_readings(&mut outcome.report, &dropped, &plan.notes);
        self.progress.check()?;
        self.progress.report(Stage::Storing, 0.0);
        self.keep(outcome, settled.unit)
    }

    /// What is registered, and from where. It was checked when the job was accepted; the set can't have changed since.
    fn plan(&self) -> Result<Plan, WorkError> {
        let names: Vec<&str> = self.set.scans.iter().map(|scan| scan.name.as_str()).collect();
        let base = self.job.base.as_ref().map(|base| base.poses.as_slice());
        let plan = admission::plan(&names, self.set.poses.as_ref(), base, &self.job.options, &self.job.hints);
        plan.map_err(|error| match error {
            admission::AdmissionError::Unfit(error) => error.into(),
            error => {
                failed("unusable_poses", error.to_string(), None, "send a sound pose file or none, then retry the job")
            }
        })
    }

    /// Reads the scans of these names, in their order; with what of their files was not taken, and the units that they
    /// declare.
    fn load(&self, names: &[String]) -> Result<Vec<Loaded>, WorkError> {
        self.progress.report(Stage::Loading, 0.0);
        let stored: BTreeMap<&str, &ScanRecord> =
            self.set.scans.iter().map(|scan| (scan.name.as_str(), scan)).collect();
        let views: Vec<&ScanRecord> = names.iter().filter_map(|name| stored.get(name.as_str()).copied()).collect();
        let loaded = AtomicUsize::new(0);
        let of_scans: Vec<Result<Loaded, WorkError>> = views
            .par_iter()
            .map(|scan| {
                self.progress.check()?;
                let named = self.load_one(scan)?;
                let count = loaded.fetch_add(1, Ordering::Relaxed) + 1;
                self.progress.report(Stage::Loading, count as f64 / views.len() as f64);
                Ok(named)
            })
            .collect();
        // of several errors the first scan's, whichever thread met its own first
        of_scans.into_iter().collect()
    }

    fn load_one(&self, scan: &ScanRecord) -> Result<Loaded, WorkError> {
        let bytes = self.objects.read_scan(self.set.id, scan).map_err(|error| match error {
            ObjectError::Damaged { .. } => {
                let message = format!("the stored file of scan {} is not what was uploaded", scan.name);
                failed("damaged_scan", message, Some(scan.name.clone()), "upload the scan again")
            }
            error => error.into(),
        })?;
        let reading = visage_formats::read(&scan.name, &bytes, &self.limits.read_limits()).map_err(|error| {
            failed("unreadable_scan", error.to_string(), Some(scan.name.clone()), "upload a sound file of the scan")
        })?;
        Ok((NamedScan { name: scan.name.clone(), surface: reading.surface }, reading.dropped, reading.unit))
    }

    /// Writes the model's files and moves them to where they belong.
    fn keep(&self, outcome: RegisteredModel, unit: Unit) -> Result<Made, WorkError> {
        let staged = self.objects.stage_model()?;
        let mut assets = Vec::new();
        let run = || artifacts::RunFacts::here(Some(self.job.id.to_string()), self.threads, self.tracker.snapshot());
        artifacts::write_assets(&outcome, run, |asset, content| -> Result<(), WorkError> {
            self.progress.check()?;
            assets.push(self.write_asset(&staged, &asset.name(), content)?);
            if asset == Asset::Cloud {
                self.progress.report(Stage::Storing, 0.5);
            }
            Ok(())
        })?;
        let id = ModelId::new();
        let coming = [StoredFile::Model(id)];
        let expect = || stored(&self.runtime, &self.progress, || self.database.expect_files(&coming));
        kept(&self.progress, expect, || self.objects.keep_model(&staged, id))?;
        Ok(Made { model: self.model(id, &outcome, unit, assets), signature: outcome.signature })
    }

    fn model(&self, id: ModelId, outcome: &RegisteredModel, unit: Unit, assets: Vec<AssetRecord>) -> NewModel {
        let scanned: u64 = self.set.scans.iter().map(|scan| scan.points).sum();
        NewModel {
            id,
            origin: Some((self.job.id, Some(self.set.id))),
            name: self.set.name.clone(),
            label: self.job.label.clone(),
            unit,
            points: outcome.cloud.as_ref().map_or(scanned, |merged| merged.cloud.len() as u64),
            quality: Some(outcome.report.registration.verdict.quality.name().to_owned()),
            assets,
            reading: None,
            signature: outcome.signature.as_ref().map(Into::into),
        }
    }

    fn write_asset(&self, staged: &StagedModel, name: &str, content: &[u8]) -> Result<AssetRecord, ObjectError> {
        let checksum = self.objects.write_asset(staged, name, content)?;
        Ok(AssetRecord { name: name.to_owned(), bytes: content.len() as u64, checksum })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_does_not_fail_for_good_because_too_many_files_are_open() {
        let io =
            |code: i32| ObjectError::Io { doing: "reading a scan", source: std::io::Error::from_raw_os_error(code) };
        let of = |error: ObjectError| WorkError::from(error);
        assert!(matches!(of(io(nix::errno::Errno::EMFILE as i32)), WorkError::Later(_)));
        assert!(
            matches!(of(io(nix::errno::Errno::EIO as i32)), WorkError::Failed(error) if error.code == "storage_failed")
        );
        assert!(
            matches!(of(io(nix::errno::Errno::ENOSPC as i32)), WorkError::Failed(error) if error.code == "storage_full")
        );
    }
}
