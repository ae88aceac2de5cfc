//! The database as a whole: whether it is there, sound and writable, and its end.

use std::path::Path;
use std::sync::Arc;

use async_trait::async_trait;

use super::SqliteDatabase;
use crate::storage::DatabaseError;
use crate::storage::database::Upkeep;
use visage_domain::{Census, FolderId, Owner};

#[async_trait]
impl Upkeep for SqliteDatabase {
    fn owner(&self) -> Owner {
        self.owner
    }

    async fn folder_id(&self) -> Result<Option<FolderId>, DatabaseError> {
        self.stored_folder_id().await
    }

    async fn put_folder_id(&self, id: FolderId) -> Result<(), DatabaseError> {
        self.store_folder_id(id).await
    }

    async fn settled(&self) {
        self.changes.settled().await;
    }

    async fn ping(&self) -> Result<(), DatabaseError> {
        sqlx::query("SELECT 1").execute(&self.readers).await?;
        Ok(())
    }

    /// It writes a time, since nothing less would tell; but that may fit into what the log has already, where nothing
    /// larger would.
    async fn check_writable(&self) -> Result<(), DatabaseError> {
        let reserve = Arc::clone(&self.reserve);
        if !tokio::task::spawn_blocking(move || reserve.has_space()).await.unwrap_or(false) {
            return Err(DatabaseError::Full);
        }
        let mut tx = self.begin().await?;
        sqlx::query("UPDATE folder SET checked_at = ?").bind(tx.now_ms()).execute(&mut *tx).await?;
        tx.commit().await
    }

    /// A reader that is in the way for long leaves it to the next deletion, or to the server's end.
    async fn fold_log(&self) {
        if let Err(error) = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(&self.writer).await {
            tracing::warn!("the write-ahead log is not emptied yet: {error}");
        }
    }

    async fn census(&self) -> Result<Census, DatabaseError> {
        self.counted().await
    }

    async fn integrity(&self) -> Result<Vec<String>, DatabaseError> {
        let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check(20)").fetch_all(&self.readers).await?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }

    /// The write-ahead log is folded into the file. SQLite does that at the close of the last connection alone, and there
    /// may be others: those of another program, or one that was still being opened for somebody who has left.
    async fn close(&self) {
        self.readers.close().await;
        self.fold_log().await;
        self.writer.close().await;
    }
}

/// What takes all rows over reads them itself.
#[cfg(feature = "postgres")]
impl SqliteDatabase {
    /// The connections that read.
    pub(in crate::storage) fn rows(&self) -> &sqlx::SqlitePool {
        &self.readers
    }
}

/// A copy is a file of its own.
impl SqliteDatabase {
    /// Writes the database as it is at this moment into a new file; readers and writers go on meanwhile.
    pub async fn write_copy(&self, file: &Path) -> Result<(), DatabaseError> {
        // by the writer: the pool of readers opens the file such that nothing can be attached
        sqlx::query("VACUUM INTO ?").bind(file.to_string_lossy().into_owned()).execute(&self.writer).await?;
        Ok(())
    }

    /// Ends all sessions.
    pub async fn forget_all_sessions(&self) -> Result<(), DatabaseError> {
        sqlx::query("DELETE FROM session").execute(&self.writer).await?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{other_program, store};
    use super::*;

    #[tokio::test]
    async fn a_closed_database_is_one_file_though_somebody_else_has_it_open() {
        let (store, folder) = store().await;
        let mut other = other_program(&folder).await;
        let before: i64 = sqlx::query_scalar("SELECT count(*) FROM folder").fetch_one(&mut other).await.expect("read");
        assert_eq!(before, 1);
        let log = folder.path().join("test.sqlite-wal");
        assert!(std::fs::metadata(&log).expect("there").len() > 0);
        store.close().await;
        let left = std::fs::metadata(&log).expect("somebody else has it open").len();
        assert_eq!(left, 0);
    }
}
