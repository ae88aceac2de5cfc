//! Files in the making: uploads that arrive, and models that are being written.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use super::{BlobError, doing, private};

/// A file that has arrived whole but belongs nowhere yet. Removed when dropped.
#[derive(Debug)]
pub struct StagedFile {
    pub(super) path: PathBuf,
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
    pub(super) file: tokio::fs::File,
    pub(super) hasher: blake3::Hasher,
    pub(super) staged: StagedFile,
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

/// The files of a model in the making. Removed when dropped before [`Blobs::keep_model`](super::Blobs::keep_model).
#[derive(Debug)]
pub struct StagedModel {
    pub(super) folder: PathBuf,
}

impl StagedModel {
    /// Writes one file of the model and makes it durable; answers with the BLAKE3 of its content. Blocks.
    pub fn write(&self, asset: &str, content: &[u8]) -> Result<String, BlobError> {
        let mut file = private::create_new(&self.folder.join(asset)).map_err(doing("writing a file of a model"))?;
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
