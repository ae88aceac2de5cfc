//! Files of scans, models and standards: what every place that keeps them has to offer.
//!
//! What arrives is staged first and published by one step: a file that is where it belongs is whole. What is staged and
//! not published goes when its handle is dropped.
//!
//! Calls that read or write whole files block. They come from threads of jobs and from threads for checks, which have
//! to hold the content in memory anyway; a backend across a network waits there on a runtime of its own. Only what runs
//! beside a connection is async: uploads come chunk by chunk, and downloads go the same way.

use std::fmt::Debug;
use std::io;
use std::sync::Arc;

use async_trait::async_trait;
use tokio::io::{AsyncRead, AsyncSeek};

use super::SegmentStore;
use visage_domain::{
    AssetRecord, FileId, KnownFiles, ModelId, ScanRecord, ScanSetId, StandardId, StoredFile, UploadId,
};

/// How long what was set aside is kept.
pub const TRASH_DAYS: u32 = 30;

/// Why a file could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum ObjectError {
    /// The system said no.
    #[error("{doing}: {source}")]
    Io {
        /// What was being done.
        doing: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// A file is not what was stored.
    #[error("{what} is not what was stored: its checksum differs")]
    Damaged {
        /// Which file.
        what: String,
    },
    /// What keeps files across the network does not answer.
    #[error("{doing}: {place} can't be reached: {reason}")]
    Unreachable {
        /// What was being done.
        doing: &'static str,
        /// What it is called.
        place: String,
        /// How it is known.
        reason: String,
    },
    /// It answers, but does not let us.
    #[error("{doing}: {place}: {reason}")]
    Refused {
        /// What was being done.
        doing: &'static str,
        /// What it is called.
        place: String,
        /// Why, and the remedy.
        reason: String,
    },
    /// Something else is there under the name, which stays as it is.
    #[error("{what} is there already, and is something else")]
    Taken {
        /// The name.
        what: String,
    },
}

impl ObjectError {
    /// Whether there is no space left.
    pub fn is_storage_full(&self) -> bool {
        let ObjectError::Io { source, .. } = self else { return false };
        matches!(source.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
    }

    /// Whether what keeps files can't be used from here for a while, so that it is worth trying again.
    pub fn is_unreachable(&self) -> bool {
        matches!(self, ObjectError::Unreachable { .. } | ObjectError::Refused { .. })
    }

    /// Whether memory or descriptors have run out, which come free again.
    pub fn is_shortage(&self) -> bool {
        use nix::errno::Errno;
        let ObjectError::Io { source, .. } = self else { return false };
        source
            .raw_os_error()
            .is_some_and(|code| [Errno::ENOMEM, Errno::EMFILE, Errno::ENFILE].contains(&Errno::from_raw(code)))
    }
}

/// A place that keeps files.
#[async_trait]
pub trait ObjectStore: SegmentStore + Debug + Send + Sync + 'static {
    /// A new file to receive an upload into.
    async fn receive(&self) -> Result<Box<dyn StagedWriter>, ObjectError>;

    /// The content of a file that has arrived. Blocks.
    fn read_staged(&self, file: &StagedFile) -> Result<Vec<u8>, ObjectError>;

    /// Opens a file that has arrived, to be sent; what is open stays readable when its handle is dropped.
    async fn open_staged(&self, file: &StagedFile) -> Result<Box<dyn AssetReader>, ObjectError>;

    /// Bytes that have arrived of a file that comes piece by piece. What a process has left that was killed counts.
    async fn held(&self, upload: UploadId) -> Result<u64, ObjectError>;

    /// Goes on receiving a file that comes piece by piece, behind what has arrived. One at a time may.
    async fn resume(&self, upload: UploadId) -> Result<Box<dyn PieceWriter>, ObjectError>;

    /// A file that came piece by piece, as one that has arrived; it is held as well until it is let go. From then on nothing
    /// may be added to it. Blocks.
    fn stage_held(&self, upload: UploadId) -> Result<StagedFile, ObjectError>;

    /// Lets go what has arrived of a file; no trouble if that is nothing. Blocks.
    fn let_go(&self, upload: UploadId) -> Result<(), ObjectError>;

    /// All files of which pieces are held. Blocks.
    fn held_uploads(&self) -> Result<Vec<UploadId>, ObjectError>;

    /// A model in the making. Blocks.
    fn stage_model(&self) -> Result<StagedModel, ObjectError>;

    /// Writes one file of a model in the making and makes it durable; answers with the BLAKE3 of its content. Blocks.
    fn write_asset(&self, model: &StagedModel, asset: &str, content: &[u8]) -> Result<String, ObjectError>;

    /// Takes an uploaded file over as a file of a model in the making. Blocks.
    fn take_asset(&self, model: &StagedModel, asset: &str, file: &StagedFile) -> Result<(), ObjectError>;

    /// Publishes an upload as a scan of a set. Blocks.
    fn keep_scan(&self, staged: &StagedFile, set: ScanSetId, file: FileId) -> Result<(), ObjectError>;

