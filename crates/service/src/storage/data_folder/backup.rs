//! A data folder is copied while a server uses it, and put back.
//!
//! A backup is a data folder itself: a database and the files that its rows know. The database comes first, as it is
//! at one moment; then the files, which never change once they are there. If something was deleted meanwhile it is
//! done once more. The database gets its place last, so what is broken off leaves the backup of before.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::{OpenError, elsewhere};
use crate::config::BucketSettings;
use crate::storage::database::{Files, Models, RecycleBin, ScanSets, Standards, Upkeep};
use crate::storage::local_files::copies::{self, Copied, Source, Wanted};
use crate::storage::local_files::{self, FolderError, FolderLock};
use crate::storage::sqlite::SqliteDatabase;
use crate::storage::{DatabaseError, NoReserve, ObjectError};
use visage_domain::{FolderId, KnownFiles, PageRequest, StoredFile};

/// Rows that are asked for at a time.
const PAGE: usize = 500;
/// How often a backup is begun anew because something was deleted meanwhile.
const MOST_TRIES: usize = 10;

/// Why there is no backup, or nothing was put back.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// A folder can't be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The database is on a server, which has tools of its own for that.
    #[error(
        "the database of {folder} is {place}: copy that with `pg_dump` first, then the folder as it is (its files never change; \
         `visage doctor --set-aside` sets aside what came after the dump)"
    )]
    OnServer {
        /// The data folder.
        folder: String,
        /// The server.
        place: String,
    },
    /// There is nothing to copy.
    #[error("{0} is no data folder of visage: it holds no visage.sqlite")]
    NoDatabase(String),
    /// Both are one folder, or one is in the other.
    #[error("{0} is within the other folder: choose one that is apart, best on another disk")]
    Within(String),
    /// The backup is of something else.
    #[error("{folder} is a backup of another data folder ({found}, not {expected}): choose another one, or a new one")]
    OtherFolder {
        /// The backup.
        folder: String,
        /// Whose backup it is.
        found: FolderId,
        /// Whose it would be.
        expected: FolderId,
    },
    /// What is put back goes into a folder of its own.
    #[error("{0} is not empty: put the backup back into a new folder, and start the server on that")]
    NotEmpty(String),
}

impl BackupError {
    /// Whether it is that a folder can't be written to.
    fn is_read_only(&self) -> bool {
        let BackupError::Open(OpenError::Folder(FolderError::Files(ObjectError::Io { source, .. }))) = self else {
            return false;
        };
        matches!(source.kind(), std::io::ErrorKind::ReadOnlyFilesystem | std::io::ErrorKind::PermissionDenied)
    }
}

impl From<DatabaseError> for BackupError {
    fn from(error: DatabaseError) -> Self {
        BackupError::Open(error.into())
    }
}

impl From<ObjectError> for BackupError {
    fn from(error: ObjectError) -> Self {
        BackupError::Open(error.into())
    }
}

impl From<tokio::task::JoinError> for BackupError {
    fn from(error: tokio::task::JoinError) -> Self {
        BackupError::Open(error.into())
    }
}

/// What was copied.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CopyReport {
    /// Files that were copied.
    pub new: usize,
    /// Files that the copy had already.
    pub known: usize,
    /// Things that the copy had and that are deleted.
    pub removed: usize,
    /// Files that are missing.
    pub missing: Vec<String>,
    /// Files that are not what was stored.
    pub damaged: Vec<String>,
}

impl CopyReport {
    /// Whether everything is there.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.damaged.is_empty()
    }
}

/// Brings a backup up to date; a server may be using the data folder. With `reread`, what the backup has already is
/// read again and held against its checksums.
pub async fn back_up(data: &Path, backup: &Path, reread: bool) -> Result<CopyReport, BackupError> {
    back_up_with(data, backup, reread, None).await
}

/// The same for a data folder whose files may be kept elsewhere: the backup has them in it.
pub async fn back_up_with(
    data: &Path,
    backup: &Path,
    reread: bool,
    objects: Option<&BucketSettings>,
) -> Result<CopyReport, BackupError> {
    apart(data, backup)?;
    let live = database_in(data)?;
    let source = elsewhere::source(data, objects)?;
    let live = SqliteDatabase::open_beside(&live).await?;
    let copied = back_up_from(&live, &source, backup, reread).await;
    live.close().await;
    copied
}

