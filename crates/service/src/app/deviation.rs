//! How far a model is from another one of the same frame.

use super::context::ServiceContext;
use super::model_file::{ModelFile, ModelFileError};
use visage_domain::ModelId;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Surface, Unit};
use visage_pipeline::deviation::Deviation;
pub use visage_pipeline::deviation::{DeviationReport, Question};

/// Two models by the files that describe them best.
#[derive(Debug, Clone)]
pub struct Pair {
    models: [ModelFile; 2],
}

/// What was measured.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The files that were measured.
    pub names: [String; 2],
    /// The distances.
    pub deviation: Deviation,
    /// The model.
    surface: Surface,
}

impl Measured {
    /// The model as PLY in the colours of its distances.
    pub fn coloured(self, limit: Option<f64>) -> Vec<u8> {
        self.deviation.coloured(self.surface, limit)
    }
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum DeviationError {
    /// Lengths can't be compared.
    #[error("the model is in {}, the reference in {}", .0.name(), .1.name())]
    OtherUnit(Unit, Unit),
    /// A model has no surface, or its file can't be read.
    #[error(transparent)]
    File(#[from] ModelFileError),
    /// Nobody waits any more.
    #[error(transparent)]
    Canceled(#[from] Canceled),
}

impl Pair {
    /// The model and its reference, if both have a surface and one unit.
    pub async fn find(context: &ServiceContext, model: ModelId, reference: ModelId) -> Result<Pair, DeviationError> {
        let models = [ModelFile::find(context, model).await?, ModelFile::find(context, reference).await?];
        if models[0].unit != models[1].unit {
            return Err(DeviationError::OtherUnit(models[0].unit, models[1].unit));
        }
        Ok(Pair { models })
    }

    /// The unit of both.
    pub fn unit(&self) -> Unit {
        self.models[0].unit
    }

    /// The bytes of both files.
    pub fn bytes(&self) -> u64 {
        self.models.iter().map(|model| model.asset.bytes).sum()
    }

    /// Reads both and measures them. Blocks; runs inside the caller's rayon pool.
    pub fn measured(
        &self,
        context: &ServiceContext,
        question: Question,
        progress: &Progress,
    ) -> Result<Measured, DeviationError> {
        let [surface, other] = [self.models[0].read(context)?, self.models[1].read(context)?];
        progress.check()?;
        let deviation = Deviation::measured(&surface, &other, question, progress)?;
        let deviation = deviation.ok_or(ModelFileError::NoSurface(self.models[0].id))?;
        let names = self.models.each_ref().map(|model| model.asset.name.clone());
        Ok(Measured { names, deviation, surface })
    }
}
