//! The only module that knows where files are kept.
//!
//! ```text
//! DATA/visage.lock                 held while a server uses the folder
//! DATA/visage.sqlite               the database (opened by `store`)
//! DATA/staging/...                 uploads and models in the making; emptied at start
//! DATA/scan-sets/{set}/{file}      scans, under ids of ours
//! DATA/models/{model}/{asset}      files of models, under names of ours
//! DATA/standards/{standard}/{asset} files that standards were made of
//! ```
//! Files are written and synced under `staging` and then moved by one rename, so a file that is where it belongs
//! is whole. The database row comes after the file: what a crash leaves without a row is swept at the next start.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::store::{FileId, KnownFiles, ModelId, ScanSetId, StandardId};

/// How often a lock that is held is tried again.
const LOCK_POLL: Duration = Duration::from_millis(20);

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
}

impl BlobError {
    /// Whether the disk is full.
    pub fn is_storage_full(&self) -> bool {
        let BlobError::Io { source, .. } = self else { return false };
        matches!(source.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
    }
    /// Whether memory or descriptors have run out (ENOMEM, ENFILE, EMFILE), which come free again.
    pub fn is_shortage(&self) -> bool {
        cfg!(unix)
            && matches!(self, BlobError::Io { source, .. } if matches!(source.raw_os_error(), Some(12 | 23 | 24)))
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
}

/// A file that has arrived whole but belongs nowhere yet. Removed when dropped.
#[derive(Debug)]
pub struct StagedFile {
    path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub checksum: String,
}

impl StagedFile {
    /// Its content. Blocks.
    pub fn read(&self) -> Result<Vec<u8>, BlobError> {
        fs::read(&self.path).map_err(doing("reading an uploaded file"))
    }
}

impl Drop for StagedFile {
    fn drop(&mut self) {
        // already moved away in the good case
        let _ = fs::remove_file(&self.path);
    }
}

/// A file that is being received. What was written is removed when it is dropped unfinished.
#[derive(Debug)]
pub struct StagedWriter {
    file: tokio::fs::File,
    hasher: blake3::Hasher,
    staged: StagedFile,
}

impl StagedWriter {
    /// Appends what has arrived.
    pub async fn write(&mut self, chunk: &[u8]) -> Result<(), BlobError> {
        use tokio::io::AsyncWriteExt;
        self.hasher.update(chunk);
        self.staged.bytes += chunk.len() as u64;
        self.file.write_all(chunk).await.map_err(doing("storing an upload"))
    }

    /// Makes what was written durable.
    pub async fn finish(mut self) -> Result<StagedFile, BlobError> {
        use tokio::io::AsyncWriteExt;
        self.file.flush().await.map_err(doing("storing an upload"))?;
        self.file.sync_all().await.map_err(doing("storing an upload"))?;
        self.staged.checksum = self.hasher.finalize().to_hex().to_string();
        Ok(self.staged)
    }
}

/// The files of a model in the making. Removed when dropped before [`Blobs::keep_model`].
#[derive(Debug)]
pub struct StagedModel {
    folder: PathBuf,
}

impl StagedModel {
    /// Writes one file of the model and makes it durable; answers with the BLAKE3 of its content. Blocks.
    pub fn write(&self, asset: &str, content: &[u8]) -> Result<String, BlobError> {
        let mut file = File::create_new(self.folder.join(asset)).map_err(doing("writing a file of a model"))?;
        file.write_all(content).and_then(|()| file.sync_all()).map_err(doing("writing a file of a model"))?;
        Ok(blake3::hash(content).to_hex().to_string())
    }

    /// Takes an uploaded file over as a file of the model. Blocks.
    pub fn take(&self, asset: &str, file: &StagedFile) -> Result<(), BlobError> {
        fs::rename(&file.path, self.folder.join(asset)).map_err(doing("keeping an uploaded model"))
    }
}

impl Drop for StagedModel {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Blobs {
    /// Takes the folder into use: creates it when absent (readable by its owner alone) and locks it. A process that
    /// has just been killed holds its lock until the system has taken it apart: `patience` is how long that may
    /// take. Blocks.
    pub fn open(root: &Path, patience: Duration) -> Result<Blobs, BlobError> {
        create_private(root).map_err(doing("creating the data folder"))?;
        let lock = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(root.join("visage.lock"))
            .map_err(doing("opening the lock of the data folder"))?;
        let begin = Instant::now();
        loop {
            match lock.try_lock() {
                Ok(()) => break,
                Err(fs::TryLockError::WouldBlock) if begin.elapsed() < patience => std::thread::sleep(LOCK_POLL),
                Err(fs::TryLockError::WouldBlock) => {
                    return Err(BlobError::Locked { folder: root.display().to_string() });
                }
                Err(fs::TryLockError::Error(error)) => return Err(doing("locking the data folder")(error)),
            }
        }
        let blobs = Blobs { root: root.to_owned(), _lock: lock };
        for folder in [blobs.staging(), blobs.scan_sets(), blobs.models(), blobs.standards()] {
            create_private(&folder).map_err(doing("creating the data folder"))?;
        }
        Ok(blobs)
    }

    /// Where the database is.
    pub fn database(&self) -> PathBuf {
        self.root.join("visage.sqlite")
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
        let file = tokio::fs::File::create_new(&path).await.map_err(doing("storing an upload"))?;
        let staged = StagedFile { path, bytes: 0, checksum: String::new() };
        Ok(StagedWriter { file, hasher: blake3::Hasher::new(), staged })
    }

    /// Moves a received file to where the scans of the set are. Blocks.
    pub fn keep_scan(&self, staged: &StagedFile, set: ScanSetId, file: FileId) -> Result<(), BlobError> {
        let folder = self.scan_sets().join(set.to_string());
        let keep = || -> io::Result<()> {
            create_private(&folder)?;
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
        let folder = self.staging().join(FileId::new().to_string());
        create_private(&folder).map_err(doing("writing a model"))?;
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

    /// Opens a file of a model; `None` if it is not there.
    pub async fn open_asset(&self, model: ModelId, asset: &str) -> Result<Option<tokio::fs::File>, BlobError> {
        match tokio::fs::File::open(self.models().join(model.to_string()).join(asset)).await {
            Ok(file) => Ok(Some(file)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(doing("reading a file of a model")(error)),
        }
    }

    /// Removes a model's files. Blocks.
    pub fn remove_model(&self, model: ModelId) -> Result<(), BlobError> {
        gone(fs::remove_dir_all(self.models().join(model.to_string()))).map_err(doing("removing a model"))
    }

    /// The content of a file of a model; `None` if it is not there. Blocks.
    pub fn read_asset(&self, model: ModelId, asset: &str) -> Result<Option<Vec<u8>>, BlobError> {
        match fs::read(self.models().join(model.to_string()).join(asset)) {
            Ok(content) => Ok(Some(content)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(doing("reading a file of a model")(error)),
        }
    }

    /// Moves the file of a standard to where it belongs. Blocks.
    pub fn keep_standard(&self, staged: &StagedFile, standard: StandardId, asset: &str) -> Result<(), BlobError> {
        let folder = self.standards().join(standard.to_string());
        let keep = || -> io::Result<()> {
            create_private(&folder)?;
            fs::rename(&staged.path, folder.join(asset))?;
            sync_folder(&folder)?;
            sync_folder(&self.standards())
        };
        keep().map_err(doing("keeping a standard"))
    }

    /// The file that a standard was made of. Blocks.
    pub fn read_standard(&self, standard: StandardId, asset: &str) -> Result<Vec<u8>, BlobError> {
        fs::read(self.standards().join(standard.to_string()).join(asset)).map_err(doing("reading a standard"))
    }

    /// Removes a standard's file. Blocks.
    pub fn remove_standard(&self, standard: StandardId) -> Result<(), BlobError> {
        gone(fs::remove_dir_all(self.standards().join(standard.to_string()))).map_err(doing("removing a standard"))
    }

    /// Removes whatever the database does not know, left by a crash; answers with the number of things removed.
    /// Only before the service begins: uploads in flight look just the same. Blocks.
    pub fn sweep(&self, known: &KnownFiles) -> Result<usize, BlobError> {
        let sweep = || -> io::Result<usize> {
            let mut removed = sweep_folder(&self.staging(), |_| false)?;
            removed +=
                sweep_folder(&self.models(), |name| ModelId::parse(name).is_some_and(|id| known.models.contains(&id)))?;
            removed += sweep_folder(&self.standards(), |name| {
                StandardId::parse(name).is_some_and(|id| known.standards.contains(&id))
            })?;
            removed += sweep_folder(&self.scan_sets(), |name| {
                ScanSetId::parse(name).is_some_and(|id| known.scan_sets.contains(&id))
            })?;
            for set in fs::read_dir(self.scan_sets())? {
                removed +=
                    sweep_folder(&set?.path(), |name| FileId::parse(name).is_some_and(|id| known.scans.contains(&id)))?;
            }
            Ok(removed)
        };
        sweep().map_err(doing("sweeping the data folder"))
    }
}

/// Creates a folder, and those above it, that only its owner may enter: scans of people are nobody else's business.
fn create_private(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
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

fn sweep_folder(folder: &Path, keep: impl Fn(&str) -> bool) -> io::Result<usize> {
    let mut removed = 0;
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(&keep) {
            continue;
        }
        let remove = if entry.file_type()?.is_dir() { fs::remove_dir_all } else { fs::remove_file };
        remove(entry.path())?;
        removed += 1;
    }
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blobs() -> (Blobs, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        (Blobs::open(folder.path(), Duration::ZERO).expect("opened"), folder)
    }

    async fn staged(blobs: &Blobs, content: &[u8]) -> StagedFile {
        let mut writer = blobs.receive().await.expect("staging");
        for chunk in content.chunks(3) {
            writer.write(chunk).await.expect("written");
        }
        writer.finish().await.expect("finished")
    }

    fn entries(folder: &Path) -> usize {
        fs::read_dir(folder).expect("a folder").count()
    }

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
    async fn what_no_row_knows_is_swept() {
        let (blobs, _folder) = blobs();
        let (set, known_file, lost_file) = (ScanSetId::new(), FileId::new(), FileId::new());
        for file in [known_file, lost_file] {
            blobs.keep_scan(&staged(&blobs, b"x").await, set, file).expect("kept");
        }
        blobs.keep_scan(&staged(&blobs, b"x").await, ScanSetId::new(), FileId::new()).expect("kept");
        let models = [ModelId::new(), ModelId::new()];
        for model in models {
            let folder = blobs.stage_model().expect("staged");
            folder.write("report.json", b"{}").expect("written");
            blobs.keep_model(&folder, model).expect("kept");
        }
        fs::write(blobs.staging().join("leftover"), b"x").expect("written");
        let standards = [StandardId::new(), StandardId::new()];
        for standard in standards {
            blobs.keep_standard(&staged(&blobs, b"x").await, standard, "model.ply").expect("kept");
        }
        let known = KnownFiles {
            scan_sets: [set].into(),
            scans: [known_file].into(),
            models: [models[0]].into(),
            standards: [standards[0]].into(),
        };
        assert_eq!(blobs.sweep(&known).expect("swept"), 5);
        assert!(blobs.read_standard(standards[0], "model.ply").is_ok());
        assert!(blobs.read_standard(standards[1], "model.ply").is_err());
        assert!(blobs.read_scan(set, known_file).is_ok());
        assert!(blobs.read_scan(set, lost_file).is_err());
        assert!(blobs.open_asset(models[0], "report.json").await.expect("asked").is_some());
        assert!(blobs.open_asset(models[1], "report.json").await.expect("asked").is_none());
        assert_eq!(entries(&blobs.staging()), 0);
    }
}