    /// Publishes all files of a model; again, with the same, after it has failed. What is broken off in the middle may leave
    /// some of them: then the model is listed, and removed as a whole. No row knows it before all are there. Blocks.
    fn keep_model(&self, staged: &StagedModel, model: ModelId) -> Result<(), ObjectError>;

    /// Publishes an upload as the file of a standard. Blocks.
    fn keep_standard(&self, staged: &StagedFile, standard: StandardId, asset: &str) -> Result<(), ObjectError>;

    /// The content of a scan, if that is what was stored. Blocks.
    fn read_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<Vec<u8>, ObjectError>;

    /// Whether a scan is what was stored; it is read where it is kept. Blocks.
    fn check_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<(), ObjectError>;

    /// Opens a file of a model that is what was stored; `None` if it is not there.
    async fn open_asset(
        &self,
        model: ModelId,
        asset: &AssetRecord,
    ) -> Result<Option<Box<dyn AssetReader>>, ObjectError>;

    /// The content of a file of a model, if that is what was stored; `None` if it is not there. Blocks.
    fn read_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<Vec<u8>>, ObjectError>;

    /// Whether a file of a model is there; an error if it is not what was stored. It is read where it is kept. Blocks.
    fn check_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<bool, ObjectError>;

    /// The file that a standard was made of, if it is what was stored. Blocks.
    fn read_standard(&self, standard: StandardId, asset: &AssetRecord) -> Result<Vec<u8>, ObjectError>;

    /// Removes what belonged to a row that was deleted; no trouble if it is gone. Blocks.
    fn remove(&self, file: StoredFile) -> Result<(), ObjectError>;

    /// Everything that was published and has an id. Blocks.
    fn listing(&self) -> Result<Vec<StoredFile>, ObjectError>;

    /// Moves things to the trash; answers with where they are now, for people. Blocks.
    fn set_aside(&self, files: &[StoredFile]) -> Result<String, ObjectError>;

    /// Removes what processes have staged that have ended since; what is staged through this handle, or through that of
    /// a process that lives, stays. Answers with the number of things. Blocks.
    fn sweep_staging(&self) -> Result<usize, ObjectError>;

    /// Bytes that may still be kept; `None` where nobody says. Blocks.
    fn free_bytes(&self) -> Option<u64>;

    /// Removes copies at hand of files that no row knows: another process may have deleted them. Blocks.
    fn keep_copies_of(&self, _known: &KnownFiles) -> Result<(), ObjectError> {
        Ok(())
    }

    /// Deletes for good what was set aside more than [`TRASH_DAYS`] days ago; answers with the number of batches.
    /// Blocks.
    fn empty_trash(&self, now: jiff::Timestamp) -> Result<usize, ObjectError>;
}

/// A file that is being received. What was written is removed when it is dropped unfinished.
#[async_trait]
pub trait StagedWriter: Debug + Send + Sync {
    /// Appends what has arrived.
    async fn write(&mut self, chunk: &[u8]) -> Result<(), ObjectError>;

    /// Makes what was written durable.
    async fn finish(self: Box<Self>) -> Result<StagedFile, ObjectError>;
}

/// A piece that is being received. What was written stays when it is dropped, but may be lost when the power fails.
#[async_trait]
pub trait PieceWriter: Debug + Send + Sync {
    /// Appends what has arrived.
    async fn write(&mut self, chunk: &[u8]) -> Result<(), ObjectError>;

    /// Makes what was written durable.
    async fn finish(self: Box<Self>) -> Result<(), ObjectError>;
}

/// A file that is being sent, whole or from some place on.
pub trait AssetReader: AsyncRead + AsyncSeek + Send + Unpin {}

impl<T: AsyncRead + AsyncSeek + Send + Unpin> AssetReader for T {}

/// Where things are staged, as far as their handles need it.
pub trait Staging: Debug + Send + Sync {
    /// Removes what is staged under an id; nothing, if it has been published.
    fn discard(&self, id: FileId);
}

/// Something staged. Removed when it is dropped, unless it was published.
#[derive(Debug)]
struct Handle {
    id: FileId,
    staging: Arc<dyn Staging>,
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.staging.discard(self.id);
    }
}

/// A file that has arrived whole but belongs nowhere yet. Removed when dropped before it is published.
#[derive(Debug)]
pub struct StagedFile {
    handle: Handle,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub checksum: String,
}

impl StagedFile {
    /// A file of which nothing has arrived yet: for backends.
    pub fn new(id: FileId, staging: Arc<dyn Staging>) -> Self {
        StagedFile { handle: Handle { id, staging }, bytes: 0, checksum: String::new() }
    }

    /// The id that it is staged under.
    pub fn id(&self) -> FileId {
        self.handle.id
    }
}

/// The files of a model in the making. Removed when dropped before [`ObjectStore::keep_model`].
#[derive(Debug)]
pub struct StagedModel {
    handle: Handle,
}

impl StagedModel {
    /// A model that has no files yet: for backends.
    pub fn new(id: FileId, staging: Arc<dyn Staging>) -> Self {
        StagedModel { handle: Handle { id, staging } }
    }

    /// The id that it is staged under.
    pub fn id(&self) -> FileId {
        self.handle.id
    }
}
