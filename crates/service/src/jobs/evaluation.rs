//! Brings what is known of the stored models up to date: signatures of another version, and verdicts against standards.
//!
//! Everything that is done is written at once, so a job that is stopped or crashes goes on where it stood. Writes need
//! no guard by the lease: whoever makes them makes the same.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use tokio::runtime::Handle;

use super::work::{WorkError, stored};
use crate::app::engine::Engine;
use crate::app::live_gallery::LiveGallery;
use crate::config::Limits;
use crate::storage::{Database, DatabaseError, ObjectError, ObjectStore};
use visage_domain::asset::Asset;
use visage_domain::{ModelId, ModelRecord, Outdated, StandardId, StandardRecord, StoredSignature, StoredVerdict};
use visage_geometry::Surface;
use visage_geometry::progress::{Progress, Stage};
use visage_shape::faces::{DescribeError, Signature};
use visage_shape::standards::{Standard, StandardError, limit};

/// Models that are asked for at a time.
const BATCH: usize = 32;

/// Everything an evaluation needs.
pub(super) struct Evaluation {
    pub database: Arc<dyn Database>,
    pub objects: Arc<dyn ObjectStore>,
    pub gallery: LiveGallery,
    pub engine: Arc<dyn Engine>,
    pub limits: Limits,
    pub progress: Progress,
    /// The runtime that the database runs on; this work runs on a thread of its own.
    pub runtime: Handle,
}

impl Evaluation {
    /// Does all that is to be done, and what comes up meanwhile. Runs inside a rayon pool. On a full disk it waits in
    /// the queue until there is space: nobody else would ask for it again.
    pub(super) fn run(&self) -> Result<(), WorkError> {
        match self.make() {
            Err(WorkError::Failed(error)) if error.code == "storage_full" => Err(WorkError::Later(error.message)),
            done => done,
        }
    }

    fn stored<T, F: Future<Output = Result<T, DatabaseError>>>(&self, ask: impl Fn() -> F) -> Result<T, WorkError> {
        stored(&self.runtime, &self.progress, ask)
    }

    fn make(&self) -> Result<(), WorkError> {
        self.progress.report(Stage::Describing, 0.0);
        let backlog = self.stored(|| self.database.backlog())?;
        let all = (backlog.stale_signatures + backlog.missing_verdicts).max(1) as f64;
        let (mut done, mut failed) = (0usize, BTreeSet::new());
        let mut after = None;
        loop {
            let standards = self.standards()?;
            let batch = self.stored(|| self.database.outdated(after, BATCH))?;
            let due: Vec<Outdated> = batch.iter().filter(|model| !failed.contains(&model.model_id)).cloned().collect();
            // the end of a pass: another one begins, and ends the job if it finds nothing
            after = batch.last().filter(|_| batch.len() == BATCH).map(|model| model.model_id);
            if due.is_empty() && after.is_none() {
                return Ok(());
            }
            for model in &due {
                self.progress.check()?;
                // it may be long, and what is done is kept: people wait for registrations
                if self.stored(|| self.database.registration_waits())? {
                    return Err(WorkError::GivesWay);
                }
                if !self.renew(model, &standards)? {
                    failed.insert(model.model_id);
                }
                done += usize::from(model.signature) + model.standards.len();
                self.progress.report(Stage::Describing, done as f64 / all);
            }
        }
    }

    /// All standards; those of another version are made anew.
    fn standards(&self) -> Result<BTreeMap<StandardId, Standard>, WorkError> {
        let mut standards = BTreeMap::new();
        for standard in self.stored(|| self.database.standards())? {
            let id = standard.id;
            if standard.definition.version == Standard::VERSION {
                standards.insert(id, standard.definition);
            } else if let Some(made) = self.remade(&standard)? {
                self.stored(|| self.database.renew_standard(id, &made))?;
                standards.insert(id, made);
            }
        }
        Ok(standards)
    }

    fn remade(&self, standard: &StandardRecord) -> Result<Option<Standard>, WorkError> {
        let bytes = match self.objects.read_standard(standard.id, &standard.asset) {
            Err(error @ ObjectError::Damaged { .. }) => {
                tracing::error!(standard = standard.name, "a standard can't be made anew: {error}");
                return Ok(None);
            }
            read => read?,
        };
        let surface = match visage_formats::read_surface(&standard.asset.name, &bytes, &self.limits.read_limits()) {
            Ok(surface) => surface,
            Err(error) => {
                tracing::warn!(standard = standard.name, "a standard can't be made anew: {error}");
                return Ok(None);
            }
        };
        match self.engine.annotate(&surface, standard.unit, &standard.annotation, &self.progress.muted()) {
            Ok(made) => Ok(Some(made)),
            Err(StandardError::Canceled(canceled)) => Err(canceled.into()),
            Err(error) => {
                tracing::warn!(standard = standard.name, "a standard can't be made anew: {error}");
                Ok(None)
            }
        }
    }

