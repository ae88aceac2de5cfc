//! Finished models come into the gallery, and leave it.

use super::context::ServiceContext;
use super::recycle_bin::{self, Removal};
use crate::storage::inventory::StorageError;
use crate::storage::{Deleted, ObjectStore, StagedFile};
use visage_domain::asset::Asset;
use visage_domain::{AssetRecord, Deletable, JobBase, ModelId, NewModel, Replay, ScanSetId, StoredFile};
use visage_shape::faces::Signature;

/// An uploaded model that is described but has no place yet.
#[derive(Debug)]
pub struct Upload {
    /// The model as it is to be stored: with one asset, the file, and perhaps its thumbnail.
    pub model: NewModel,
    /// Its file.
    pub file: StagedFile,
    /// What it looks like at a glance, if it could be drawn.
    pub thumbnail: Option<Vec<u8>>,
    /// Its signature.
    pub signature: Signature,
}

/// Stores an uploaded model, with the answer that the client gets; the next query finds it. Must run to its end:
/// between the file and its row nobody else knows of it.
pub async fn add(context: &ServiceContext, upload: Upload, replay: Option<&Replay>) -> Result<(), StorageError> {
    let Upload { model, file, thumbnail, signature } = upload;
    let (storage, id) = (context.storage(), model.id);
    storage.database.expect_files(&[StoredFile::Model(id)]).await?;
    let assets: Vec<String> = model.assets.iter().map(|asset| asset.name.clone()).collect();
    let keep = move |objects: &dyn ObjectStore| {
        let staged = objects.stage_model()?;
        for asset in &assets {
            match thumbnail.as_deref().filter(|_| *asset == Asset::Thumbnail.name()) {
                Some(content) => drop(objects.write_asset(&staged, asset, content)?),
                None => objects.take_asset(&staged, asset, &file)?,
            }
        }
        objects.keep_model(&staged, id)
    };
    storage.blocking(keep).await?;
    let created = storage.database.create_model(&model, replay).await;
    let unseen = storage.or_remove(StoredFile::Model(id), created).await?;
    context.gallery.publish(storage.database.as_ref(), id, signature).await?;
    drop(unseen);
    // where there are standards, it waits to be judged against them
    context.monitor.announce_work();
    Ok(())
}

/// A small file of a model; `None` if it was deleted in the meantime.
pub async fn read_asset(
    context: &ServiceContext,
    id: ModelId,
    asset: &AssetRecord,
) -> Result<Option<Vec<u8>>, StorageError> {
    let asset = asset.clone();
    context.storage().blocking(move |objects: &dyn ObjectStore| objects.read_asset(id, &asset)).await
}

/// Why scans can't be added to a model.
#[derive(Debug, thiserror::Error)]
pub enum BaseError {
    /// It was made from other scans.
    #[error("the model {0} was not made from this scan set")]
    OtherScanSet(ModelId),
    /// It was not registered, or has lost its poses.
    #[error("the model {0} has no poses")]
    NoPoses(ModelId),
    /// It can't be read.
    #[error(transparent)]
    Storage(#[from] StorageError),
}

/// The finished model of a scan set that scans are added to.
pub async fn base_for(context: &ServiceContext, id: ModelId, set: ScanSetId) -> Result<JobBase, BaseError> {
    let model = context.database.model(id).await.map_err(StorageError::from)?;
    if model.scan_set_id != Some(set) {
        return Err(BaseError::OtherScanSet(id));
    }
    let assets = context.database.assets(id).await.map_err(StorageError::from)?;
    let poses = assets.iter().find(|asset| asset.name == Asset::Poses.name()).ok_or(BaseError::NoPoses(id))?;
    let poses = read_asset(context, id, poses).await?.ok_or(BaseError::NoPoses(id))?;
    Ok(JobBase { model_id: id, poses })
}

/// Deletes a model with its files and its signature.
pub async fn delete(context: &ServiceContext, id: ModelId, removal: Removal) -> Result<(), StorageError> {
    if removal == Removal::IntoBin {
        return recycle_bin::put(context, Deletable::Model(id)).await;
    }
    let deleted = context.database.delete_model(id).await?;
    context.monitor.announce_change();
    forget(context, deleted).await
}

/// Takes models that the database has forgotten out of the gallery, and removes their files.
pub(super) async fn forget(context: &ServiceContext, deleted: Deleted) -> Result<(), StorageError> {
    let Deleted { models, purged, unseen } = deleted;
    context.gallery.withdraw(context.database.as_ref(), &models).await;
    drop(unseen);
    context.database.fold_log().await;
    let files = models.into_iter().map(StoredFile::Model).chain(purged.files);
    context.storage().remove_all(files.collect()).await
}

#[cfg(test)]
mod tests {
    use super::super::context::testing::{context, file};
    use super::*;
    use visage_gallery::Gallery;
    use visage_shape::faces::signature::example::example;

    #[tokio::test]
    async fn a_model_is_found_until_it_is_deleted_and_leaves_nothing() {
        let (context, _place) = context().await;
        let signature = example(0.3, 5);
        let model = NewModel { signature: Some((&signature).into()), ..NewModel::example(None) };
        let (id, file) = (model.id, file(&context, b"a mesh").await);
        let mut bell = context.monitor.changes();
        add(&context, Upload { model, file, thumbnail: None, signature }, None).await.expect("added");
        assert!(bell.has_changed().expect("there"), "standards may wait for it");
        bell.mark_unchanged();
        context.database.settled().await;
        assert_eq!(context.gallery.ask(Gallery::len), Ok(1));
        assert_eq!(context.objects.listing().expect("listed"), [StoredFile::Model(id)]);
        delete(&context, id, Removal::ForGood).await.expect("deleted");
        assert_eq!(context.gallery.ask(Gallery::len), Ok(0));
        assert_eq!(context.objects.listing().expect("listed"), []);
    }
}
