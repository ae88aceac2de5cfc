//! The only module that knows where files are kept.
//!
//! ```text
//! DATA/visage.folder               whose folder it is: an id that the database holds too
//! DATA/visage.lock                 held while a server uses the folder
//! DATA/visage.sqlite               the database (opened by `store`)
//! DATA/reserve                     space for when the disk is full
//! DATA/staging/...                 uploads and models in the making; emptied at start
//! DATA/scan-sets/{set}/{file}      scans, under ids of ours
//! DATA/models/{model}/{asset}      files of models, under names of ours
//! DATA/standards/{standard}/{asset} files that standards were made of
//! DATA/trash/{id}/...              what a start found without a row, for a while
//! ```
//! Files are written and synced under `staging` and then moved by one rename, so a file that is where it belongs is
//! whole. The database says beforehand that a file is coming (`Store::expect_files`), and has its row afterwards: what
//! a crash leaves without a row is known to be that, and is set aside at the next start. Other files without a row
//! mean that the database is not the one of this folder: then nothing is touched.
//!
//! - `folder`: whose it is, lock and marker; `private`: who may read; `reserve`: space for when there is none
//! - `staged`: files in the making; `verified`: files are what was stored
//! - `listing`, `sweep`: what is there, the trash

mod folder;
mod listing;
mod private;
mod reserve;
mod staged;
mod sweep;
mod verified;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::store::{FileId, ModelId, Reserve, ScanSetId, StandardId};

pub use reserve::DiskReserve;
pub use staged::{StagedFile, StagedModel, StagedWriter};
pub use sweep::TRASH_DAYS;

/// Why a file could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum BlobError {
    /// The file system said no.
    #[error("{doing}: {source}")]
    Io {
        /// What was being done.
        doing: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// Another process uses the folder.
    #[error("{folder} is in use by another visage server; stop it, or choose another --data folder")]
    Locked {
        /// The data folder.
        folder: String,
    },
    /// The folder is somebody else's.
    #[error("{folder} is no data folder of visage: it holds {found}; choose an empty or new folder for --data")]
    Foreign {
        /// The folder.
        folder: String,
        /// What is in it.
        found: String,
    },
    /// There are files but no database that knows them.
    #[error(
        "the database of {folder} is {database}, but there are {files} scans, models and standards in the folder: put \
         visage.sqlite back from a backup (and remove visage.sqlite-wal and -shm, if there are any), or choose another \
         --data folder to begin anew"
    )]
    DatabaseLost {
        /// The data folder.
        folder: String,
        /// "missing" or "empty".
        database: &'static str,
        /// How many things would be lost.
        files: usize,
    },
    /// A file is not what was stored.
    #[error("{what} is not what was stored: its checksum differs")]
    Damaged {
        /// Which file.
        what: String,
    },
}

impl BlobError {
    /// Whether the disk is full.
    pub fn is_storage_full(&self) -> bool {
        let BlobError::Io { source, .. } = self else { return false };
        matches!(source.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
    }

    /// Whether memory or descriptors have run out, which come free again.
    pub fn is_shortage(&self) -> bool {
        use nix::errno::Errno;
        let BlobError::Io { source, .. } = self else { return false };
        source
            .raw_os_error()
            .is_some_and(|code| [Errno::ENOMEM, Errno::EMFILE, Errno::ENFILE].contains(&Errno::from_raw(code)))
    }
}

/// Names what was being done when the file system said no.
fn doing(doing: &'static str) -> impl FnOnce(io::Error) -> BlobError {
    move |source| BlobError::Io { doing, source }
}

/// The folder of files. One per process and folder: it holds the folder's lock.
#[derive(Debug)]
pub struct Blobs {
    root: PathBuf,
    _lock: File,
    reserve: Arc<DiskReserve>,
    sound: verified::Sound,
}

impl Blobs {
    fn at(root: &Path, lock: File) -> Blobs {
        let reserve = Arc::new(DiskReserve::open(root));
        Blobs { root: root.to_owned(), _lock: lock, reserve, sound: verified::Sound::default() }
    }

    /// The space that is kept for when the disk is full.
    pub fn reserve(&self) -> Arc<DiskReserve> {
        Arc::clone(&self.reserve)
    }

