//! Servers that search parts of the gallery for others.

use std::time::Duration;

use async_trait::async_trait;

use crate::storage::DatabaseError;
use visage_domain::{NodeSecret, Parts, Searcher};

/// Who searches which part. Of a database that one process uses nobody but that does, and it tells nobody.
#[async_trait]
pub trait Searchers {
    /// Says that this node is there, where it is reached, and what it has whole. It has to be known as a node before
    /// ([`Segments::keep_index`](super::Segments::keep_index)).
    async fn tell_searcher(&self, address: &str, parts: &Parts) -> Result<(), DatabaseError>;

    /// Those that have said so within this time.
    async fn searchers(&self, within: Duration) -> Result<Vec<Searcher>, DatabaseError>;

    /// What those who use this database show each other; `None` if there is nobody to be shown anything.
    async fn node_secret(&self) -> Result<Option<NodeSecret>, DatabaseError>;
}
