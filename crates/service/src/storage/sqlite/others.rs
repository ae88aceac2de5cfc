//! No other process answers or works on a database in a file: bells, turns and the index are in memory.

use async_trait::async_trait;

use super::SqliteDatabase;
use crate::storage::DatabaseError;
use crate::storage::database::{Alone, Exclusive, GalleryChanges, News, Others};

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
