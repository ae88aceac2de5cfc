//! Files that come piece by piece, so that a lost connection costs only what was under way.

use super::{ScanSetId, UploadId};

/// A file that is to become a scan when all of it has arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UploadRecord {
    /// Its id.
    pub id: UploadId,
    /// The set that the scan is for.
    pub scan_set_id: ScanSetId,
    /// The scan's name.
    pub name: String,
    /// Bytes of the whole file.
    pub bytes: u64,
    /// What the whole file is held against, as `Content-Digest` has it, if its sender has said it.
    pub digest: Option<String>,
    /// When it is given up.
    pub expires_at: jiff::Timestamp,
    /// Whether it has become a scan.
    pub is_done: bool,
}
