//! Which data folder this is the database of.

use super::{FolderId, Store, StoreError, stored_id};

impl Store {
    /// The id of the folder; `None` for a database from before folders had one, or a new one.
    pub async fn folder_id(&self) -> Result<Option<FolderId>, StoreError> {
        let id: Option<String> = sqlx::query_scalar("SELECT id FROM folder").fetch_optional(&self.readers).await?;
        id.map(|text| stored_id!(FolderId, &text)).transpose()
    }

    /// Says whose database this is; only once.
    pub async fn put_folder_id(&self, id: FolderId) -> Result<(), StoreError> {
        let mut tx = self.begin_any().await?;
        sqlx::query("INSERT INTO folder (only_row, id) VALUES (1, ?)").bind(id.to_string()).execute(&mut *tx).await?;
        tx.commit().await
    }

    /// Everything that SQLite finds wrong with the file; reads all of it.
    pub async fn integrity(&self) -> Result<Vec<String>, StoreError> {
        let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check(20)").fetch_all(&self.readers).await?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }
}
