//! What was deleted and can still be put back.

use super::{BinId, JobId, ModelId, ScanSetId};

/// What can be put into the recycle bin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deletable {
    /// A scan set with its jobs and models.
    ScanSet(ScanSetId),
    /// A job with its model.
    Job(JobId),
    /// A model.
    Model(ModelId),
}

impl Deletable {
    /// The kind with the id, as they are stored.
    pub fn parse(kind: &str, id: &str) -> Option<Deletable> {
        match kind {
            "scan_set" => ScanSetId::parse(id).map(Deletable::ScanSet),
            "job" => JobId::parse(id).map(Deletable::Job),
            "model" => ModelId::parse(id).map(Deletable::Model),
            _ => None,
        }
    }

    /// What it is.
    pub fn kind(self) -> &'static str {
        match self {
            Deletable::ScanSet(_) => "scan_set",
            Deletable::Job(_) => "job",
            Deletable::Model(_) => "model",
        }
    }
}

impl std::fmt::Display for Deletable {
    /// The id.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Deletable::ScanSet(id) => id.fmt(f),
            Deletable::Job(id) => id.fmt(f),
            Deletable::Model(id) => id.fmt(f),
        }
    }
}

/// An entry of the recycle bin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BinRecord {
    /// The entry; holds the time of the deletion.
    pub id: BinId,
    /// What was deleted.
    pub thing: Deletable,
    /// Its name for people.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// Models that were deleted with it, itself included.
    pub models: u64,
    /// Bytes of the files that are kept for it.
    pub bytes: u64,
}

/// What of the recycle bin is to go for good.
#[derive(Debug, Clone, Copy)]
pub struct BinDue {
    /// Entries from before this one.
    pub before: BinId,
    /// Models from before this one, whenever they were deleted.
    pub models_before: Option<ModelId>,
    /// Scan sets from before this one, whenever they were deleted.
    pub scan_sets_before: Option<ScanSetId>,
    /// Scan sets that were to be deleted by now.
    pub now: jiff::Timestamp,
}
