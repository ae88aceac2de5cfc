//! What a database has to offer for the recycle bin.

use async_trait::async_trait;

use crate::storage::{DatabaseError, Deleted, Purged, Unseen};
use visage_domain::{
    AssetRecord, BinDue, BinId, BinRecord, Deletable, ModelId, Page, PageRequest, ScanRecord, ScanSetId,
};

/// What was deleted and can still be put back. Nothing else that a database answers tells of it, but the files that it needs, how many
/// bytes they are, and who has made it.
#[async_trait]
pub trait RecycleBin {
    /// Deletes something with all that is derived from it, as the deletion for good would, but keeps it here. Its verdicts are not kept.
    async fn put_in_bin(&self, thing: Deletable) -> Result<Deleted, DatabaseError>;

    /// Entries, the last deleted first.
    async fn bin(&self, page: &PageRequest) -> Result<Page<BinRecord>, DatabaseError>;

    /// The entry of what had this id.
    async fn binned(&self, thing: &str) -> Result<BinRecord, DatabaseError>;

    /// Puts back what had this id, with all that was deleted with it; answers with the models. The index has to follow before the answer is
    /// dropped. Refused while what it was made of is not there.
    async fn restore(&self, thing: &str) -> Result<(Vec<ModelId>, Unseen), DatabaseError>;

    /// Forgets entries, and those of what was made of theirs, for good.
    async fn purge(&self, entries: &[BinId]) -> Result<Purged, DatabaseError>;

    /// Forgets for good all that is due.
    async fn purge_due(&self, due: &BinDue) -> Result<Purged, DatabaseError>;

    /// The scans in the bin.
    async fn binned_scans(&self) -> Result<Vec<(ScanSetId, ScanRecord)>, DatabaseError>;

    /// The files of the models in the bin.
    async fn binned_assets(&self) -> Result<Vec<(ModelId, AssetRecord)>, DatabaseError>;
}
