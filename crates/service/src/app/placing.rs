//! Where a probe lies on models that are stored.

use super::context::ServiceContext;
use super::model_file::{ModelFile, ModelFileError};
use visage_domain::ModelId;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Surface, Unit};
use visage_pipeline::placing::{Placeable, place};
pub use visage_pipeline::placing::{Placed, Pose};
use visage_shape::faces::DescribeError;

/// A probe that is to be laid onto models.
#[derive(Debug, Clone)]
pub enum Probe {
    /// A stored model.
    Stored(ModelId),
    /// A surface that is not stored, and its unit.
    Surface(Box<Surface>, Unit),
}

/// A probe and models, by their files.
#[derive(Debug, Clone)]
pub struct Placing {
    probe: ProbeFile,
    /// `None` for a model that has gone, or has no surface any more.
    models: Vec<Option<ModelFile>>,
}

#[derive(Debug, Clone)]
enum ProbeFile {
    Stored(ModelFile),
    Surface(Box<Surface>, Unit),
}

/// Why nothing was laid anywhere.
#[derive(Debug, thiserror::Error)]
pub enum PlacingError {
    /// A file can't be read.
    #[error(transparent)]
    File(#[from] ModelFileError),
    /// The probe can't be laid onto anything.
    #[error("the probe can't be laid onto models: {0}")]
    Probe(DescribeError),
    /// Nobody waits any more.
    #[error(transparent)]
    Canceled(#[from] Canceled),
}

impl Placing {
    /// Finds the files.
    pub async fn find(
        context: &ServiceContext,
        probe: Probe,
        models: impl IntoIterator<Item = ModelId>,
    ) -> Result<Placing, ModelFileError> {
        let probe = match probe {
            Probe::Stored(id) => ProbeFile::Stored(ModelFile::find(context, id).await?),
            Probe::Surface(surface, unit) => ProbeFile::Surface(surface, unit),
        };
        let mut found = Vec::new();
        for id in models {
            found.push(ModelFile::find_if_there(context, id).await?);
        }
        Ok(Placing { probe, models: found })
    }

    /// The bytes of the largest files that are in memory together.
    pub fn bytes(&self) -> u64 {
        let probe = match &self.probe {
            ProbeFile::Stored(file) => file.asset.bytes,
            ProbeFile::Surface(..) => 0,
        };
        probe + self.models.iter().flatten().map(|file| file.asset.bytes).max().unwrap_or(0)
    }

    /// Lays the probe onto each of the models, one after the other; `None` for one that is gone or has no area. Blocks; runs inside the
    /// caller's rayon pool.
    pub fn run(self, context: &ServiceContext, progress: &Progress) -> Result<Vec<Option<Placed>>, PlacingError> {
        let (surface, unit) = match self.probe {
            ProbeFile::Stored(file) => (Box::new(file.read(context)?), file.unit),
            ProbeFile::Surface(surface, unit) => (surface, unit),
        };
        let probe = match Placeable::new(&surface, progress) {
            Ok(probe) => probe,
            Err(DescribeError::Canceled(canceled)) => return Err(canceled.into()),
            Err(error) => return Err(PlacingError::Probe(error)),
        };
        drop(surface);
        let on = |file: ModelFile| -> Result<Option<Placed>, PlacingError> {
            let Some(probe) = &probe else { return Ok(None) };
            let Some(model) = placeable(context, &file, progress)? else { return Ok(None) };
            Ok(place(probe, &model, known_scale(unit, file.unit), progress)?)
        };
        self.models.into_iter().map(|file| file.map_or(Ok(None), &on)).collect()
    }
}

/// A stored model made ready; `None` if it can't be laid onto anything, or is gone.
pub(super) fn placeable(
    context: &ServiceContext,
    file: &ModelFile,
    progress: &Progress,
) -> Result<Option<Placeable>, PlacingError> {
    let surface = match file.read(context) {
        Ok(surface) => surface,
        Err(ModelFileError::NoSurface(_)) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    match Placeable::new(&surface, progress) {
        Ok(model) => Ok(model),
        Err(DescribeError::Canceled(canceled)) => Err(canceled.into()),
        Err(DescribeError::Degenerate(_)) => Ok(None),
    }
}

/// Lengths on the model in one of the probe, if both units are known.
pub(super) fn known_scale(probe: Unit, model: Unit) -> Option<f64> {
    Some(probe.in_mm()? / model.in_mm()?)
}
