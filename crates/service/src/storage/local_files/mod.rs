//! Files in a local folder: the only module that knows where they are kept.
//!
//! ```text
//! DATA/visage.folder               whose folder it is: an id that the database holds too
//! DATA/visage.lock                 held while a server uses the folder
//! DATA/visage.sqlite               the database (opened by `sqlite`)
//! DATA/reserve                     space for when the disk is full
//! DATA/staging/...                 uploads and models in the making; swept at start
//! DATA/uploads/{upload}            what has arrived of files that come piece by piece
//! DATA/scan-sets/{set}/{file}      scans, under ids of ours
//! DATA/models/{model}/{asset}      files of models, under names of ours
//! DATA/standards/{standard}/{asset} files that standards were made of
//! DATA/visage.node                 which node of that server's the folder is
//! DATA/visage.database             on which server the database is if not here
//! DATA/visage.objects              where scans, models and standards are if not here
//! DATA/cache/...                   those of them that were used last
//! DATA/segments/{segment}          the index, made of signatures: what is lost of it is made anew
//! DATA/trash/{id}/...              what a start found without a row, for a while
//! ```
//! Files are written and synced under `staging` and then moved by one rename, so a file that is where it belongs is
//! whole. The database says beforehand that a file is coming (`Files::expect_files`), and has its row afterwards: what
//! a crash leaves without a row is known to be that, and is set aside at the next start. Other files without a row
//! mean that the database is not the one of this folder: then nothing is touched.
//!
//! - `folder`: whose it is, lock and marker; `private`: who may read; `reserve`: space for when there is none
//! - `files`: the folder as an [`ObjectStore`](crate::storage::ObjectStore); `staged`: files in the making; `verified`:
//!   files are what was stored
//! - `segments`: files of the index
//! - `pieces`: files that come piece by piece
//! - `server`: that the database is on a server; `elsewhere`: that files are kept in another place, with a cache here
//! - `listing`, `sweep`: what is there, the trash; [`copies`]: backups

pub mod copies;
mod elsewhere;
mod files;
mod folder;
mod listing;
mod pieces;
mod private;
mod reserve;
mod segments;
mod server;
mod staged;
mod sweep;
mod verified;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::storage::{ObjectError, Reserve};
use visage_domain::{FileId, ScanSetId};

pub(in crate::storage) use elsewhere::elsewhere;
#[cfg(feature = "s3")]
pub(in crate::storage) use elsewhere::{create_private_file, create_private_folder};
pub(in crate::storage) use folder::is_in_use;
pub use folder::{FolderError, FolderLock};
pub use reserve::DiskReserve;
pub(in crate::storage) use server::database_server;

/// Where the database of a folder is.
pub fn database_of(root: &Path) -> PathBuf {
    root.join("visage.sqlite")
}

/// Whether there is one that anything was stored in.
pub(in crate::storage) fn has_database(root: &Path) -> bool {
    std::fs::metadata(database_of(root)).is_ok_and(|found| found.len() > 0)
}

/// Names what was being done when the file system said no.
fn doing(doing: &'static str) -> impl FnOnce(io::Error) -> ObjectError {
    move |source| ObjectError::Io { doing, source }
}

/// The folder of files. One per process and folder: it holds the folder's lock.
#[derive(Debug)]
pub struct LocalFiles {
    root: PathBuf,
    _lock: File,
    reserve: Arc<DiskReserve>,
    sound: Arc<verified::Sound>,
    staging: Arc<staged::StagingFolder>,
}

impl LocalFiles {
    fn at(root: &Path, lock: File) -> LocalFiles {
        let reserve = Arc::new(DiskReserve::open(root));
        let staging = Arc::new(staged::StagingFolder::new(root.join("staging")));
        LocalFiles { root: root.to_owned(), _lock: lock, reserve, sound: Arc::default(), staging }
    }

    /// The space that is kept for when the disk is full.
    pub fn reserve(&self) -> Arc<DiskReserve> {
        Arc::clone(&self.reserve)
    }

    /// What is to be stored takes space: refused while the reserve is given away.
    fn check_space(&self, what: &'static str) -> Result<(), ObjectError> {
        if self.reserve.is_whole() { Ok(()) } else { Err(doing(what)(io::ErrorKind::StorageFull.into())) }
    }

