//! How far a model is from another one of the same frame.

use super::context::ServiceContext;
use crate::storage::{DatabaseError, ObjectError};
use visage_domain::asset::{Asset, Kind};
use visage_domain::{AssetRecord, ModelId};
use visage_formats::FormatError;
use visage_formats::ply::{VertexAttributes, write_surface};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Mesh, Surface, Unit};
use visage_surface::deviation::{self, DeviationReport, Reference};

/// The distances of a model in figures.
pub type Figures = DeviationReport;

/// What is to be counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Question {
    /// What is tolerated.
    pub limit: Option<f64>,
    /// How far a counterpart may be.
    pub reach: Option<f64>,
}

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
    /// Whether distances have a sign.
    pub has_sides: bool,
    /// From the model to the reference.
    pub forth: Figures,
    /// From the reference to the model.
    pub back: Figures,
    /// The model.
    surface: Surface,
    /// Its distances.
    distances: Vec<f64>,
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
        let reach = question.reach.unwrap_or(f64::INFINITY);
        let measure = |index: usize, model: &Surface, to: &Surface| -> Result<(Vec<f64>, bool), DeviationError> {
            let reference = Reference::new(to).ok_or(DeviationError::NoSurface(self.models[1 - index].0))?;
            Ok((reference.distances(&model.cloud.points, reach, progress)?, reference.has_sides()))
        };
        let (distances, has_sides) = measure(0, &surface, &other)?;
        let (back, _) = measure(1, &other, &surface)?;
        let report = |distances: &[f64]| DeviationReport::of(distances, question.limit);
        let names = self.models.each_ref().map(|(_, asset)| asset.name.clone());
        Ok(Measured { names, has_sides, forth: report(&distances), back: report(&back), surface, distances })
    }

    fn read(&self, context: &ServiceContext, index: usize) -> Result<Surface, DeviationError> {
        let (id, asset) = &self.models[index];
        let bytes = context.objects.read_asset(*id, asset)?.ok_or(DeviationError::NoSurface(*id))?;
        Ok(visage_formats::read_surface(&asset.name, &bytes, &context.config.limits.read_limits())?)
    }
}

/// The file that describes a model best, a mesh before a cloud, and its unit.
async fn best(context: &ServiceContext, id: ModelId) -> Result<(AssetRecord, Unit), DeviationError> {
    let model = context.database.model(id).await?;
    let known = context.database.assets(id).await?;
    let of_kind = |kind: Kind| {
        let assets = Asset::of(model.origin()).into_iter();
        let wanted = assets.filter(move |asset| asset.role().kind == kind && *asset != Asset::Preview);
        wanted.map(Asset::name).find_map(|name| known.iter().find(|record| record.name == name))
    };
    let asset = of_kind(Kind::Mesh).or_else(|| of_kind(Kind::Cloud)).ok_or(DeviationError::NoSurface(id))?;
    Ok((asset.clone(), model.unit))
}

/// The model as PLY in the colours of its distances, full at the limit or at what 95 % don't exceed.
pub fn coloured(measured: Measured, limit: Option<f64>) -> Vec<u8> {
    let Measured { surface, distances, forth, .. } = measured;
    let colors = deviation::colors(&distances, limit.unwrap_or(forth.absolute.p95));
    let values: Vec<f32> = distances.iter().map(|distance| *distance as f32).collect();
    let attributes =
        VertexAttributes { colors: Some(&colors), deviation: Some(&values), ..VertexAttributes::default() };
    write_surface(&Mesh { vertices: surface.cloud.points, faces: surface.faces }, &attributes)
}
