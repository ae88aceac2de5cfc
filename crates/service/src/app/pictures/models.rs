//! A picture of a model.

use super::{Kind, Made, PicturesError, STORED, Wish, check_memory, content};
use crate::app::context::ServiceContext;
use visage_domain::asset::{self, Asset};
use visage_domain::{AssetRecord, ModelId, ModelRecord};
use visage_formats::{ply, read_surface};
use visage_geometry::progress::Progress;
use visage_geometry::{Surface, Unit};
use visage_report::found::Found;
use visage_report::{Material, PictureError, Source, draw};
use visage_shape::faces::Signature;

/// What a picture of a model is made of.
#[derive(Debug, Clone)]
pub struct ModelPicture {
    kind: Kind,
    material: Stored,
    /// Stands for all that goes into it.
    pub tag: String,
}

/// Stored files of a model, as far as they are wanted.
#[derive(Debug, Clone)]
pub(super) struct Stored {
    pub model: ModelRecord,
    pub assets: Vec<AssetRecord>,
    surface: Option<AssetRecord>,
    other: Option<(ModelId, AssetRecord)>,
    signature: Option<Vec<u8>>,
}

impl ModelPicture {
    /// Finds what a picture is made of.
    ///
    /// # Errors
    /// There is no such model, nothing that it is to be compared with, or it is too large for this machine.
    pub async fn find(
        context: &ServiceContext,
        id: ModelId,
        kind: Kind,
        other: Option<ModelId>,
    ) -> Result<ModelPicture, PicturesError> {
        let mut material = Stored::find(context, id).await?;
        material.want(kind.sources());
        if kind == Kind::Deviation {
            material.compare(context, other.ok_or(PicturesError::NoOther)?).await?;
        }
        check_memory(context, material.points())?;
        let tag = material.tag(&[kind.name().as_bytes()]);
        Ok(ModelPicture { kind, material, tag })
    }

    /// The bytes of the files that have to be read.
    pub fn bytes(&self, wish: &Wish) -> u64 {
        self.drawn(wish).map_or_else(|| self.material.bytes(), |asset| asset.bytes)
    }

    /// The picture as PNG: as it was drawn when the model was stored, if that is what is wished; else it is read and drawn. Blocks; runs
    /// inside the caller's rayon pool.
    pub fn png(&self, context: &ServiceContext, wish: &Wish, progress: &Progress) -> Result<Vec<u8>, PicturesError> {
        match self.drawn(wish) {
            Some(asset) => content(context, self.material.model.id, asset),
            None => written(&self.made(context, wish, progress)?),
        }
    }

    /// The picture that was drawn when the model was stored, if it is the one that is wished.
    fn drawn(&self, wish: &Wish) -> Option<&AssetRecord> {
        let name = Asset::Thumbnail.name();
        let is_usual = self.kind == Kind::Thumbnail && *wish == Wish::of(Kind::Thumbnail);
        self.material.assets.iter().find(|asset| is_usual && asset.name == name)
    }

    /// Reads and draws. Blocks; runs inside the caller's rayon pool.
    pub fn made(&self, context: &ServiceContext, wish: &Wish, progress: &Progress) -> Result<Made, PicturesError> {
        let material = self.material.read(context)?;
        progress.check()?;
        Ok(draw(self.kind, &material, wish, progress)?)
    }
}

/// What a model looks like at a glance, while it is still in memory; `None` if it can't be drawn. Runs inside the caller's rayon pool.
///
/// # Errors
/// [`PicturesError::Canceled`], while it is at work.
pub fn thumbnail(
    surface: Surface,
    signature: &Signature,
    unit: Unit,
    progress: &Progress,
) -> Result<Option<Vec<u8>>, PicturesError> {
    let material = Material { surface, signature: Some(signature.clone()), unit, ..Material::default() };
    match draw(Kind::Thumbnail, &material, &Wish::of(Kind::Thumbnail), progress) {
        Ok(made) => written(&made).map(Some),
        Err(PictureError::Canceled(canceled)) => Err(canceled.into()),
        Err(PictureError::Lacking { .. } | PictureError::Surface(_)) => Ok(None),
    }
}

fn written(made: &Made) -> Result<Vec<u8>, PicturesError> {
    made.to_png().map_err(|error| PicturesError::Broken(error.to_string()))
}

