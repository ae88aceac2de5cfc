//! No other process answers or works on a database in a file: bells, turns and the index are in memory.

use std::time::Duration;

use async_trait::async_trait;

use super::SqliteDatabase;
use crate::storage::DatabaseError;
use crate::storage::database::{Alone, Exclusive, GalleryChanges, News, Others, Searchers};
use visage_domain::{NodeSecret, Parts, Searcher};

#[async_trait]
impl Others for SqliteDatabase {
    async fn gallery_version(&self) -> Result<Option<u64>, DatabaseError> {
        Ok(None)
    }

    async fn gallery_changes(&self, _after: u64, _limit: usize) -> Result<Option<GalleryChanges>, DatabaseError> {
        Ok(None)
    }

    async fn forget_gallery_changes(&self) -> Result<(), DatabaseError> {
        Ok(())
    }

    async fn listen(&self, _hear: &(dyn Fn(News) + Send + Sync)) {
        std::future::pending().await
    }

    async fn try_alone(&self, _what: Alone) -> Result<Option<Exclusive>, DatabaseError> {
        Ok(Some(Box::new(())))
    }

    async fn wait_for(&self, _what: Alone, _is_shared: bool) -> Result<Exclusive, DatabaseError> {
        Ok(Box::new(()))
    }
}

#[async_trait]
impl Searchers for SqliteDatabase {
    async fn tell_searcher(&self, _address: &str, _parts: &Parts) -> Result<(), DatabaseError> {
        Ok(())
    }

    async fn searchers(&self, _within: Duration) -> Result<Vec<Searcher>, DatabaseError> {
        Ok(Vec::new())
    }

    async fn node_secret(&self) -> Result<Option<NodeSecret>, DatabaseError> {
        Ok(None)
    }
}
