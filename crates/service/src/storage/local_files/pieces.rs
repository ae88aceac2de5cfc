//! Files that come piece by piece. How much of one has arrived is the size of its file, so what was written before the process
//! was killed counts without anybody having said so.

use std::fs::{self, File};
use std::io;
use std::path::PathBuf;

use async_trait::async_trait;
use tokio::io::AsyncWriteExt;

use super::{LocalFiles, doing, gone, listing, private, sync_folder};
use crate::storage::{ObjectError, PieceWriter, StagedFile};
use visage_domain::UploadId;

const RECEIVING: &str = "storing a piece of an upload";

/// Writes behind what is there.
#[derive(Debug)]
struct LocalPieces(tokio::fs::File);

#[async_trait]
impl PieceWriter for LocalPieces {
    async fn write(&mut self, chunk: &[u8]) -> Result<(), ObjectError> {
        self.0.write_all(chunk).await.map_err(doing(RECEIVING))
    }

    async fn finish(mut self: Box<Self>) -> Result<(), ObjectError> {
        self.0.flush().await.map_err(doing(RECEIVING))?;
        self.0.sync_all().await.map_err(doing(RECEIVING))
    }
}

impl LocalFiles {
    fn pieces(&self, upload: UploadId) -> PathBuf {
        self.uploads().join(upload.to_string())
    }

    pub(super) async fn size_held(&self, upload: UploadId) -> Result<u64, ObjectError> {
        match tokio::fs::metadata(self.pieces(upload)).await {
            Ok(found) => Ok(found.len()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
            Err(error) => Err(doing("looking for what has arrived of an upload")(error)),
        }
    }

    pub(super) async fn go_on(&self, upload: UploadId) -> Result<Box<dyn PieceWriter>, ObjectError> {
        self.check_space_apart(RECEIVING).await?;
        let (path, folder) = (self.pieces(upload), self.uploads());
        let open = move || -> io::Result<File> {
            let is_new = !path.exists();
            let file = private::options().append(true).create(true).open(path)?;
            if is_new {
                sync_folder(&folder)?;
            }
            Ok(file)
        };
        let opened = tokio::task::spawn_blocking(open).await.map_err(|e| doing(RECEIVING)(io::Error::other(e)))?;
        Ok(Box::new(LocalPieces(tokio::fs::File::from_std(opened.map_err(doing(RECEIVING))?))))
    }

    /// A second name for the same bytes: a crash loses neither, and nothing is copied where the file system has such names.
    pub(super) fn stage_pieces(&self, upload: UploadId) -> Result<StagedFile, ObjectError> {
        let mut staged = StagedFile::new(self.staging.new_id(), self.staging.clone());
        let (from, to) = (self.pieces(upload), self.staging.path(staged.id()));
        let stage = || -> io::Result<(u64, blake3::Hash)> {
            if fs::hard_link(&from, &to).is_err() {
                fs::copy(&from, &to)?;
                File::open(&to)?.sync_all()?;
            }
            let mut file = File::open(&to)?;
            let mut hasher = blake3::Hasher::new();
            hasher.update_reader(&mut file)?;
            Ok((file.metadata()?.len(), hasher.finalize()))
        };
        let (bytes, checksum) = stage().map_err(doing("putting an upload together"))?;
        (staged.bytes, staged.checksum) = (bytes, checksum.to_hex().to_string());
        Ok(staged)
    }

    pub(super) fn drop_pieces(&self, upload: UploadId) -> Result<(), ObjectError> {
        gone(fs::remove_file(self.pieces(upload))).map_err(doing("removing an upload"))
    }

    pub(super) fn list_pieces(&self) -> Result<Vec<UploadId>, ObjectError> {
        listing::ids(&self.uploads(), UploadId::parse).map_err(doing("reading the folder of uploads"))
    }
}
