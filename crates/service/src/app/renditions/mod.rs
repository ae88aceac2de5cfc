//! What is stored, in other formats: converted when it is asked for, into the staging, from where it is sent. Nothing of it
//! is kept. As many conversions as there are permits have their files in memory at a time, and one that is too large for
//! that is refused.

mod poses;
mod scans;
mod surface;

use std::sync::Arc;

use tokio::sync::Semaphore;

use super::context::ServiceContext;
use crate::storage::{DatabaseError, ObjectError, ObjectStore, StagedFile};
use visage_domain::{AssetRecord, ModelId, ModelRecord};
use visage_formats::{Format, FormatError, ReadLimits};

pub use scans::PlacedScans;
pub use surface::SurfaceSource;

pub use self::poses::PosesSource;

/// How poses are written: in a format, or as a file with a matrix for each scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PosesAs {
    /// All in one file.
    File(&'static Format),
    /// A zip archive of text files with four rows each.
    Matrices,
}

/// How placed scans are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScansAs {
    /// One file that holds all with their poses.
    E57,
    /// A zip archive of files of this format, moved to where they belong.
    Zip(&'static Format),
}

/// Why there is no such file.
#[derive(Debug, thiserror::Error)]
pub enum RenditionError {
    /// The model has nothing of the kind.
    #[error("the model {model} has no {what}")]
    Missing {
        /// Which model.
        model: ModelId,
        /// What it has not, in words.
        what: &'static str,
        /// What to do about it.
        hint: &'static str,
    },
    /// A scan that the model was made of is not there any more as it was.
    #[error("the scan {scan} is not there any more as it was when the model was made of it")]
    Changed {
        /// Which scan.
        scan: String,
    },
    /// The format can't hold it.
    #[error("{format} can't hold this: {why}")]
    Unfit {
        /// The format.
        format: &'static str,
        /// Why.
        why: String,
    },
    /// It does not fit into memory.
    #[error("converting {points} points takes up to {needed_mb} MB of memory, and there may be {allowed_mb} MB here")]
    TooLarge {
        /// Points in memory at a time.
        points: u64,
        /// What they take, megabytes (10^6).
        needed_mb: u64,
        /// What there is.
        allowed_mb: u64,
    },
    /// What is stored can't be read.
    #[error("{name}: {error}")]
    Unreadable {
        /// The file.
        name: String,
        /// Why.
        error: FormatError,
    },
    /// What the database says.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// What the files say.
    #[error(transparent)]
    Objects(#[from] ObjectError),
    /// What the writing of an archive says.
    #[error("packing: {0}")]
    Packing(std::io::Error),
    /// The work ended in a panic.
    #[error("the work on a file ended: {0}")]
    Ended(#[from] tokio::task::JoinError),
    /// The server goes down.
    #[error("the server goes down")]
    Closed(#[from] tokio::sync::AcquireError),
}

impl From<std::io::Error> for RenditionError {
    /// What went wrong below an archive is told as what it is.
    fn from(error: std::io::Error) -> Self {
        match error.downcast::<ObjectError>() {
            Ok(error) => error.into(),
            Err(error) => RenditionError::Packing(error),
        }
    }
}

/// The most bytes that a conversion takes for each point: the file, what is read of it, and the file that is written.
const BYTES_PER_POINT: u64 = 200;

/// The bounds of what is stored: it was within those for uploads when it came, and a cloud of many scans has more points
/// than one. What may be in
/// memory is checked before.
const STORED: ReadLimits = ReadLimits { max_points: u32::MAX as u64, max_faces: u32::MAX as u64, max_bytes: u64::MAX };

/// What all conversions need.
#[derive(Clone)]
struct Desk {
    objects: Arc<dyn ObjectStore>,
    permits: Arc<Semaphore>,
    /// What a conversion may take, as jobs may.
    memory_bytes: Option<u64>,
}

impl Desk {
    fn new(context: &ServiceContext, permits: &Arc<Semaphore>) -> Self {
        let memory_bytes = context.config.job_memory_bytes;
        Desk { objects: context.objects.clone(), permits: permits.clone(), memory_bytes }
    }

    /// Does blocking work with so many points in memory.
    async fn work<T: Send + 'static>(
        &self,
        points: u64,
        work: impl FnOnce(&dyn ObjectStore) -> Result<T, RenditionError> + Send + 'static,
    ) -> Result<T, RenditionError> {
        let needed = points.saturating_mul(BYTES_PER_POINT);
        if let Some(allowed) = self.memory_bytes.filter(|allowed| needed > *allowed) {
            let (needed_mb, allowed_mb) = (needed.div_ceil(1_000_000), allowed / 1_000_000);
            return Err(RenditionError::TooLarge { points, needed_mb, allowed_mb });
        }
        let permit = self.permits.clone().acquire_owned().await?;
        let (objects, span) = (self.objects.clone(), tracing::Span::current());
        let work = move || {
            let _permit = permit;
            span.in_scope(|| work(objects.as_ref()))
        };
        tokio::task::spawn_blocking(work).await?
    }
}

/// Stages what was written. Blocks.
fn stage(objects: &dyn ObjectStore, bytes: &[u8]) -> Result<StagedFile, RenditionError> {
    tokio::runtime::Handle::current().block_on(async {
        let mut writer = objects.receive().await?;
        writer.write(bytes).await?;
        Ok(writer.finish().await?)
    })
}

/// A model and its files.
async fn model_of(context: &ServiceContext, id: ModelId) -> Result<(ModelRecord, Vec<AssetRecord>), RenditionError> {
    Ok((context.database.model(id).await?, context.database.assets(id).await?))
}

/// The content of a file of a model. Blocks.
fn content(objects: &dyn ObjectStore, model: ModelId, asset: &AssetRecord) -> Result<Vec<u8>, RenditionError> {
    let gone = || DatabaseError::NotFound { kind: "file", id: format!("{} of model {model}", asset.name) };
    Ok(objects.read_asset(model, asset)?.ok_or_else(gone)?)
}