impl Stored {
    pub(super) async fn find(context: &ServiceContext, id: ModelId) -> Result<Stored, PicturesError> {
        let model = context.database.model(id).await?;
        let assets = context.database.assets(id).await?;
        let signature = context.database.signature(id).await?;
        Ok(Stored { model, assets, surface: None, other: None, signature })
    }

    /// Takes the first of these files that there is.
    pub(super) fn want(&mut self, sources: &[Source]) {
        self.surface = sources.iter().find_map(|source| asset_of(&self.model, &self.assets, *source)).cloned();
    }

    async fn compare(&mut self, context: &ServiceContext, other: ModelId) -> Result<(), PicturesError> {
        let model = context.database.model(other).await?;
        if model.unit != self.model.unit {
            return Err(PicturesError::OtherUnit(self.model.unit, model.unit));
        }
        let assets = context.database.assets(other).await?;
        let found = [Source::Mesh, Source::Cloud].iter().find_map(|source| asset_of(&model, &assets, *source));
        self.other = found.map(|asset| (other, asset.clone()));
        Ok(())
    }

    /// Points that are in memory at a time: no file has many more than its bytes allow.
    pub(super) fn points(&self) -> u64 {
        const LEAST_BYTES_PER_POINT: u64 = 12;
        self.bytes() / LEAST_BYTES_PER_POINT
    }

    pub(super) fn bytes(&self) -> u64 {
        let other = self.other.as_ref().map(|(_, asset)| asset);
        self.surface.iter().chain(other).map(|asset| asset.bytes).sum()
    }

    /// Stands for all that is stored, and for these.
    pub(super) fn tag(&self, more: &[&[u8]]) -> String {
        let mut hash = blake3::Hasher::new();
        let mut put = |bytes: &[u8]| {
            hash.update(&(bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        let other = self.other.as_ref().map(|(_, asset)| asset);
        for asset in self.surface.iter().chain(other).chain(self.report()) {
            put(asset.name.as_bytes());
            put(asset.checksum.as_bytes());
        }
        put(self.signature.as_deref().unwrap_or_default());
        put(self.model.unit.name().as_bytes());
        more.iter().for_each(|bytes| put(bytes));
        hash.finalize().to_hex().to_string()
    }

    pub(super) fn report(&self) -> Option<&AssetRecord> {
        let name = Asset::Report.name();
        self.assets.iter().find(|asset| asset.name == name)
    }

    /// Reads it all. Blocks.
    pub(super) fn read(&self, context: &ServiceContext) -> Result<Material, PicturesError> {
        let id = self.model.id;
        let (mut surface, mut views, mut support) = (Surface::default(), None, None);
        if let Some(asset) = &self.surface {
            let bytes = content(context, id, asset)?;
            (views, support) = (ply::views(&bytes), ply::support(&bytes));
            surface = read(&asset.name, &bytes)?;
        }
        let other = self.other.as_ref().map(|(other, asset)| read(&asset.name, &content(context, *other, asset)?));
        let broken = |error: &dyn std::fmt::Display| {
            PicturesError::Broken(format!("{} of model {id}: {error}", Asset::Report.name()))
        };
        let found =
            self.report().map(|asset| Found::read(&content(context, id, asset)?).map_err(|error| broken(&error)));
        // one of another version is made anew by an evaluation; until then there is none
        let signature = self.signature.as_deref().and_then(|bytes| Signature::from_bytes(bytes).ok());
        Ok(Material {
            surface,
            views,
            support,
            other: other.transpose()?,
            signature,
            found: found.transpose()?,
            unit: self.model.unit,
        })
    }
}

fn read(name: &str, bytes: &[u8]) -> Result<Surface, PicturesError> {
    read_surface(name, bytes, &STORED).map_err(|error| PicturesError::Unreadable { name: name.to_owned(), error })
}

/// The file of a model that a source stands for.
fn asset_of<'a>(model: &ModelRecord, assets: &'a [AssetRecord], source: Source) -> Option<&'a AssetRecord> {
    match source {
        Source::Preview => assets.iter().find(|asset| asset.name == Asset::Preview.name()),
        Source::Mesh => model.whole(assets, asset::Kind::Mesh),
        Source::Cloud => model.whole(assets, asset::Kind::Cloud),
    }
}
