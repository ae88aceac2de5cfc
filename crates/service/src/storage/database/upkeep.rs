//! What a database has to offer about itself.

use async_trait::async_trait;

use crate::storage::DatabaseError;
use visage_domain::{Census, FolderId, Owner};

/// The database as a whole: whether it is there, sound and writable, and its end.
#[async_trait]
pub trait Upkeep {
    /// Who uses it through this handle: jobs are claimed and files expected in its name.
    fn owner(&self) -> Owner;

    /// The id of the folder of files that it goes with; `None` for one from before folders had ids, or a new one.
    async fn folder_id(&self) -> Result<Option<FolderId>, DatabaseError>;

    /// Says which folder it goes with; the first word counts.
    async fn put_folder_id(&self, id: FolderId) -> Result<(), DatabaseError>;

    /// Waits until the index in memory holds everything that this process has committed before.
    async fn settled(&self);

    /// Whether it answers.
    async fn ping(&self) -> Result<(), DatabaseError>;

    /// Whether something could be stored now.
    async fn check_writable(&self) -> Result<(), DatabaseError>;

    /// Makes what was deleted unreadable wherever copies of it may still be, such as in a log.
    async fn fold_log(&self);

    /// How much of everything there is.
    async fn census(&self) -> Result<Census, DatabaseError>;

    /// Everything that the database finds wrong with itself; reads all of it.
    async fn integrity(&self) -> Result<Vec<String>, DatabaseError>;

    /// Ends all connections.
    async fn close(&self);
}