    /// The same from where nothing may block.
    async fn check_space_apart(&self, what: &'static str) -> Result<(), ObjectError> {
        let reserve = self.reserve();
        let has_space = tokio::task::spawn_blocking(move || reserve.is_whole()).await.unwrap_or(false);
        if has_space { Ok(()) } else { Err(doing(what)(io::ErrorKind::StorageFull.into())) }
    }

    /// Where the database is.
    pub fn database(&self) -> PathBuf {
        database_of(&self.root)
    }

    fn trash(&self) -> PathBuf {
        self.root.join("trash")
    }

    #[cfg(test)]
    fn staging_folder(&self) -> PathBuf {
        self.root.join("staging")
    }

    fn uploads(&self) -> PathBuf {
        self.root.join("uploads")
    }

    fn scan_sets(&self) -> PathBuf {
        self.root.join("scan-sets")
    }

    fn models(&self) -> PathBuf {
        self.root.join("models")
    }

    fn segment_folder(&self) -> PathBuf {
        self.root.join("segments")
    }

    fn standards(&self) -> PathBuf {
        self.root.join("standards")
    }

    fn scan(&self, set: ScanSetId, file: FileId) -> PathBuf {
        self.scan_sets().join(set.to_string()).join(file.to_string())
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
    use std::fs;
    use std::time::Duration;

    use super::*;
    use crate::storage::conformance::ObjectPlace;
    use crate::storage::{ObjectStore, StagedFile};
    use visage_domain::StoredFile;

    pub fn files() -> (LocalFiles, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        (LocalFiles::open(folder.path(), Duration::ZERO).expect("opened"), folder)
    }

    pub async fn staged(files: &LocalFiles, content: &[u8]) -> StagedFile {
        let mut writer = files.receive().await.expect("staging");
        for chunk in content.chunks(3) {
            writer.write(chunk).await.expect("written");
        }
        writer.finish().await.expect("finished")
    }

    pub fn entries(folder: &Path) -> usize {
        fs::read_dir(folder).expect("a folder").count()
    }

    struct LocalPlace {
        folder: tempfile::TempDir,
    }

    impl ObjectPlace for LocalPlace {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("a temporary folder");
            // without its database a folder that holds something is not opened again
            fs::write(folder.path().join("visage.sqlite"), "a database").expect("written");
            LocalPlace { folder }
        }

        fn open(&self) -> Arc<dyn ObjectStore> {
            Arc::new(LocalFiles::open(self.folder.path(), Duration::ZERO).expect("nobody else has it"))
        }

        fn damage(&self, file: StoredFile, asset: Option<&str>) {
            let mut path = self.folder.path().join(file.to_string());
            path.extend(asset);
            let mut content = fs::read(&path).expect("published");
            content[0] ^= 1;
            fs::write(&path, content).expect("changed");
        }
    }

    mod conformance {
        use super::LocalPlace;

        crate::storage::conformance::object_conformance!(LocalPlace);

        #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
        async fn a_model_is_published_by_one_step() {
            use crate::storage::conformance::{ObjectPlace, objects};
            objects::a_model_is_published_by_one_step(&LocalPlace::new()).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::time::Duration;

    use super::testing::files;
    use super::*;

    use crate::storage::ObjectStore;

    #[test]
    fn a_second_server_is_refused() {
        let (files, folder) = files();
        let refused = LocalFiles::open(folder.path(), Duration::ZERO).expect_err("locked");
        assert!(matches!(refused, FolderError::Locked { .. }), "{refused}");
        let holder = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            drop(files);
        });
        LocalFiles::open(folder.path(), Duration::from_secs(10)).expect("free again after a while");
        holder.join().expect("no panic");
    }

    #[tokio::test]
    async fn nothing_is_taken_in_while_the_reserve_is_given_away() {
        /// There is space here: only a folder in its place keeps the reserve from being filled again.
        fn keep_empty(files: &LocalFiles) {
            fs::remove_file(files.root.join("reserve")).expect("there");
            fs::create_dir(files.root.join("reserve")).expect("created");
        }
        let (files, _folder) = files();
        assert!(files.reserve().give());
        keep_empty(&files);
        assert!(files.receive().await.expect_err("full").is_storage_full());
        assert!(files.stage_model().expect_err("full").is_storage_full());
        fs::remove_dir(files.root.join("reserve")).expect("there");
        files.receive().await.expect("there is space");
    }
}