async fn back_up_from(
    live: &SqliteDatabase,
    source: &Arc<dyn Source>,
    backup: &Path,
    reread: bool,
) -> Result<CopyReport, BackupError> {
    let id = live.folder_id().await?.unwrap_or_default();
    let lock = lock(backup).await?;
    if let Some(found) = lock.folder_id().map_err(OpenError::from)?
        && found != id
    {
        return Err(BackupError::OtherFolder { folder: backup.display().to_string(), found, expected: id });
    }
    let mut tries = 0;
    let (new, known, mut report) = loop {
        tries += 1;
        let (new, known, report) = snapshot(live, source, backup, reread).await?;
        let (now, _) = live.known_files().await?;
        let deleted = |place: &String| {
            let mut gone = known.needed().filter(|file| !now.knows(*file));
            gone.any(|file| place.starts_with(&file.to_string()))
        };
        // what was deleted while files were copied is in the database of the copy alone: once more, which is quick now
        if tries == MOST_TRIES || !report.missing.iter().any(deleted) {
            break (new, known, report);
        }
    };
    let backup = backup.to_owned();
    report.removed = blocking(move || {
        copies::publish(&backup, &new, id)?;
        copies::prune(&backup, &known)
    })
    .await?;
    drop(lock);
    Ok(report)
}

/// The database as it is at one moment, with its files.
async fn snapshot(
    live: &SqliteDatabase,
    source: &Arc<dyn Source>,
    backup: &Path,
    reread: bool,
) -> Result<(PathBuf, KnownFiles, CopyReport), BackupError> {
    let place = backup.to_owned();
    let new = blocking(move || copies::new_database(&place)).await?;
    live.write_copy(&new).await?;
    let copy = SqliteDatabase::open_with(&new, Arc::new(NoReserve)).await?;
    // a browser that is signed in here is not so there
    copy.forget_all_sessions().await?;
    // the index is made anew from the signatures
    copy.forget_all_segments().await?;
    let report = copy_files(&copy, source, backup, reread).await?;
    let (known, _) = copy.known_files().await?;
    copy.close().await;
    Ok((new, known, report))
}

/// Puts a backup back into a new folder, each file held against its checksum. A backup of an older version is brought
/// to this one.
pub async fn restore(backup: &Path, data: &Path) -> Result<CopyReport, BackupError> {
    apart(backup, data)?;
    let source = database_in(backup)?;
    let is_new = std::fs::read_dir(data).map_or(true, |mut entries| entries.next().is_none());
    if !is_new {
        return Err(BackupError::NotEmpty(data.display().to_string()));
    }
    // nobody makes a backup, or serves it, meanwhile; where nothing can be written nobody does anyway
    let from = match lock(backup).await {
        Err(refused) if refused.is_read_only() => None,
        taken => Some(taken?),
    };
    let to = lock(data).await?;
    let new = blocking({
        let data = data.to_owned();
        move || {
            let new = copies::new_database(&data)?;
            copies::copy_database(&source, &new)?;
            Ok(new)
        }
    })
    .await?;
    let copy = SqliteDatabase::open_with(&new, Arc::new(NoReserve)).await?;
    let id = copy.folder_id().await?;
    let of_backup: Arc<dyn Source> = Arc::new(backup.to_owned());
    let report = copy_files(&copy, &of_backup, data, true).await?;
    copy.close().await;
    let (data, id) = (data.to_owned(), id.unwrap_or_default());
    blocking(move || copies::publish(&data, &new, id)).await?;
    drop((from, to));
    Ok(report)
}

fn apart(data: &Path, other: &Path) -> Result<(), BackupError> {
    let whole = |path: &Path| std::path::absolute(path).map(|path| path.canonicalize().unwrap_or(path)).ok();
    if let (Some(data), Some(other)) = (whole(data), whole(other))
        && (other.starts_with(&data) || data.starts_with(&other))
    {
        return Err(BackupError::Within(other.display().to_string()));
    }
    Ok(())
}

