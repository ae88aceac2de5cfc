//! Files of the index, and what they don't tell.

use super::{ModelFacets, ModelId, SegmentId, StoredContent};

/// A file of the index that counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentRecord {
    /// Its id.
    pub id: SegmentId,
    /// How many models are in it, be they gone or not.
    pub models: u64,
    /// Its size.
    pub bytes: u64,
    /// The checksum of its head, which holds those of all else.
    pub checksum: u32,
}

/// A model of which no file tells what its signature does.
#[derive(Debug, Clone, PartialEq)]
pub struct Unfiled {
    /// Its id.
    pub id: ModelId,
    /// Its signature and what filters ask of it; `None` if it is gone, or has no signature any more.
    pub signature: Option<(StoredContent, ModelFacets)>,
}