    /// What is to be stored takes space: refused while the reserve is given away.
    fn check_space(&self, what: &'static str) -> Result<(), BlobError> {
        if self.reserve.is_whole() { Ok(()) } else { Err(doing(what)(io::ErrorKind::StorageFull.into())) }
    }

    /// Where the database is.
    pub fn database(&self) -> PathBuf {
        self.root.join("visage.sqlite")
    }

    fn trash(&self) -> PathBuf {
        self.root.join("trash")
    }

    fn staging(&self) -> PathBuf {
        self.root.join("staging")
    }

    fn scan_sets(&self) -> PathBuf {
        self.root.join("scan-sets")
    }

    fn models(&self) -> PathBuf {
        self.root.join("models")
    }

    fn standards(&self) -> PathBuf {
        self.root.join("standards")
    }

    fn scan(&self, set: ScanSetId, file: FileId) -> PathBuf {
        self.scan_sets().join(set.to_string()).join(file.to_string())
    }

    /// A new file to receive an upload into.
    pub async fn receive(&self) -> Result<StagedWriter, BlobError> {
        let path = self.staging().join(FileId::new().to_string());
        let what = "storing an upload";
        let reserve = self.reserve();
        let has_space = tokio::task::spawn_blocking(move || reserve.is_whole()).await.unwrap_or(false);
        if !has_space {
            return Err(doing(what)(io::ErrorKind::StorageFull.into()));
        }
        let mut options = tokio::fs::OpenOptions::from(private::options());
        let file = options.write(true).create_new(true).open(&path).await.map_err(doing(what))?;
        let staged = StagedFile { path, bytes: 0, checksum: String::new() };
        Ok(StagedWriter { file, hasher: blake3::Hasher::new(), staged })
    }

    /// Moves a received file to where the scans of the set are. Blocks.
    pub fn keep_scan(&self, staged: &StagedFile, set: ScanSetId, file: FileId) -> Result<(), BlobError> {
        let folder = self.scan_sets().join(set.to_string());
        let keep = || -> io::Result<()> {
            private::create_folder(&folder)?;
            fs::rename(&staged.path, folder.join(file.to_string()))?;
            sync_folder(&folder)?;
            sync_folder(&self.scan_sets())
        };
        keep().map_err(doing("keeping a scan"))
    }

    /// The content of a scan. Blocks.
    pub fn read_scan(&self, set: ScanSetId, file: FileId) -> Result<Vec<u8>, BlobError> {
        fs::read(self.scan(set, file)).map_err(doing("reading a scan"))
    }

    /// Removes one scan's file. Blocks.
    pub fn remove_scan(&self, set: ScanSetId, file: FileId) -> Result<(), BlobError> {
        gone(fs::remove_file(self.scan(set, file))).map_err(doing("removing a scan"))
    }

    /// Removes all scans of a set. Blocks.
    pub fn remove_scan_set(&self, set: ScanSetId) -> Result<(), BlobError> {
        gone(fs::remove_dir_all(self.scan_sets().join(set.to_string()))).map_err(doing("removing a scan set"))
    }

    /// A folder to write a model's files into. Blocks.
    pub fn stage_model(&self) -> Result<StagedModel, BlobError> {
        self.check_space("writing a model")?;
        let folder = self.staging().join(FileId::new().to_string());
        private::create_folder(&folder).map_err(doing("writing a model"))?;
        Ok(StagedModel { folder })
    }

    /// Moves a model's files to where they belong, by one rename. Blocks.
    pub fn keep_model(&self, staged: &StagedModel, model: ModelId) -> Result<(), BlobError> {
        let keep = || -> io::Result<()> {
            sync_folder(&staged.folder)?;
            fs::rename(&staged.folder, self.models().join(model.to_string()))?;
            sync_folder(&self.models())
        };
        keep().map_err(doing("keeping a model"))
    }

    /// Removes a model's files. Blocks.
    pub fn remove_model(&self, model: ModelId) -> Result<(), BlobError> {
        gone(fs::remove_dir_all(self.models().join(model.to_string()))).map_err(doing("removing a model"))
    }

