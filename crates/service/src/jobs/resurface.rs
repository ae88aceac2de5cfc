//! One job that gives a stored model a surface: a model of its own, with the cloud of the other and a mesh made anew.
//!
//! Files of a model never change. What is made here is a copy without a signature: the gallery goes on to find the model that
//! it was made from, and only that.

use std::sync::Arc;

use tokio::runtime::Handle;

use super::artifacts::{self, RunFacts};
use super::work::{Made, WorkError, failed, kept, stored};
use crate::app::tracker::Tracker;
use crate::config::Limits;
use crate::storage::{Database, DatabaseError, ObjectError, ObjectStore, StagedModel};
use visage_domain::asset::{Asset, Kind, Origin};
use visage_domain::{AssetRecord, JobRecord, ModelId, ModelRecord, NewModel, StoredFile};
use visage_formats::{ReadLimits, gltf, ply};
use visage_geometry::progress::{Progress, Stage};
use visage_geometry::{Cloud, Surface};
use visage_pipeline::deface::cut;
use visage_pipeline::orient::orient;
use visage_pipeline::report::ResurfacedReport;
use visage_pipeline::surface::{Seen, make_surface};
use visage_shape::faces::{FaceExtent, Signature};

/// Everything one such job needs.
pub(super) struct Resurfacing {
    pub job: JobRecord,
    /// The model that it works on.
    pub model: ModelId,
    pub database: Arc<dyn Database>,
    /// The runtime that the database runs on; this work runs on a thread of its own.
    pub runtime: Handle,
    pub objects: Arc<dyn ObjectStore>,
    pub limits: Limits,
    pub threads: usize,
    pub tracker: Arc<Tracker>,
    pub progress: Progress,
}

/// The points of a model, with the scan of each if that is known.
struct Points {
    surface: Surface,
    views: Option<Vec<u16>>,
}

impl Resurfacing {
    /// Does the job. Runs inside a rayon pool.
    pub(super) fn run(&self) -> Result<Made, WorkError> {
        self.progress.report(Stage::Loading, 0.0);
        let model = match self.runtime.block_on(self.database.model(self.model)) {
            Err(DatabaseError::NotFound { .. }) => return Err(gone()),
            model => model?,
        };
        let assets = self.stored(|| self.database.assets(self.model))?;
        let Points { surface, views: of_points } = self.points(&model, &assets)?;
        self.progress.report(Stage::Preparing, 0.0);
        let extent = if self.job.options.deface { self.face()? } else { None };
        let made = orient(&surface, of_points.as_deref(), &self.progress)?;
        drop(surface);
        let seen = Seen { views: made.views.as_deref(), free_space: None };
        let order = (&self.job.options).into();
        let found = make_surface(&made.cloud, seen, made.spacing, &order, &self.progress)?;
        let mut found = found.ok_or_else(|| {
            let hint = "send a denser cloud, or one with normals that point outward";
            failed("no_surface", "the points of the model make no surface", None, hint)
        })?;
        let mut cloud = made.cloud;
        let mut views = made.views;
        if let Some(extent) = &extent {
            cut(extent, &mut cloud, views.as_mut(), Some(&mut found));
        }
        self.progress.check()?;
        self.progress.report(Stage::Storing, 0.0);
        let report = ResurfacedReport {
            of_model: self.model.to_string(),
            unit: model.unit.name(),
            normals: made.normals,
            spacing: made.spacing,
            surface: found.report,
            face_cut: self.job.options.deface.then_some(extent.is_some()),
        };
        let staged = self.objects.stage_model()?;
        let mut records = Vec::new();
        let mut write = |asset: Asset, content: Option<Vec<u8>>| -> Result<(), WorkError> {
            self.progress.check()?;
            if let Some(content) = content {
                records.push(self.write(&staged, asset, &content)?);
            }
            Ok(())
        };
        for asset in [Asset::Poses, Asset::PosesConf] {
            write(asset, self.copied(&model, &assets, asset)?)?;
        }
        write(Asset::Cloud, Some(ply::write_cloud(&cloud, views.as_deref())))?;
        write(Asset::Mesh, artifacts::write_mesh(&found.surface, model.unit, &ply::FORMAT))?;
        for (asset, copy) in [(Asset::Medium, &found.medium), (Asset::Preview, &found.preview)] {
            write(asset, copy.as_ref().and_then(|copy| artifacts::write_mesh(copy, model.unit, &gltf::GLB)))?;
        }
        let run = RunFacts::here(Some(self.job.id.to_string()), self.threads, self.tracker.snapshot());
        write(Asset::Report, Some(artifacts::report_json(report.to_json(), &run)?))?;
        let id = ModelId::new();
        let coming = [StoredFile::Model(id)];
        let expect = || self.stored(|| self.database.expect_files(&coming));
        kept(&self.progress, expect, || self.objects.keep_model(&staged, id))?;
        Ok(Made { model: self.model_of(id, &model, &cloud, records), signature: None })
    }

