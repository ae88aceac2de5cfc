//! A data folder whose files are kept in a bucket: both know of each other.

use std::path::Path;
use std::sync::Arc;

use super::OpenError;
use crate::config::BucketSettings;
use crate::storage::ObjectStore;
use crate::storage::local_files::copies::Source;
use crate::storage::local_files::{self, LocalFiles};
use visage_domain::FolderId;

/// What the folder says of where its files are has to be what was said to us.
pub(super) fn check(folder: &Path, objects: Option<&BucketSettings>) -> Result<(), OpenError> {
    if objects.is_some() && !cfg!(feature = "s3") {
        return Err(OpenError::NoBuckets);
    }
    let Some(found) = local_files::elsewhere(folder)? else { return Ok(()) };
    match objects.is_some_and(|settings| settings.url.to_string() == found) {
        true => Ok(()),
        false => Err(OpenError::Elsewhere { folder: folder.display().to_string(), found }),
    }
}

/// Where the files of a folder are copied from.
#[cfg(feature = "s3")]
pub(super) fn source(folder: &Path, objects: Option<&BucketSettings>) -> Result<Arc<dyn Source>, OpenError> {
    check(folder, objects)?;
    match objects {
        Some(settings) => Ok(Arc::new(crate::storage::s3::connect(settings)?)),
        None => Ok(Arc::new(folder.to_owned())),
    }
}

/// Where the files of a folder are copied from: itself.
#[cfg(not(feature = "s3"))]
pub(super) fn source(folder: &Path, objects: Option<&BucketSettings>) -> Result<Arc<dyn Source>, OpenError> {
    check(folder, objects).map(|()| -> Arc<dyn Source> { Arc::new(folder.to_owned()) })
}

/// Takes the bucket into use for a folder.
#[cfg(feature = "s3")]
pub(super) async fn open(
    files: Arc<LocalFiles>,
    folder: &Path,
    settings: &BucketSettings,
    id: FolderId,
) -> Result<Arc<dyn ObjectStore>, OpenError> {
    use crate::storage::s3::{BucketFiles, claim, connect};
    let (folder, settings) = (folder.to_owned(), settings.clone());
    let open = move || -> Result<Arc<dyn ObjectStore>, OpenError> {
        let place = settings.url.to_string();
        let here = files.listing()?.len();
        if here > 0 {
            return Err(OpenError::FilesHere { folder: folder.display().to_string(), files: here, place });
        }
        let bucket = connect(&settings)?;
        if claim(&bucket, id)? != Some(id) {
            return Err(OpenError::BucketTaken { place });
        }
        files.put_elsewhere(&place)?;
        Ok(Arc::new(BucketFiles::open(files, bucket, settings.cache_bytes)?))
    };
    tokio::task::spawn_blocking(open).await?
}

/// There are no buckets in this build.
#[cfg(not(feature = "s3"))]
pub(super) async fn open(
    _: Arc<LocalFiles>,
    _: &Path,
    _: &BucketSettings,
    _: FolderId,
) -> Result<Arc<dyn ObjectStore>, OpenError> {
    Err(OpenError::NoBuckets)
}

#[cfg(all(test, not(feature = "s3")))]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::storage::data_folder::{DataFolder, Places};

    #[tokio::test]
    async fn a_program_without_buckets_says_so_and_touches_nothing() {
        let parent = tempfile::tempdir().expect("a temporary folder");
        let folder = parent.path().join("data");
        let url = "s3://scans/visage".parse().expect("a bucket");
        let settings = BucketSettings { url, endpoint: None, region: None, cache_bytes: 0 };
        let refused =
            DataFolder::open_with(&folder, Duration::ZERO, Places { objects: Some(&settings), database: None })
                .await
                .expect_err("no buckets");
        assert!(refused.to_string().contains("--features s3") && !folder.exists(), "{refused}");
    }

    #[tokio::test]
    async fn a_folder_whose_files_are_elsewhere_is_refused_without_them() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = DataFolder::open(folder.path(), Duration::ZERO).await.expect("new");
        data.storage.database.close().await;
        drop(data);
        std::fs::write(folder.path().join("visage.objects"), "s3://scans/visage\n").expect("written");
        let refused = DataFolder::open(folder.path(), Duration::ZERO).await.expect_err("where are the files?");
        assert!(refused.to_string().contains("give --objects s3://scans/visage"), "{refused}");
    }
}