fn database_in(folder: &Path) -> Result<PathBuf, BackupError> {
    if let Some(place) = local_files::database_server(folder).map_err(OpenError::from)? {
        return Err(BackupError::OnServer { folder: folder.display().to_string(), place });
    }
    match local_files::has_database(folder) {
        true => Ok(local_files::database_of(folder)),
        false => Err(BackupError::NoDatabase(folder.display().to_string())),
    }
}

async fn lock(folder: &Path) -> Result<FolderLock, BackupError> {
    let folder = folder.to_owned();
    let lock = tokio::task::spawn_blocking(move || FolderLock::take(&folder, Duration::ZERO)).await?;
    Ok(lock.map_err(OpenError::from)?)
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ObjectError> + Send + 'static,
) -> Result<T, BackupError> {
    Ok(tokio::task::spawn_blocking(work).await??)
}

/// Copies everything that the rows of `copy` know.
async fn copy_files(
    copy: &SqliteDatabase,
    from: &Arc<dyn Source>,
    to: &Path,
    reread: bool,
) -> Result<CopyReport, BackupError> {
    let mut report = CopyReport::default();
    let mut page = PageRequest { before: None, limit: PAGE };
    loop {
        let sets = copy.scan_sets(&page).await?;
        page.before = sets.next_cursor(|set| set.id.to_string());
        let scans = sets.items.into_iter().flat_map(|set| {
            set.scans.into_iter().map(move |scan| Wanted {
                of: StoredFile::Scan(set.id, scan.file_id),
                asset: None,
                bytes: scan.bytes,
                checksum: scan.checksum,
            })
        });
        copy_all(scans.collect(), from, to, reread, &mut report).await?;
        if page.before.is_none() {
            break;
        }
    }
    loop {
        let models = copy.models(&Default::default(), &page).await?;
        page.before = models.next_cursor(|model| model.id.to_string());
        let mut wanted = Vec::new();
        for model in models.items {
            let assets = copy.assets(model.id).await?.into_iter().map(|asset| Wanted {
                of: StoredFile::Model(model.id),
                asset: Some(asset.name),
                bytes: asset.bytes,
                checksum: asset.checksum,
            });
            wanted.extend(assets);
        }
        copy_all(wanted, from, to, reread, &mut report).await?;
        if page.before.is_none() {
            break;
        }
    }
    let binned = copy.binned_scans().await?.into_iter().map(|(set, scan)| Wanted {
        of: StoredFile::Scan(set, scan.file_id),
        asset: None,
        bytes: scan.bytes,
        checksum: scan.checksum,
    });
    copy_all(binned.collect(), from, to, reread, &mut report).await?;
    let binned = copy.binned_assets().await?.into_iter().map(|(model, asset)| Wanted {
        of: StoredFile::Model(model),
        asset: Some(asset.name),
        bytes: asset.bytes,
        checksum: asset.checksum,
    });
    copy_all(binned.collect(), from, to, reread, &mut report).await?;
    let standards = copy.standards().await?.into_iter().map(|standard| Wanted {
        of: StoredFile::Standard(standard.id),
        asset: Some(standard.asset.name),
        bytes: standard.asset.bytes,
        checksum: standard.asset.checksum,
    });
    copy_all(standards.collect(), from, to, reread, &mut report).await?;
    Ok(report)
}

async fn copy_all(
    wanted: Vec<Wanted>,
    from: &Arc<dyn Source>,
    to: &Path,
    reread: bool,
    report: &mut CopyReport,
) -> Result<(), BackupError> {
    let (from, to) = (Arc::clone(from), to.to_owned());
    let copied = blocking(move || {
        let copied = |file: Wanted| {
            let place = file.place().display().to_string();
            copies::copy(from.as_ref(), &to, &file, reread).map(|copied| (place, copied))
        };
        wanted.into_iter().map(copied).collect::<Result<Vec<_>, _>>()
    })
    .await?;
    for (place, copied) in copied {
        match copied {
            Copied::New => report.new += 1,
            Copied::Known => report.known += 1,
            Copied::Missing => report.missing.push(place),
            Copied::Damaged => report.damaged.push(place),
        }
    }
    Ok(())
}
