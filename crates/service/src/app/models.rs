//! Finished models come into the gallery, and leave it.

use super::live_gallery::LiveGallery;
use crate::storage::inventory::{Storage, StorageError};
use crate::storage::{Deleted, ObjectStore, StagedFile};
use visage_domain::{ModelId, NewModel, Replay, StoredFile};
use visage_shape::faces::Signature;

/// An uploaded model that is described but has no place yet.
#[derive(Debug)]
pub struct Upload {
    /// The model as it is to be stored: with one asset, the file.
    pub model: NewModel,
    /// Its file.
    pub file: StagedFile,
    /// Its signature.
    pub signature: Signature,
}

/// Stores an uploaded model, with the answer that the client gets; the next query finds it. Must run to its end: between
/// the file and its row nobody else knows of it.
pub async fn add(
    storage: &Storage,
    gallery: &LiveGallery,
    upload: Upload,
    replay: Option<&Replay>,
) -> Result<(), StorageError> {
    let Upload { model, file, signature } = upload;
    let id = model.id;
    storage.database.expect_files(&[StoredFile::Model(id)]).await?;
    let assets: Vec<String> = model.assets.iter().map(|asset| asset.name.clone()).collect();
    let keep = move |objects: &dyn ObjectStore| {
        let staged = objects.stage_model()?;
        assets.iter().try_for_each(|asset| objects.take_asset(&staged, asset, &file))?;
        objects.keep_model(&staged, id)
    };
    storage.blocking(keep).await?;
    let unseen = match storage.database.create_model(&model, replay).await {
        Ok(unseen) => unseen,
        // whether a failed commit took place is not known: what has no row is removed later
        Err(error) if error.leaves_in_doubt() => return Err(error.into()),
        Err(refused) => {
            storage.remove(StoredFile::Model(id)).await?;
            return Err(refused.into());
        }
    };
    gallery.publish(storage.database.as_ref(), id, signature).await?;
    drop(unseen);
    Ok(())
}

/// Deletes a model with its files and its signature.
pub async fn delete(storage: &Storage, gallery: &LiveGallery, id: ModelId) -> Result<(), StorageError> {
    let deleted = storage.database.delete_model(id).await?;
    forget(storage, gallery, deleted).await
}

/// Takes models that the database has forgotten out of the gallery, and removes their files.
pub async fn forget(storage: &Storage, gallery: &LiveGallery, deleted: Deleted) -> Result<(), StorageError> {
    let Deleted { models, unseen } = deleted;
    for model in &models {
        gallery.remove(*model);
    }
    drop(unseen);
    storage.database.fold_log().await;
    let remove =
        |objects: &dyn ObjectStore| models.into_iter().try_for_each(|model| objects.remove(StoredFile::Model(model)));
    storage.blocking(remove).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::conformance::memory::MemoryPlace;
    use crate::storage::conformance::{DatabasePlace, ObjectPlace};
    use crate::storage::sqlite::testing::SqlitePlace;
    use visage_domain::SeatId;
    use visage_gallery::Gallery;
    use visage_shape::faces::signature::example::example;

    async fn upload(storage: &Storage) -> Upload {
        let mut writer = storage.objects.receive().await.expect("staging");
        writer.write(b"a mesh").await.expect("written");
        let (file, signature) = (writer.finish().await.expect("arrived"), example(0.3, 5));
        Upload { model: NewModel { signature: Some((&signature).into()), ..NewModel::example(None) }, file, signature }
    }

    #[tokio::test]
    async fn a_model_is_found_until_it_is_deleted_and_leaves_nothing() {
        let (place, objects) = (SqlitePlace::new().await, MemoryPlace::new().open());
        let storage = Storage { database: place.open(SeatId::new()).await, objects };
        let gallery = LiveGallery::default();
        gallery.load(storage.database.as_ref()).await.expect("loaded");
        let upload = upload(&storage).await;
        let id = upload.model.id;
        add(&storage, &gallery, upload, None).await.expect("added");
        storage.database.settled().await;
        assert_eq!(gallery.ask(Gallery::len), Ok(1));
        assert_eq!(storage.objects.listing().expect("listed"), [StoredFile::Model(id)]);
        delete(&storage, &gallery, id).await.expect("deleted");
        assert_eq!(gallery.ask(Gallery::len), Ok(0));
        assert_eq!(storage.objects.listing().expect("listed"), []);
    }
}
