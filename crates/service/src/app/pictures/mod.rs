//! Models and scans as people see them: drawn when it is asked for, of what is stored. Nothing of it is kept here.
//!
//! - [`ModelPicture`]: a picture of a model; [`ModelPage`]: its report as a page
//! - [`SaliencyMap`]: what stands out of a model, as a file
//! - [`ScanPicture`], [`SetPicture`]: what was uploaded

mod models;
mod page;
mod saliency;
mod scans;

pub use models::{ModelPicture, thumbnail};
pub use page::ModelPage;
pub use saliency::SaliencyMap;
pub use scans::{ScanPicture, SetPicture};
pub use visage_report::{Kind, Made, Plane, Wish};

use super::context::ServiceContext;
use crate::storage::{DatabaseError, ObjectError};
use visage_domain::{AssetRecord, ModelId};
use visage_formats::{FormatError, ReadLimits};
use visage_geometry::Unit;
use visage_geometry::progress::Canceled;
use visage_report::PictureError;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PicturesError {
    /// The model lacks what it would show.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// Something is to be compared, and it is not said with what.
    #[error("it is not said with which model this one is to be compared")]
    NoOther,
    /// Lengths can't be compared.
    #[error("the model is in {}, the other in {}", .0.name(), .1.name())]
    OtherUnit(Unit, Unit),
    /// It is not a plot.
    #[error("{0} is made of pixels: there is no SVG of it")]
    NoPlot(&'static str),
    /// It does not fit into memory.
    #[error("drawing {points} points takes up to {needed_mb} MB of memory, and there may be {allowed_mb} MB here")]
    TooLarge {
        /// Points in memory at a time.
        points: u64,
        /// What they take, megabytes (10^6).
        needed_mb: u64,
        /// What there is.
        allowed_mb: u64,
    },
    /// There is no scan of this name.
    #[error("the scan set has no scan {0:?}")]
    NoScan(String),
    /// There is nothing to show.
    #[error("the scan set has no scans yet")]
    NoScans,
    /// What is stored can't be read.
    #[error("{name}: {error}")]
    Unreadable {
        /// The file.
        name: String,
        /// Why.
        error: FormatError,
    },
    /// A stored report can't be read, or a picture can't be written.
    #[error("{0}")]
    Broken(String),
    /// Nobody waits any more.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// What the database says.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// What the files say.
    #[error(transparent)]
    Objects(#[from] ObjectError),
}

/// The most bytes that drawing takes for each point: the file, what is read of it, triangles, and their places on the picture.
const BYTES_PER_POINT: u64 = 300;

/// What is stored was within the bounds for uploads when it came; what may be in memory is checked before.
const STORED: ReadLimits = ReadLimits { max_points: u32::MAX as u64, max_faces: u32::MAX as u64, max_bytes: u64::MAX };

/// Refuses what does not fit into the memory that a job may take.
fn check_memory(context: &ServiceContext, points: u64) -> Result<(), PicturesError> {
    let needed = points.saturating_mul(BYTES_PER_POINT);
    match context.config.job_memory_bytes.filter(|allowed| needed > *allowed) {
        Some(allowed) => {
            let (needed_mb, allowed_mb) = (needed.div_ceil(1_000_000), allowed / 1_000_000);
            Err(PicturesError::TooLarge { points, needed_mb, allowed_mb })
        }
        None => Ok(()),
    }
}

/// The content of a file of a model. Blocks.
fn content(context: &ServiceContext, model: ModelId, asset: &AssetRecord) -> Result<Vec<u8>, PicturesError> {
    let gone = || DatabaseError::NotFound { kind: "file", id: format!("{} of model {model}", asset.name) };
    Ok(context.objects.read_asset(model, asset)?.ok_or_else(gone)?)
}
