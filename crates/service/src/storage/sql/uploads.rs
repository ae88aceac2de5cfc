//! Files that come piece by piece.

use jiff::Timestamp;

use super::rows::row;
use super::{Store, stored_id, timestamp, to_i64, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::Uploads;
use async_trait::async_trait;
use visage_domain::{ScanSetId, UploadId, UploadRecord};

row! {
    struct Row {
        id: String,
        scan_set_id: String,
        name: String,
        bytes: i64,
        digest: Option<String>,
        expires_at: i64,
        is_done: bool,
    }
}

impl Row {
    fn record(self) -> Result<UploadRecord, DatabaseError> {
        Ok(UploadRecord {
            id: stored_id!(UploadId, &self.id)?,
            scan_set_id: stored_id!(ScanSetId, &self.scan_set_id)?,
            name: self.name,
            bytes: to_u64(self.bytes),
            digest: self.digest,
            expires_at: timestamp(self.expires_at)?,
            is_done: self.is_done,
        })
    }
}

fn not_found(id: UploadId) -> DatabaseError {
    DatabaseError::NotFound { kind: "upload", id: id.to_string() }
}

#[async_trait]
impl Uploads for Store {
    async fn create_upload(&self, upload: &UploadRecord, limit: usize) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        let set = upload.scan_set_id.to_string();
        let counts: Option<i64> = sqlx::query_scalar(
            "SELECT (SELECT count(*) FROM upload WHERE scan_set_id = scan_set.id AND NOT is_done)
             FROM scan_set WHERE id = $1",
        )
        .bind(&set)
        .fetch_optional(&mut *tx)
        .await?;
        let count = counts.ok_or_else(|| DatabaseError::NotFound { kind: "scan set", id: set.clone() })?;
        if to_u64(count) >= limit as u64 {
            return Err(DatabaseError::TooManyScans { limit });
        }
        sqlx::query(
            "INSERT INTO upload (id, scan_set_id, name, bytes, digest, expires_at) VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(upload.id.to_string())
        .bind(set)
        .bind(&upload.name)
        .bind(to_i64(upload.bytes))
        .bind(&upload.digest)
        .bind(upload.expires_at.as_millisecond())
        .execute(&mut *tx)
        .await?;
        tx.commit().await
    }

    async fn upload(&self, id: UploadId) -> Result<UploadRecord, DatabaseError> {
        let row: Option<Row> = sqlx::query_as("SELECT * FROM upload WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        row.ok_or_else(|| not_found(id))?.record()
    }

    async fn uploads_of(&self, set: ScanSetId) -> Result<Vec<UploadRecord>, DatabaseError> {
        let rows: Vec<Row> = sqlx::query_as("SELECT * FROM upload WHERE scan_set_id = $1 AND NOT is_done ORDER BY id")
            .bind(set.to_string())
            .fetch_all(&self.readers)
            .await?;
        rows.into_iter().map(Row::record).collect()
    }

    async fn extend_upload(&self, id: UploadId, until: Timestamp) -> Result<(), DatabaseError> {
        let done = sqlx::query("UPDATE upload SET expires_at = $1 WHERE id = $2")
            .bind(until.as_millisecond())
            .bind(id.to_string())
            .execute(&self.writer)
            .await?;
        if done.rows_affected() == 0 { Err(not_found(id)) } else { Ok(()) }
    }

    async fn finish_upload(&self, id: UploadId) -> Result<(), DatabaseError> {
        let finish = async || -> Result<(), DatabaseError> {
            let mut tx = self.begin_any().await?;
            let update = "UPDATE upload SET is_done = TRUE WHERE id = $1";
            sqlx::query(update).bind(id.to_string()).execute(&mut *tx).await?;
            tx.commit().await
        };
        self.with_reserve(finish).await
    }

    async fn delete_upload(&self, id: UploadId) -> Result<(), DatabaseError> {
        let delete = async || -> Result<(), DatabaseError> {
            let mut tx = self.begin_any().await?;
            sqlx::query("DELETE FROM upload WHERE id = $1").bind(id.to_string()).execute(&mut *tx).await?;
            tx.commit().await
        };
        self.with_reserve(delete).await
    }

    async fn forget_old_uploads(&self, now: Timestamp) -> Result<(), DatabaseError> {
        let forget = async || -> Result<(), DatabaseError> {
            let mut tx = self.begin_any().await?;
            let delete = "DELETE FROM upload WHERE expires_at <= $1";
            sqlx::query(delete).bind(now.as_millisecond()).execute(&mut *tx).await?;
            tx.commit().await
        };
        self.with_reserve(forget).await
    }

    async fn open_uploads(&self) -> Result<Vec<UploadId>, DatabaseError> {
        let ids: Vec<String> =
            sqlx::query_scalar("SELECT id FROM upload WHERE NOT is_done").fetch_all(&self.readers).await?;
        ids.iter().map(|text| stored_id!(UploadId, text)).collect()
    }
}
