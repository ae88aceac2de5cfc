//! A data folder is taken into use: it is told to be ours, and what a crash left in it is picked up.
//!
//! Files without a row mean one of two things. Those that the database expected, or whose row it has deleted, were
//! left by a crash. Any other one says that the database is not the one that goes with these files (an older copy, a
//! new one): then nothing is touched.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use crate::blobs::{BlobError, Blobs};
use crate::store::{FolderId, KnownFiles, Store, StoreError, StoredFile};

/// How long a file may be without a row while a server runs: it gets one within moments, or never.
const LONGEST_ARRIVAL: jiff::SignedDuration = jiff::SignedDuration::from_hours(1);

/// Why a data folder can't be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The folder.
    #[error(transparent)]
    Blobs(#[from] BlobError),
    /// The database.
    #[error(transparent)]
    Store(#[from] StoreError),
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
    /// A start-up task ended badly.
    #[error("starting: {0}")]
    Task(#[from] tokio::task::JoinError),
}

/// What is in the folder, held against the database.
#[derive(Debug, Default)]
pub struct Inventory {
    /// Files without a row that nothing explains.
    pub unknown: Vec<StoredFile>,
    /// Files that were being stored when a server ended.
    pub arriving: Vec<StoredFile>,
    /// Files whose rows were deleted.
    pub deleted: Vec<StoredFile>,
    /// What has a row but no file.
    pub missing: Vec<StoredFile>,
    /// Entries of the database about files that are gone, or have a row.
    settled: Vec<StoredFile>,
}

/// A data folder in use.
#[derive(Debug)]
pub struct DataFolder {
    /// Its files.
    pub blobs: Arc<Blobs>,
    /// Its database.
    pub store: Store,
    /// Whether it is from before folders had ids.
    is_from_before: bool,
    folder: PathBuf,
}

/// What a crash left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PickedUp {
    /// Jobs that wait again.
    pub jobs: u64,
    /// Files that were set aside or removed.
    pub files: usize,
}

impl DataFolder {
    /// Opens and locks a folder; creates it when absent.
    pub async fn open(folder: &Path, patience: Duration) -> Result<DataFolder, OpenError> {
        let root = folder.to_owned();
        let blobs = Arc::new(blocking(move || Blobs::open(&root, patience)).await??);
        let store = Store::open_with(&blobs.database(), blobs.reserve()).await?;
        let (of_files, of_database) = (blobs.folder_id()?, store.folder_id().await?);
        let is_from_before = of_files.is_none() && of_database.is_none();
        if let (Some(expected), Some(database)) = (of_files, of_database)
            && expected != database
        {
            return Err(OpenError::OtherFolder { folder: folder.display().to_string(), database, expected });
        }
        let id = of_files.or(of_database).unwrap_or_default();
        let opened = DataFolder { blobs, store, is_from_before, folder: folder.to_owned() };
        if of_files.is_none() {
            let blobs = opened.blobs.clone();
            blocking(move || blobs.put_folder_id(id)).await??;
        }
        if of_database.is_none() {
            opened.store.put_folder_id(id).await?;
        }
        Ok(opened)
    }

    /// Holds what is in the folder against the database.
    pub async fn inventory(&self) -> Result<Inventory, OpenError> {
        let blobs = self.blobs.clone();
        let files = blocking(move || blobs.listing()).await??;
        let known = self.store.known_files().await?;
        let loose = self.store.loose_files().await?;
        let mut found = Inventory::default();
        for file in files.iter().copied().filter(|file| !known.knows(*file)) {
            let entry = loose.iter().find(|entry| covers(entry.file, file));
            match entry.map(|entry| entry.is_deleted) {
                None => found.unknown.push(file),
                Some(false) => found.arriving.push(file),
                Some(true) => found.deleted.push(file),
            }
        }
        let files: std::collections::BTreeSet<StoredFile> = files.into_iter().collect();
        found.missing = known.needed().filter(|file| !files.contains(file)).collect();
        found.settled = loose.into_iter().map(|entry| entry.file).collect();
        Ok(found)
    }

    fn refuse_unknown(&self, found: &Inventory) -> Result<(), OpenError> {
        if found.unknown.is_empty() {
            return Ok(());
        }
        Err(OpenError::UnknownFiles { folder: self.folder.display().to_string(), files: found.unknown.len() })
    }

    /// Picks up what a server left that has ended. Only before the service begins. What is refused is left as it was,
    /// and without a log beside the database: another one can be put in its place.
    pub async fn pick_up(&self, max_attempts: u32) -> Result<PickedUp, OpenError> {
        let picked_up = self.pick_up_all(max_attempts).await;
        if picked_up.is_err() {
            self.store.close().await;
        }
        picked_up
    }

    async fn pick_up_all(&self, max_attempts: u32) -> Result<PickedUp, OpenError> {
        let mut found = self.inventory().await?;
        if self.is_from_before {
            // earlier versions did not say which files they expected
            found.arriving.append(&mut found.unknown);
        }
        self.refuse_unknown(&found)?;
        if !found.missing.is_empty() {
            tracing::error!(files = found.missing.len(), "files are missing: `visage doctor` names them");
        }
        let Inventory { arriving, deleted, settled, .. } = found;
        // the folder is ours alone: whatever runs in the table ran in a process that is dead
        let jobs = self.store.reclaim_jobs(max_attempts).await?;
        let mut files = arriving.len() + deleted.len();
        if !arriving.is_empty() {
            let trash = self.set_aside(arriving).await?;
            tracing::warn!(trash = %trash.display(), "files without a row are set aside");
        }
        let blobs = self.blobs.clone();
        files += blocking(move || -> Result<usize, BlobError> {
            deleted.into_iter().try_for_each(|file| blobs.remove(file))?;
            blobs.empty_trash(jiff::Timestamp::now())?;
            blobs.empty_staging()
        })
        .await??;
        self.store.forget_loose(&settled).await?;
        Ok(PickedUp { jobs, files })
    }

    /// Moves files to the trash; answers with where they are now.
    pub async fn set_aside(&self, files: Vec<StoredFile>) -> Result<PathBuf, OpenError> {
        let blobs = self.blobs.clone();
        Ok(blocking(move || blobs.set_aside(&files)).await??)
    }
}

/// Removes, while a server runs, what was deleted but could not be removed then, and what was never stored after all.
pub async fn tidy_up(blobs: &Arc<Blobs>, store: &Store) -> Result<(), OpenError> {
    let now = jiff::Timestamp::now();
    // read before the rows: a file that gets its row in between is known then
    let loose = store.loose_files().await?;
    let known: KnownFiles = store.known_files().await?;
    let is_over = |since: jiff::Timestamp| now.duration_since(since) > LONGEST_ARRIVAL;
    let due = loose.into_iter().filter(|entry| entry.is_deleted || is_over(entry.since)).map(|entry| entry.file);
    let due: Vec<StoredFile> = due.filter(|file| !known.knows(*file)).collect();
    let (files, gone) = (blobs.clone(), due.clone());
    blocking(move || -> Result<(), BlobError> {
        gone.into_iter().try_for_each(|file| files.remove(file))?;
        files.empty_trash(now).map(drop)
    })
    .await??;
    Ok(store.forget_loose(&due).await?)
}

/// Whether an entry about `entry` is one about `file` too.
fn covers(entry: StoredFile, file: StoredFile) -> bool {
    entry == file || matches!((entry, file), (StoredFile::ScanSet(whole), StoredFile::Scan(set, _)) if whole == set)
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, OpenError> {
    Ok(tokio::task::spawn_blocking(work).await?)
}
