//! What stands out of a model, for those who draw it themselves.

use super::models::Stored;
use super::{PicturesError, check_memory};
use crate::app::context::ServiceContext;
use visage_domain::ModelId;
use visage_geometry::progress::Progress;
use visage_report::{Kind, saliency_ply};

/// What the saliency of a model is measured on.
#[derive(Debug, Clone)]
pub struct SaliencyMap {
    material: Stored,
    /// Stands for all that goes into it.
    pub tag: String,
}

impl SaliencyMap {
    /// Finds it.
    ///
    /// # Errors
    /// There is no such model, or it is too large for this machine.
    pub async fn find(context: &ServiceContext, id: ModelId) -> Result<SaliencyMap, PicturesError> {
        let mut material = Stored::find(context, id).await?;
        material.want(Kind::Saliency.sources());
        check_memory(context, material.points())?;
        let tag = material.tag(&[b"saliency.ply"]);
        Ok(SaliencyMap { material, tag })
    }

    /// The bytes of the file that has to be read.
    pub fn bytes(&self) -> u64 {
        self.material.bytes()
    }

    /// Reads and measures; a PLY. Blocks; runs inside the caller's rayon pool.
    pub fn made(&self, context: &ServiceContext, progress: &Progress) -> Result<Vec<u8>, PicturesError> {
        let material = self.material.read(context)?;
        progress.check()?;
        Ok(saliency_ply(material.surface, progress)?)
    }
}
