//! Files in the making: uploads that arrive, and models that are being written.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use async_trait::async_trait;

use super::{doing, listing};
use crate::storage::{ObjectError, StagedFile, StagedWriter, Staging};
use visage_domain::FileId;

/// The folder in which they are, under ids.
#[derive(Debug)]
pub(super) struct StagingFolder {
    folder: PathBuf,
    /// What this process has staged. The folder's lock says that all else was left by one that has ended.
    own: Mutex<BTreeSet<FileId>>,
}

impl StagingFolder {
    pub(super) fn new(folder: PathBuf) -> Self {
        StagingFolder { folder, own: Mutex::default() }
    }

    /// An id to stage something under.
    pub(super) fn new_id(&self) -> FileId {
        let id = FileId::new();
        self.own().insert(id);
        id
    }

    /// Where it is staged.
    pub(super) fn path(&self, id: FileId) -> PathBuf {
        self.folder.join(id.to_string())
    }

    /// Removes what this process has not staged; answers with the number of things.
    pub(super) fn sweep(&self) -> io::Result<usize> {
        let mut left = listing::ids(&self.folder, FileId::parse)?;
        left.retain(|id| !self.own().contains(id));
        for id in &left {
            let path = self.path(*id);
            if path.is_dir() { fs::remove_dir_all(path)? } else { fs::remove_file(path)? }
        }
        Ok(left.len())
    }

    fn own(&self) -> MutexGuard<'_, BTreeSet<FileId>> {
        self.own.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Staging for StagingFolder {
    fn discard(&self, id: FileId) {
        // already moved away in the good case
        let path = self.path(id);
        let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
        self.own().remove(&id);
    }
}

/// An upload that is written to its file.
#[derive(Debug)]
pub(super) struct LocalWriter {
    file: tokio::fs::File,
    hasher: blake3::Hasher,
    staged: StagedFile,
}

impl LocalWriter {
    pub(super) fn new(file: tokio::fs::File, staged: StagedFile) -> Self {
        LocalWriter { file, hasher: blake3::Hasher::new(), staged }
    }
}

#[async_trait]
impl StagedWriter for LocalWriter {
    async fn write(&mut self, chunk: &[u8]) -> Result<(), ObjectError> {
        use tokio::io::AsyncWriteExt;
        self.hasher.update(chunk);
        self.staged.bytes += chunk.len() as u64;
        self.file.write_all(chunk).await.map_err(doing("storing an upload"))
    }

    async fn finish(mut self: Box<Self>) -> Result<StagedFile, ObjectError> {
        use tokio::io::AsyncWriteExt;
        self.file.flush().await.map_err(doing("storing an upload"))?;
        self.file.sync_all().await.map_err(doing("storing an upload"))?;
        self.staged.checksum = self.hasher.finalize().to_hex().to_string();
        Ok(self.staged)
    }
}
