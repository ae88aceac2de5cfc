//! Models that come from another data folder.

use super::{JobRecord, NewModel, NewScanSet};

/// A model that was stored elsewhere, with what it was made by.
#[derive(Debug, Clone)]
pub struct ImportedModel {
    /// The model, under the id that it had there.
    pub model: NewModel,
    /// The job that made it; `None` for an uploaded one.
    pub job: Option<JobRecord>,
    /// The scan set that it was made from, without its scans.
    pub scan_set: Option<NewScanSet>,
}
