//! How much of everything is kept.

/// Counts of what a database knows, at one moment.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Census {
    /// Scan sets.
    pub scan_sets: u64,
    /// Scans in all sets.
    pub scans: u64,
    /// Models.
    pub models: u64,
    /// Standards made by users.
    pub standards: u64,
    /// Messages to webhooks that wait.
    pub messages_pending: u64,
    /// Messages to webhooks that could not be delivered.
    pub messages_dead: u64,
    /// Entries of the recycle bin.
    pub bin_entries: u64,
    /// Bytes of all files of scans, models and standards, those in the recycle bin included.
    pub file_bytes: u64,
    /// Bytes of the database.
    pub database_bytes: u64,
    /// Jobs by kind and status.
    pub jobs: Vec<(String, String, u64)>,
    /// Registered models by the verdict on them.
    pub verdicts: Vec<(String, u64)>,
}
