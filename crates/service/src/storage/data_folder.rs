//! A data folder: SQLite and local files in one folder that a process has for itself, taken into use.
//!
//! Folder and database hold the same id. A database that goes with other files touches none: a start is refused then.

pub mod backup;
mod elsewhere;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::inventory::{Inventory, PickedUp, Storage, StorageError};
use super::local_files::{self, FolderError, LocalFiles};
use super::sqlite::SqliteDatabase;
use super::{Database, DatabaseError, ObjectError};
use crate::config::BucketSettings;
use visage_domain::FolderId;

/// Why a data folder can't be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The database or the files.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The database goes with another folder.
    #[error(
        "the database in {folder} belongs to another data folder ({database}, this one is {expected}): put back the \
         visage.sqlite of this folder"
    )]
    OtherFolder {
        /// The data folder.
        folder: String,
        /// The folder's id by the database.
        database: FolderId,
        /// The folder's id by the folder.
        expected: FolderId,
    },
    /// The database does not know files that are there.
    #[error(
        "the database of {folder} does not know {files} scans, models or standards that are in the folder, and no crash \
         explains them: it is an older copy, or not the one that goes with them. No file was touched. Put back the \
         visage.sqlite that does, or set the files aside with `visage doctor --data {folder} --set-aside`"
    )]
    UnknownFiles {
        /// The data folder.
        folder: String,
        /// How many.
        files: usize,
    },
    /// Its files are kept elsewhere than was said, or nothing was said.
    #[error("the files of {folder} are kept in {found}: give --objects {found}")]
    Elsewhere {
        /// The data folder.
        folder: String,
        /// Where they are.
        found: String,
    },
    /// Files are in the folder, but are to be kept elsewhere.
    #[error(
        "{folder} holds {files} scans, models and standards of its own: to go on with them in {place}, copy the folders \
         scan-sets, models and standards to there (as with rclone) and move them out of {folder}; else choose a new --data \
         folder, or leave --objects out"
    )]
    FilesHere {
        /// The data folder.
        folder: String,
        /// How many.
        files: usize,
        /// Where they were to be kept.
        place: String,
    },
    /// The bucket is that of another data folder.
    #[error("{place} is used by another data folder: choose another prefix for --objects")]
    BucketTaken {
        /// The bucket.
        place: String,
    },
    /// The program knows no object stores.
    #[error("this program was built without S3: build it with `--features s3`, or keep files in the data folder")]
    NoBuckets,
    /// A start-up task ended badly.
    #[error("starting: {0}")]
    Task(#[from] tokio::task::JoinError),
}

impl From<DatabaseError> for OpenError {
    fn from(error: DatabaseError) -> Self {
        OpenError::Storage(error.into())
    }
}

impl From<ObjectError> for OpenError {
    fn from(error: ObjectError) -> Self {
        OpenError::Storage(error.into())
    }
}

impl OpenError {
    /// Whether the database itself is what is broken, so that nothing else can be looked at.
    pub fn is_of_database(&self) -> bool {
        matches!(self, OpenError::Storage(StorageError::Database(DatabaseError::Corrupt { .. })))
    }
}

/// A data folder in use.
#[derive(Debug)]
pub struct DataFolder {
    /// Its database and its files.
    pub storage: Storage,
    /// Whether it is from before folders had ids.
    is_from_before: bool,
    folder: PathBuf,
    id: FolderId,
}

/// The database of a folder alone, while a server may be using the folder: what is changed there the server sees. A new
/// folder is made.
pub async fn open_database(folder: &Path) -> Result<Arc<dyn Database>, OpenError> {
    match DataFolder::open_here(folder, Duration::ZERO).await {
        // the folder's lock goes with its files: a server may start from now on
        Ok((data, _)) => Ok(data.storage.database),
        Err(OpenError::Folder(FolderError::Locked { .. })) => {
            Ok(Arc::new(SqliteDatabase::open_beside(&local_files::database_of(folder)).await?))
        }
        Err(error) => Err(error),
    }
}

impl DataFolder {
    /// Opens and locks a folder; creates it when absent. Whoever holds the lock has the folder's seat.
    pub async fn open(folder: &Path, patience: Duration) -> Result<DataFolder, OpenError> {
        Self::open_with(folder, patience, None).await
    }

    /// The same for one whose files may be kept elsewhere.
    pub async fn open_with(
        folder: &Path,
        patience: Duration,
        objects: Option<&BucketSettings>,
    ) -> Result<DataFolder, OpenError> {
        elsewhere::check(folder, objects)?;
        let (mut data, files) = Self::open_here(folder, patience).await?;
        if let Some(settings) = objects {
            let opened = elsewhere::open(files, folder, settings, data.id).await;
            match opened {
                Ok(objects) => data.storage.objects = objects,
                Err(refused) => {
                    data.storage.database.close().await;
                    return Err(refused);
                }
            }
        }
        Ok(data)
    }

    /// The folder alone, wherever its files are.
    async fn open_here(folder: &Path, patience: Duration) -> Result<(DataFolder, Arc<LocalFiles>), OpenError> {
        let root = folder.to_owned();
        let files = Arc::new(tokio::task::spawn_blocking(move || LocalFiles::open(&root, patience)).await??);
        let database = SqliteDatabase::open_with(&files.database(), files.reserve()).await?;
        let (of_files, of_database) = (files.folder_id()?, database.folder_id().await?);
        let is_from_before = of_files.is_none() && of_database.is_none();
        if let (Some(expected), Some(database)) = (of_files, of_database)
            && expected != database
        {
            return Err(OpenError::OtherFolder { folder: folder.display().to_string(), database, expected });
        }
        let id = of_files.or(of_database).unwrap_or_default();
        if of_files.is_none() {
            let files = files.clone();
            tokio::task::spawn_blocking(move || files.put_folder_id(id)).await??;
        }
        if of_database.is_none() {
            database.put_folder_id(id).await?;
        }
        let storage = Storage { database: Arc::new(database.on_seat(id.into())), objects: files.clone() };
        Ok((DataFolder { storage, is_from_before, folder: folder.to_owned(), id }, files))
    }

    /// Picks up what a server left that has ended. Only before the service begins. What is refused is left as it was,
    /// and without a log beside the database: another one can be put in its place.
    pub async fn pick_up(&self, max_attempts: u32) -> Result<PickedUp, OpenError> {
        let picked_up = self.pick_up_all(max_attempts).await;
        if picked_up.is_err() {
            self.storage.database.close().await;
        }
        picked_up
    }

    async fn pick_up_all(&self, max_attempts: u32) -> Result<PickedUp, OpenError> {
        let mut found: Inventory = self.storage.inventory(jiff::Timestamp::now()).await?;
        if self.is_from_before {
            // earlier versions did not say which files they expected
            found.arriving.append(&mut found.unknown);
        }
        if !found.unknown.is_empty() {
            let folder = self.folder.display().to_string();
            return Err(OpenError::UnknownFiles { folder, files: found.unknown.len() });
        }
        Ok(self.storage.pick_up(found, max_attempts).await?)
    }
}
