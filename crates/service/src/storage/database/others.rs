//! What several processes that use one database have to learn of each other.

use std::any::Any;

use async_trait::async_trait;

use crate::storage::DatabaseError;
use visage_domain::Unfiled;

/// What rings for a process: it looks at the tables then, and may find that nothing has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum News {
    /// A job, or a message to a webhook, has come, changed its status or gone; or a stop was asked for.
    Work,
    /// A job has come further.
    Progress,
    /// What the index holds has changed.
    Gallery,
}

/// What became of models since some version of the gallery.
#[derive(Debug, Default)]
pub struct GalleryChanges {
    /// The version up to which this tells all.
    pub version: u64,
    /// What their signatures say now, or that they have none.
    pub models: Vec<Unfiled>,
}

/// Something that is done by one process at a time, for as long as this is held. What it is, is the database's business.
pub type Exclusive = Box<dyn Any + Send>;

/// What is done by one process at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alone {
    /// Cleaning up.
    Upkeep,
    /// A change that depends on the state of what it changes.
    ConditionalChange,
}

/// Other processes on the same database. One that is in a file has none that answer or work.
#[async_trait]
pub trait Others {
    /// The version of the gallery: it counts up with every commit that the index has to follow. `None` if no other process makes any.
    async fn gallery_version(&self) -> Result<Option<u64>, DatabaseError>;

    /// What changed after a version, in the order of the changes, at most about `limit` models; `None` if that is not known any more.
    async fn gallery_changes(&self, after: u64, limit: usize) -> Result<Option<GalleryChanges>, DatabaseError>;

    /// Forgets changes that every index has followed long ago.
    async fn forget_gallery_changes(&self) -> Result<(), DatabaseError>;

    /// Calls `hear` for what any process commits, this one too, and now and then for all of it. Never ends.
    async fn listen(&self, hear: &(dyn Fn(News) + Send + Sync));

    /// Takes something for this process alone, at once; `None` if another one has it.
    async fn try_alone(&self, what: Alone) -> Result<Option<Exclusive>, DatabaseError>;

    /// The same, as soon as all others have let go; or shared with those who share it.
    async fn wait_for(&self, what: Alone, is_shared: bool) -> Result<Exclusive, DatabaseError>;
}
