//! Which folder of files the database goes with: both hold the same id.

use super::{Store, stored_id};
use crate::storage::DatabaseError;
use visage_domain::FolderId;

impl Store {
    pub(in super::super) async fn stored_folder_id(&self) -> Result<Option<FolderId>, DatabaseError> {
        let id: Option<String> = sqlx::query_scalar("SELECT id FROM folder").fetch_optional(&self.readers).await?;
        id.map(|text| stored_id!(FolderId, &text)).transpose()
    }

    pub(in super::super) async fn store_folder_id(&self, id: FolderId) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        sqlx::query("INSERT INTO folder (only_row, id) VALUES (1, $1) ON CONFLICT DO NOTHING")
            .bind(id.to_string())
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }
}
