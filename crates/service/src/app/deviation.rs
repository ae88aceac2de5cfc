//! How far a model is from another one of the same frame.

use super::context::ServiceContext;
use crate::storage::{DatabaseError, ObjectError};
use visage_domain::asset::{Asset, Kind};
use visage_domain::{AssetRecord, ModelId};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Surface, Unit};
use visage_pipeline::deviation::{Deviation, FormatError, read_surface};
pub use visage_pipeline::deviation::{DeviationReport, Question};

/// Two models by the files that describe them best.
#[derive(Debug, Clone)]
pub struct Pair {
    models: [(ModelId, AssetRecord); 2],
    unit: Unit,
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
    /// A model without cloud and mesh.
    #[error("model {0} has neither mesh nor cloud")]
    NoSurface(ModelId),
    /// Lengths can't be compared.
    #[error("the model is in {}, the reference in {}", .0.name(), .1.name())]
    OtherUnit(Unit, Unit),
    /// A stored file is not what it was.
    #[error("a stored surface can't be read: {0}")]
    Unreadable(#[from] FormatError),
    /// Nobody waits any more.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The files.
    #[error(transparent)]
    Objects(#[from] ObjectError),
}

impl Pair {
    /// The model and its reference, if both have a surface and one unit.
    pub async fn find(context: &ServiceContext, model: ModelId, reference: ModelId) -> Result<Pair, DeviationError> {
        let (one, other) = (best(context, model).await?, best(context, reference).await?);
        if one.1 != other.1 {
            return Err(DeviationError::OtherUnit(one.1, other.1));
        }
        Ok(Pair { models: [(model, one.0), (reference, other.0)], unit: one.1 })
    }

    /// The unit of both.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The bytes of both files.
    pub fn bytes(&self) -> u64 {
        self.models.iter().map(|(_, asset)| asset.bytes).sum()
    }

    /// Reads both and measures them. Blocks; runs inside the caller's rayon pool.
    pub fn measured(
        &self,
        context: &ServiceContext,
        question: Question,
        progress: &Progress,
    ) -> Result<Measured, DeviationError> {
        let [surface, other] = [self.read(context, 0)?, self.read(context, 1)?];
        progress.check()?;
        let deviation = Deviation::measured(&surface, &other, question, progress)?;
        let deviation = deviation.ok_or(DeviationError::NoSurface(self.models[0].0))?;
        let names = self.models.each_ref().map(|(_, asset)| asset.name.clone());
        Ok(Measured { names, deviation, surface })
    }

    fn read(&self, context: &ServiceContext, index: usize) -> Result<Surface, DeviationError> {
        let (id, asset) = &self.models[index];
        let bytes = context.objects.read_asset(*id, asset)?.ok_or(DeviationError::NoSurface(*id))?;
        Ok(read_surface(&asset.name, &bytes, &context.config.limits.read_limits())?)
    }
}

/// The file that describes a model best, a mesh before a cloud, and its unit.
async fn best(context: &ServiceContext, id: ModelId) -> Result<(AssetRecord, Unit), DeviationError> {
    let model = context.database.model(id).await?;
    let known = context.database.assets(id).await?;
    let of_kind = |kind: Kind| {
        let assets = Asset::of(model.origin()).into_iter();
        let wanted = assets.filter(move |asset| asset.role().kind == kind && !asset.is_coarse_copy());
        wanted.map(Asset::name).find_map(|name| known.iter().find(|record| record.name == name))
    };
    let asset = of_kind(Kind::Mesh).or_else(|| of_kind(Kind::Cloud)).ok_or(DeviationError::NoSurface(id))?;
    Ok((asset.clone(), model.unit))
}
