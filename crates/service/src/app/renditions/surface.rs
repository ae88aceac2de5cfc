//! The cloud or the mesh of a model in another format.

use std::sync::Arc;

use tokio::sync::Semaphore;

use super::{Desk, RenditionError, STORED, content, model_of, stage};
use crate::app::context::ServiceContext;
use crate::storage::StagedFile;
use visage_domain::asset::Kind;
use visage_domain::{AssetRecord, ModelId, ModelRecord};
use visage_formats::written::{Written, scaled};
use visage_formats::{Format, check_name, read_surface, write_mesh_of};

/// The stored file that others are made of.
#[derive(Debug)]
pub struct SurfaceSource {
    model: ModelRecord,
    /// The file.
    pub asset: AssetRecord,
    wanted: Written,
}

impl SurfaceSource {
    /// Finds it: for a mesh the mesh, for a cloud the cloud, or the vertices of a model that was uploaded as a mesh.
    pub async fn find(context: &ServiceContext, id: ModelId, wanted: Written) -> Result<Self, RenditionError> {
        let (model, assets) = model_of(context, id).await?;
        let kinds: &[Kind] = if wanted == Written::Mesh { &[Kind::Mesh] } else { &[Kind::Cloud, Kind::Mesh] };
        let (what, hint) = match wanted {
            Written::Mesh => ("mesh", "register the scans with the option mesh, or fetch the cloud"),
            _ => ("cloud", "register the scans with the option cloud"),
        };
        let asset = kinds.iter().find_map(|kind| model.whole(&assets, *kind)).cloned();
        let asset = asset.ok_or(RenditionError::Missing { model: id, what, hint })?;
        Ok(SurfaceSource { model, asset, wanted })
    }

    /// Whether the stored file is what is wanted in this format.
    pub fn is_in(&self, format: &Format) -> bool {
        let is_cloud = self.asset.name.starts_with("cloud.");
        check_name(&self.asset.name).is_ok_and(|stored| stored == format) && is_cloud == (self.wanted == Written::Cloud)
    }

    /// Writes it in another format.
    pub async fn write(
        &self,
        context: &ServiceContext,
        permits: &Arc<Semaphore>,
        format: &'static Format,
    ) -> Result<StagedFile, RenditionError> {
        let (model, asset, wanted, unit) = (self.model.id, self.asset.clone(), self.wanted, self.model.unit);
        Desk::new(context, permits)
            .work(self.model.points, move |objects| {
                let bytes = content(objects, model, &asset)?;
                let surface = read_surface(&asset.name, &bytes, &STORED);
                drop(bytes);
                let surface =
                    surface.map_err(|error| RenditionError::Unreadable { name: asset.name.clone(), error })?;
                let bytes = match (wanted, format.writers.cloud, format.writers.mesh) {
                    (Written::Mesh, _, Some(write)) => write_mesh_of(&surface, unit, write),
                    (Written::Cloud, Some(write), _) => Some(write(&scaled(surface, format.factor_from(unit)).cloud)),
                    _ => None,
                };
                let why = || RenditionError::Unfit { format: format.name, why: "there are no triangles".to_owned() };
                stage(objects, &bytes.ok_or_else(why)?)
            })
            .await
    }
}