    /// Moves the file of a standard to where it belongs. Blocks.
    pub fn keep_standard(&self, staged: &StagedFile, standard: StandardId, asset: &str) -> Result<(), BlobError> {
        let folder = self.standards().join(standard.to_string());
        let keep = || -> io::Result<()> {
            private::create_folder(&folder)?;
            fs::rename(&staged.path, folder.join(asset))?;
            sync_folder(&folder)?;
            sync_folder(&self.standards())
        };
        keep().map_err(doing("keeping a standard"))
    }

    /// Removes a standard's file. Blocks.
    pub fn remove_standard(&self, standard: StandardId) -> Result<(), BlobError> {
        gone(fs::remove_dir_all(self.standards().join(standard.to_string()))).map_err(doing("removing a standard"))
    }
}

/// Makes renames within a folder durable.
fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// What is already gone needs no removing.
fn gone(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Bytes that may still be written where a folder is.
fn free_space(folder: &Path) -> io::Result<u64> {
    let found = nix::sys::statvfs::statvfs(folder)?;
    // the types differ between systems
    #[allow(clippy::unnecessary_cast, clippy::useless_conversion)]
    Ok((found.blocks_available() as u64).saturating_mul(found.fragment_size() as u64))
}

#[cfg(test)]
pub(super) mod testing {
    use std::time::Duration;

    use super::*;

    pub fn blobs() -> (Blobs, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        (Blobs::open(folder.path(), Duration::ZERO).expect("opened"), folder)
    }

    pub async fn staged(blobs: &Blobs, content: &[u8]) -> StagedFile {
        let mut writer = blobs.receive().await.expect("staging");
        for chunk in content.chunks(3) {
            writer.write(chunk).await.expect("written");
        }
        writer.finish().await.expect("finished")
    }

    pub fn entries(folder: &Path) -> usize {
        fs::read_dir(folder).expect("a folder").count()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::testing::{blobs, entries, staged};
    use super::*;
    #[test]
    fn a_second_server_is_refused() {
        let (blobs, folder) = blobs();
        let refused = Blobs::open(folder.path(), Duration::ZERO).expect_err("locked");
        assert!(matches!(refused, BlobError::Locked { .. }), "{refused}");
        let holder = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            drop(blobs);
        });
        Blobs::open(folder.path(), Duration::from_secs(10)).expect("free again after a while");
        holder.join().expect("no panic");
    }

    #[tokio::test]
    async fn a_scan_arrives_whole_and_goes_with_its_set() {
        let (blobs, _folder) = blobs();
        let (set, file) = (ScanSetId::new(), FileId::new());
        let upload = staged(&blobs, b"ten points").await;
        assert_eq!(upload.bytes, 10);
        assert_eq!(upload.checksum, blake3::hash(b"ten points").to_hex().to_string());
        blobs.keep_scan(&upload, set, file).expect("kept");
        drop(upload);
        assert_eq!(blobs.read_scan(set, file).expect("there"), b"ten points");
        blobs.remove_scan_set(set).expect("removed");
        assert!(blobs.read_scan(set, file).is_err());
        blobs.remove_scan_set(set).expect("nothing left to remove");
    }

    #[tokio::test]
    async fn an_upload_that_is_given_up_leaves_nothing() {
        let (blobs, _folder) = blobs();
        let mut writer = blobs.receive().await.expect("staging");
        writer.write(b"half").await.expect("written");
        assert_eq!(entries(&blobs.staging()), 1);
        drop(writer);
        drop(staged(&blobs, b"whole but unwanted").await);
        assert_eq!(entries(&blobs.staging()), 0);
    }

    #[tokio::test]
    async fn nothing_is_taken_in_while_the_reserve_is_given_away() {
        /// There is space here: only a folder in its place keeps the reserve from being filled again.
        fn keep_empty(blobs: &Blobs) {
            fs::remove_file(blobs.root.join("reserve")).expect("there");
            fs::create_dir(blobs.root.join("reserve")).expect("created");
        }
        let (blobs, _folder) = blobs();
        assert!(blobs.reserve().give());
        keep_empty(&blobs);
        assert!(blobs.receive().await.expect_err("full").is_storage_full());
        assert!(blobs.stage_model().expect_err("full").is_storage_full());
        fs::remove_dir(blobs.root.join("reserve")).expect("there");
        blobs.receive().await.expect("there is space");
    }
}
