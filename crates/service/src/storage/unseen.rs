//! What is written but not yet in the index in memory: queries wait for it, so that what a client has seen of a job or
//! a model holds for what it asks next.
//!
//! Writers hold a share from just before their commit until the index has followed. Whoever asks afterwards has to get
//! past those shares once. Nobody waits for a lock of the database meanwhile: it is held already when the share is
//! taken.

use std::sync::Arc;

use tokio::sync::{OwnedRwLockReadGuard, RwLock};

use visage_domain::{ModelId, StoredFile};

/// Changes of the index that are under way: for backends.
#[derive(Debug, Clone, Default)]
pub struct Changes(Arc<RwLock<()>>);

/// A change that the index has not followed yet; dropped when it has.
#[derive(Debug)]
#[must_use = "queries wait until the index has followed"]
pub struct Unseen {
    _share: OwnedRwLockReadGuard<()>,
}

impl Changes {
    /// Makes queries that come from now on wait until the answer is dropped.
    pub async fn begin(&self) -> Unseen {
        Unseen { _share: Arc::clone(&self.0).read_owned().await }
    }

    /// Waits until the index holds everything that was committed before.
    pub async fn settled(&self) {
        drop(self.0.write().await);
    }
}

/// What a deletion took along.
#[derive(Debug)]
#[must_use = "queries wait until the index has forgotten them"]
pub struct Deleted {
    /// Models that are to be taken out of the index, and whose files are to be removed unless they are in the recycle bin.
    pub models: Vec<ModelId>,
    /// What of the recycle bin went with it.
    pub purged: Purged,
    /// To be dropped when the index has forgotten them.
    pub unseen: Unseen,
}

/// What is gone from the recycle bin for good.
#[derive(Debug, Default, PartialEq, Eq)]
#[must_use = "the files are to be removed"]
pub struct Purged {
    /// Entries.
    pub entries: usize,
    /// Files that are to be removed; the index has forgotten their models before.
    pub files: Vec<StoredFile>,
}