    /// Makes what a model lacks; false if something could not be made, so that it isn't tried again by this job.
    fn renew(&self, outdated: &Outdated, standards: &BTreeMap<StandardId, Standard>) -> Result<bool, WorkError> {
        let id = outdated.model_id;
        let model = match self.runtime.block_on(self.database.model(id)) {
            Ok(model) => model,
            // deleted meanwhile
            Err(DatabaseError::NotFound { .. }) => return Ok(true),
            Err(error) => return Err(error.into()),
        };
        let surface = self.surface(&model)?;
        let is_signed = !outdated.signature || self.sign(&model, surface.as_ref().ok())?;
        let known: Vec<(StandardId, &Standard)> =
            outdated.standards.iter().filter_map(|id| Some((*id, standards.get(id)?))).collect();
        let verdicts = self.judge(&model, &surface, &known)?;
        self.stored(|| self.database.keep_verdicts(&verdicts))?;
        // a standard that came since this pass was begun has a job of its own waiting
        Ok(is_signed && known.len() == outdated.standards.len())
    }

    /// The surface of a model, or why there is none.
    fn surface(&self, model: &ModelRecord) -> Result<Result<Surface, String>, WorkError> {
        let assets = self.stored(|| self.database.assets(model.id))?;
        for name in Asset::describing(model.origin()) {
            let Some(asset) = assets.iter().find(|asset| asset.name == name) else { continue };
            match self.objects.read_asset(model.id, asset) {
                Ok(Some(bytes)) => {
                    let surface = visage_formats::read_surface(&name, &bytes, &self.limits.read_limits());
                    return Ok(surface.map_err(|error| error.to_string()));
                }
                Ok(None) => {}
                Err(error @ ObjectError::Damaged { .. }) => {
                    tracing::error!("{error}; `visage doctor` tells what else is");
                    return Ok(Err(error.to_string()));
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(Err("the model has neither mesh nor cloud".to_owned()))
    }

    /// Makes a model's signature anew; false if that is not possible.
    fn sign(&self, model: &ModelRecord, surface: Option<&Surface>) -> Result<bool, WorkError> {
        let Some(surface) = surface else { return Ok(false) };
        match self.engine.describe(surface, model.unit, &self.progress.muted()) {
            Ok(signature) => self.publish(model.id, signature),
            Err(DescribeError::Canceled(canceled)) => Err(canceled.into()),
            Err(error) => {
                tracing::warn!(model.id = %model.id, "a signature can't be made anew: {error}");
                Ok(false)
            }
        }
    }

    fn publish(&self, id: ModelId, signature: Signature) -> Result<bool, WorkError> {
        let stored: StoredSignature = (&signature).into();
        if let Some(unseen) = self.stored(|| self.database.renew_signature(id, &stored))? {
            self.stored(|| self.gallery.publish(self.database.as_ref(), id, signature.clone()))?;
            drop(unseen);
        }
        Ok(true)
    }

    fn judge(
        &self,
        model: &ModelRecord,
        surface: &Result<Surface, String>,
        standards: &[(StandardId, &Standard)],
    ) -> Result<Vec<StoredVerdict>, WorkError> {
        if standards.is_empty() {
            return Ok(Vec::new());
        }
        let sought: Vec<&Standard> = standards.iter().map(|(_, standard)| *standard).collect();
        let found = match surface {
            Err(reason) => Err(reason.clone()),
            Ok(surface) => match self.engine.find(&sought, surface, model.unit, &self.progress.muted()) {
                Ok(found) => Ok(found),
                Err(DescribeError::Canceled(canceled)) => return Err(canceled.into()),
                Err(error) => Err(error.to_string()),
            },
        };
        let verdict = |(place, (standard_id, _)): (usize, &(StandardId, &Standard))| {
            let place = found.as_ref().map(|found| found.get(place).copied().flatten());
            StoredVerdict {
                standard_id: *standard_id,
                model_id: model.id,
                residual_mm: place.as_ref().ok().copied().flatten().map_or(limit::NOTHING_FOUND_MM, |f| f.residual_mm),
                found: place.as_ref().ok().copied().flatten(),
                reason: place.err().cloned(),
            }
        };
        Ok(standards.iter().enumerate().map(verdict).collect())
    }
}
