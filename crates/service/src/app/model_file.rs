//! The file that describes a model best, to measure on.

use super::context::ServiceContext;
use crate::storage::{DatabaseError, ObjectError};
use visage_domain::asset::Kind;
use visage_domain::{AssetRecord, ModelId};
use visage_geometry::{Surface, Unit};
use visage_pipeline::deviation::{FormatError, read_surface};

/// A model by that file.
#[derive(Debug, Clone)]
pub struct ModelFile {
    /// The model.
    pub id: ModelId,
    /// Its file: a mesh before a cloud.
    pub asset: AssetRecord,
    /// The unit of its coordinates.
    pub unit: Unit,
}

/// Why there is nothing to measure on.
#[derive(Debug, thiserror::Error)]
pub enum ModelFileError {
    /// A model without cloud and mesh.
    #[error("model {0} has neither mesh nor cloud")]
    NoSurface(ModelId),
    /// A stored file is not what it was.
    #[error("a stored surface can't be read: {0}")]
    Unreadable(#[from] FormatError),
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The files.
    #[error(transparent)]
    Objects(#[from] ObjectError),
}

impl ModelFile {
    /// Looks it up.
    pub async fn find(context: &ServiceContext, id: ModelId) -> Result<ModelFile, ModelFileError> {
        let model = context.database.model(id).await?;
        let known = context.database.assets(id).await?;
        let whole = |kind: Kind| model.whole(&known, kind);
        let asset = whole(Kind::Mesh).or_else(|| whole(Kind::Cloud)).ok_or(ModelFileError::NoSurface(id))?;
        Ok(ModelFile { id, asset: asset.clone(), unit: model.unit })
    }

    /// Looks it up; `None` if the model has none, or is gone.
    pub async fn find_if_there(context: &ServiceContext, id: ModelId) -> Result<Option<ModelFile>, ModelFileError> {
        match ModelFile::find(context, id).await {
            Ok(file) => Ok(Some(file)),
            Err(ModelFileError::NoSurface(_) | ModelFileError::Database(DatabaseError::NotFound { .. })) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Reads it. Blocks.
    pub fn read(&self, context: &ServiceContext) -> Result<Surface, ModelFileError> {
        let bytes = context.objects.read_asset(self.id, &self.asset)?.ok_or(ModelFileError::NoSurface(self.id))?;
        Ok(read_surface(&self.asset.name, &bytes, &context.config.limits.read_limits())?)
    }
}