    fn stored<T, F: Future<Output = Result<T, DatabaseError>>>(&self, ask: impl Fn() -> F) -> Result<T, WorkError> {
        stored(&self.runtime, &self.progress, ask)
    }

    /// The points of a model: of what a registration made its cloud, of an upload the file.
    fn points(&self, model: &ModelRecord, assets: &[AssetRecord]) -> Result<Points, WorkError> {
        let upload = || if model.origin() == Origin::Uploaded { model.whole(assets, Kind::Mesh) } else { None };
        let asset = model.whole(assets, Kind::Cloud).or_else(upload).ok_or_else(|| {
            let hint = "register the scans again with options.cloud, or upload a cloud";
            failed("no_cloud", "the model has no cloud", None, hint)
        })?;
        let bytes = self.read(asset)?;
        let limits: ReadLimits = self.limits.read_limits();
        let surface = visage_formats::read_surface(&asset.name, &bytes, &limits)
            .map_err(|error| failed("unreadable_model", error.to_string(), None, "upload a sound file of the model"))?;
        let views = ply::views(&bytes).filter(|views| views.len() == surface.cloud.len());
        // the triangles of an upload are not what the new ones are made from
        Ok(Points { surface: Surface { faces: Vec::new(), ..surface }, views })
    }

    /// Where the face of the model is, by its signature.
    fn face(&self) -> Result<Option<FaceExtent>, WorkError> {
        let bytes = self.stored(|| self.database.signature(self.model))?;
        Ok(bytes.and_then(|bytes| Signature::from_bytes(&bytes).ok()).and_then(|signature| FaceExtent::of(&signature)))
    }

    /// A file of the model as it is, if it has it.
    fn copied(&self, model: &ModelRecord, assets: &[AssetRecord], asset: Asset) -> Result<Option<Vec<u8>>, WorkError> {
        let known = assets.iter().find(|record| model.origin() == Origin::Registered && record.name == asset.name());
        known.map(|record| self.read(record)).transpose()
    }

    fn read(&self, asset: &AssetRecord) -> Result<Vec<u8>, WorkError> {
        self.objects.read_asset(self.model, asset)?.ok_or_else(gone)
    }

    fn write(&self, staged: &StagedModel, asset: Asset, content: &[u8]) -> Result<AssetRecord, ObjectError> {
        let name = asset.name();
        let checksum = self.objects.write_asset(staged, &name, content)?;
        Ok(AssetRecord { name: name.into_owned(), bytes: content.len() as u64, checksum })
    }

    fn model_of(&self, id: ModelId, from: &ModelRecord, cloud: &Cloud, assets: Vec<AssetRecord>) -> NewModel {
        NewModel {
            id,
            origin: Some((self.job.id, from.scan_set_id)),
            name: from.name.clone(),
            label: self.job.label.clone().or_else(|| from.label.clone()),
            unit: from.unit,
            points: cloud.len() as u64,
            quality: from.quality.clone(),
            assets,
            reading: None,
            signature: None,
        }
    }
}

fn gone() -> WorkError {
    failed("model_gone", "the model was deleted", None, "name a model that is there")
}
