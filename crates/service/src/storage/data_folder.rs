//! A data folder: SQLite and local files in one folder that a process has for itself, taken into use.
//!
//! Folder and database hold the same id. A database that goes with other files touches none: a start is refused then.

pub mod backup;
mod elsewhere;
pub mod migrate;
mod server;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::database::Upkeep;
use super::inventory::{Inventory, PickedUp, Storage, StorageError};
use super::local_files::{self, FolderError, LocalFiles};
use super::sqlite::SqliteDatabase;
use super::{Database, DatabaseError, ObjectError};
use crate::config::{BucketSettings, DatabaseUrl};
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
    /// Its database is on a server, but that was not said.
    #[error("the database of {folder} is {found}: give --database with that address")]
    DatabaseElsewhere {
        /// The data folder.
        folder: String,
        /// Where it is.
        found: String,
    },
    /// Its database is in the folder, but is to be on a server.
    #[error(
        "{folder} holds a database of its own: move it with `visage migrate --from sqlite:{folder} --to {place}`, choose a new \
         --data folder, or leave --database out"
    )]
    DatabaseHere {
        /// The data folder.
        folder: String,
        /// The server.
        place: String,
    },
    /// The database on a server goes with another folder.
    #[error(
        "the database {place} belongs to the data folder {database}, which {folder} is not: give its folder as --data, or another \
         --database"
    )]
    OtherDatabase {
        /// The data folder.
        folder: String,
        /// The server.
        place: String,
        /// The folder's id by the database.
        database: FolderId,
    },
    /// There is no database to be moved.
    #[error("{folder} holds no database that could be moved")]
    NothingToMove {
        /// The folder.
        folder: String,
    },
    /// The program knows no database servers.
    #[error("this program was built without PostgreSQL: build it with `--features postgres`, or leave --database out")]
    NoServers,
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

/// Where a data folder has what is not in it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Places<'a> {
    /// Its files.
    pub objects: Option<&'a BucketSettings>,
    /// Its database.
    pub database: Option<&'a DatabaseUrl>,
}

/// The database of a folder alone, while a server may be using the folder: what is changed there the server sees. A new
/// folder is made.
pub async fn open_database(folder: &Path, database: Option<&DatabaseUrl>) -> Result<Arc<dyn Database>, OpenError> {
    let is_new = !local_files::is_in_use(folder);
    let refused = match DataFolder::open_here(folder, Duration::ZERO, Places { objects: None, database }).await {
        // the folder's lock goes with its files: a server may start from now on
        Ok((data, _)) => return Ok(data.storage.database),
        Err(refused) => refused,
    };
    let is_beside = match &refused {
        OpenError::Folder(FolderError::Locked { .. })
        | OpenError::Storage(StorageError::Database(DatabaseError::Taken)) => true,
        // a further node of servers that share their database
        OpenError::OtherDatabase { .. } => is_new,
        _ => false,
    };
    match database {
        _ if !is_beside => Err(refused),
        Some(url) => server::open_beside(url).await,
        None => Ok(Arc::new(SqliteDatabase::open_beside(&local_files::database_of(folder)).await?)),
    }
}

impl DataFolder {
    /// Opens and locks a folder; creates it when absent. Whoever holds the lock has the folder's seat.
    pub async fn open(folder: &Path, patience: Duration) -> Result<DataFolder, OpenError> {
        Self::open_with(folder, patience, Places::default()).await
    }

    /// The same for one whose files or database may be elsewhere.
    pub async fn open_with(folder: &Path, patience: Duration, places: Places<'_>) -> Result<DataFolder, OpenError> {
        elsewhere::check(folder, places.objects)?;
        let (mut data, files) = Self::open_here(folder, patience, places).await?;
        if let Some(settings) = places.objects {
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

    /// The folder and its database, wherever its files are.
    async fn open_here(
        folder: &Path,
        patience: Duration,
        places: Places<'_>,
    ) -> Result<(DataFolder, Arc<LocalFiles>), OpenError> {
        server::check(folder, places.database)?;
        let (root, is_on_server) = (folder.to_owned(), places.database.is_some());
        let take = move || match is_on_server {
            true => LocalFiles::open_without_database(&root, patience),
            false => LocalFiles::open(&root, patience),
        };
        let files = Arc::new(tokio::task::spawn_blocking(take).await??);
        let of_files = files.folder_id()?;
        let (database, id, is_from_before): (Arc<dyn Database>, _, _) = match places.database {
            Some(url) => {
                let files_are_shared = places.objects.is_some();
                let (database, id) = server::open(&files, folder, url, patience, files_are_shared).await?;
                (database, id, false)
            }
            None => {
                let database = SqliteDatabase::open_with(&files.database(), files.reserve()).await?;
                let of_database = database.folder_id().await?;
                if let (Some(expected), Some(database)) = (of_files, of_database)
                    && expected != database
                {
                    return Err(OpenError::OtherFolder { folder: folder.display().to_string(), database, expected });
                }
                let id = of_files.or(of_database).unwrap_or_default();
                if of_database.is_none() {
                    database.put_folder_id(id).await?;
                }
                (Arc::new(database.on_seat(id.into())), id, of_files.is_none() && of_database.is_none())
            }
        };
        if of_files.is_none() {
            let files = files.clone();
            tokio::task::spawn_blocking(move || files.put_folder_id(id)).await??;
        }
        let storage = Storage { database, objects: files.clone() };
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
