//! What a client sends becomes the scans of a set: archives are unpacked, files that hold several scans are taken apart,
//! depth images become scans, and the poses that came along are found. All of it is staged; nothing is kept yet.
//!
//! A scan that is not a file of its own is stored as an E57 file, which holds everything there is to know of one: exact
//! coordinates, colours, the grid, where the scanner stood.

mod archives;
mod depth;
mod poses;
mod several;
mod textures;

use std::collections::BTreeMap;
use std::sync::Arc;

use tokio::sync::Semaphore;

use self::archives::Unpacked;
use self::depth::DepthScan;
use self::textures::Beside;
use super::context::ServiceContext;
use crate::config::Limits;
pub use crate::machine::giving_way;
use crate::storage::{ObjectError, ObjectStore, StagedFile};
use visage_domain::{PassedOver, PoseFile};
use visage_formats::{Dropped, FormatError, archive, same_name, scan_names, shared_frame};

/// A file on disk that belongs nowhere yet.
#[derive(Debug)]
pub struct ReceivedFile {
    /// The user's name for it, or its path in an archive.
    pub name: String,
    /// Its content.
    pub staged: StagedFile,
}

/// A scan that was read and can be kept.
#[derive(Debug)]
pub struct CheckedScan {
    /// Its file.
    pub file: ReceivedFile,
    /// Its points.
    pub points: u64,
    /// What of the file was not taken.
    pub dropped: Dropped,
}

/// What arrived.
#[derive(Debug, Default)]
pub struct Arrival {
    /// The scans, each a file of its own.
    pub scans: Vec<CheckedScan>,
    /// Where they start, if it came with them.
    pub poses: Option<PoseFile>,
    /// Files that are not kept.
    pub passed_over: Vec<PassedOver>,
}

/// Why nothing is kept of what arrived.
#[derive(Debug, thiserror::Error)]
pub enum ArrivalError {
    /// A file can't be read.
    #[error("{}: {error}", file_in(.file, .archive.as_deref()))]
    Unreadable {
        /// The file,
        file: String,
        /// and the archive it was in.
        archive: Option<String>,
        /// What is wrong with it.
        error: FormatError,
    },
    /// More scans than a set may have.
    #[error("{found} scans came, a set has at most {limit}")]
    TooManyScans {
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// Two scans have names that are the same for many systems.
    #[error("two scans are named {first} and {second}")]
    Duplicate {
        /// One,
        first: String,
        /// the other.
        second: String,
    },
    /// A file could not be staged.
    #[error(transparent)]
    Objects(#[from] ObjectError),
    /// The work on a file ended in a panic.
    #[error("the work on a file ended: {0}")]
    Ended(#[from] tokio::task::JoinError),
    /// The server goes down.
    #[error("the server goes down")]
    Closed(#[from] tokio::sync::AcquireError),
}

/// A file as messages name it.
fn file_in(file: &str, archive: Option<&str>) -> String {
    archive.map_or_else(|| file.to_owned(), |archive| format!("{file} in {archive}"))
}

/// What the work on files needs.
#[derive(Clone)]
struct Desk {
    objects: Arc<dyn ObjectStore>,
    /// How many files may be in memory at a time.
    checks: Arc<Semaphore>,
    limits: Limits,
}

impl Desk {
    /// Does blocking work that has a file in memory.
    async fn work<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Desk) -> Result<T, ArrivalError> + Send + 'static,
    ) -> Result<T, ArrivalError> {
        let permit = self.checks.clone().acquire_owned().await?;
        let (desk, span) = (self.clone(), tracing::Span::current());
        let work = move || {
            let _permit = permit;
            giving_way(|| span.in_scope(|| work(&desk)))
        };
        tokio::task::spawn_blocking(work).await?
    }

    /// Stages what was made of a file. Blocks.
    fn stage(&self, bytes: &[u8]) -> Result<StagedFile, ObjectError> {
        tokio::runtime::Handle::current().block_on(async {
            let mut writer = self.objects.receive().await?;
            writer.write(bytes).await?;
            writer.finish().await
        })
    }
}

/// A scan that is read next.
struct Coming {
    name: String,
    archive: Option<String>,
    content: Content,
}

enum Content {
    File(StagedFile),
    Depth(DepthScan),
    /// An OBJ file, and what stands beside it.
    Textured(StagedFile, Arc<Beside>),
}

/// Takes files in. With poses of their own (`is_posed`) those that come along are not looked for. At most as many files as
/// `checks` has permits are in memory at a time.
pub async fn take_in(
    context: &ServiceContext,
    checks: &Arc<Semaphore>,
    files: Vec<ReceivedFile>,
    is_posed: bool,
) -> Result<Arrival, ArrivalError> {
    let limits = context.config.limits;
    let desk = Desk { objects: context.objects.clone(), checks: checks.clone(), limits };
    let mut coming = Vec::new();
    let mut unpacked = Vec::new();
    let mut left = limits.upload_bytes;
    for file in files {
        if archive::is_archive(&file.name) {
            let mut archive = Unpacked::of(&desk, file, &mut left).await?;
            coming.extend(archive.scans()?);
            unpacked.push(archive);
        } else {
            coming.push(Coming { name: file.name, archive: None, content: Content::File(file.staged) });
        }
        // before they are read in vain
        check_count(coming.len(), limits.scans_per_set)?;
    }
    let read = coming.into_iter().map(|coming| several::read(&desk, coming));
    let read = futures_util::future::try_join_all(read).await?;
    let count = read.iter().map(|file| file.scans.len()).sum();
    check_count(count, limits.scans_per_set)?;
    let mut arrival = Arrival::default();
    let mut of_files = several::named(read, &mut arrival.scans);
    of_files.extend(shared_frame(arrival.scans.iter().map(|scan| scan.file.name.as_str())));
    check_names(&arrival.scans)?;
    if !is_posed {
        let names = arrival.scans.iter().map(|scan| scan.file.name.clone()).collect();
        let found;
        (unpacked, found) = poses::find(&desk, unpacked, names).await?;
        arrival.poses = found.or_else(|| poses::of_files(&of_files));
    }
    arrival.passed_over = unpacked.into_iter().flat_map(Unpacked::passed_over).collect();
    Ok(arrival)
}

fn check_count(found: usize, limit: usize) -> Result<(), ArrivalError> {
    if found > limit { Err(ArrivalError::TooManyScans { found, limit }) } else { Ok(()) }
}

/// No two scans may have names that some system takes for one.
fn check_names(scans: &[CheckedScan]) -> Result<(), ArrivalError> {
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    for scan in scans {
        let name = scan.file.name.as_str();
        if let Some(first) = seen.insert(same_name(name), name) {
            return Err(ArrivalError::Duplicate { first: first.to_owned(), second: name.to_owned() });
        }
    }
    Ok(())
}
