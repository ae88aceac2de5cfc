//! The database as a whole: whether it is there, sound and writable, and its end.

use std::sync::Arc;

use async_trait::async_trait;
use sqlx::AssertSqlSafe;

use super::PostgresDatabase;
use crate::storage::DatabaseError;
use crate::storage::database::Upkeep;
use visage_domain::{Census, FolderId, Owner};

#[async_trait]
impl Upkeep for PostgresDatabase {
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

    async fn check_writable(&self) -> Result<(), DatabaseError> {
        // files need the disk of this machine, whatever the server's has
        let reserve = Arc::clone(&self.reserve);
        if !tokio::task::spawn_blocking(move || reserve.has_space()).await.unwrap_or(false) {
            return Err(DatabaseError::Full);
        }
        let mut tx = self.begin_rows().await?;
        sqlx::query("UPDATE folder SET checked_at = $1").bind(tx.now_ms()).execute(&mut *tx).await?;
        tx.commit().await
    }

    /// What was deleted is unreadable when the server's own vacuum has come by; its log and its backups are the operator's.
    async fn fold_log(&self) {}

    async fn census(&self) -> Result<Census, DatabaseError> {
        self.counted().await
    }

    /// Reads every row of every table: with checksums of pages, which a cluster may have, damage shows.
    async fn integrity(&self) -> Result<Vec<String>, DatabaseError> {
        let tables: Vec<String> = sqlx::query_scalar(
            "SELECT quote_ident(table_name) FROM information_schema.tables
             WHERE table_schema = current_schema() AND table_type = 'BASE TABLE' ORDER BY 1",
        )
        .fetch_all(&self.readers)
        .await?;
        let mut found = Vec::new();
        for table in tables {
            let read = format!("SELECT count(t.*::text) FROM {table} AS t");
            match sqlx::query_scalar::<_, i64>(AssertSqlSafe(read)).fetch_one(&self.readers).await {
                Ok(_) => {}
                Err(sqlx::Error::Database(error)) => found.push(format!("{table}: {error}")),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(found)
    }

    async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
        self.waiting.close().await;
        if let Some(held) = &self.held {
            held.end();
        }
    }
}
