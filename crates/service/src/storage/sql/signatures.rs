//! Signatures as they are stored: a BLOB a model with its version and its checksum.

use super::{Connection, Store, damaged, stored_id, to_i64};
use crate::storage::database::Signatures;
use crate::storage::{DatabaseError, Unseen};
use async_trait::async_trait;
use visage_domain::{ModelId, StoredContent, StoredSignature};

/// The version of a signature that turned out to be damaged: it is of no operator, and so it is made anew.
const DAMAGED: i64 = 0;

/// Bytes held against their checksum.
pub(super) fn checked(content: Vec<u8>, checksum: Option<&str>) -> StoredContent {
    // without one it is from before, and the start has filled it in by now
    match checksum {
        Some(checksum) if checksum != checksum_of(&content) => StoredContent::Damaged,
        _ => StoredContent::Whole(content),
    }
}

pub(in super::super) fn checksum_of(content: &[u8]) -> String {
    blake3::hash(content).to_hex().to_string()
}

#[async_trait]
impl Signatures for Store {
    async fn signature(&self, id: ModelId) -> Result<Option<Vec<u8>>, DatabaseError> {
        let row: Option<(Vec<u8>, Option<String>)> =
            sqlx::query_as("SELECT content, checksum FROM signature WHERE model_id = $1")
                .bind(id.to_string())
                .fetch_optional(&self.readers)
                .await?;
        match row.map(|(content, checksum)| checked(content, checksum.as_deref())) {
            None => Ok(None),
            Some(StoredContent::Whole(content)) => Ok(Some(content)),
            Some(StoredContent::Damaged) => Err(damaged("a signature", format!("its checksum differs (model {id})"))),
        }
    }

    async fn signatures_after(
        &self,
        after: Option<ModelId>,
        limit: usize,
    ) -> Result<Vec<(ModelId, StoredContent)>, DatabaseError> {
        let rows: Vec<(String, Vec<u8>, Option<String>)> = sqlx::query_as(
            "SELECT model_id, content, checksum FROM signature WHERE model_id > $1 ORDER BY model_id LIMIT $2",
        )
        .bind(after.map_or(String::new(), |id| id.to_string()))
        .bind(to_i64(limit as u64))
        .fetch_all(&self.readers)
        .await?;
        let record = |(id, content, checksum): (String, Vec<u8>, Option<String>)| {
            Ok((stored_id!(ModelId, &id)?, checked(content, checksum.as_deref())))
        };
        rows.into_iter().map(record).collect()
    }

    async fn renew_signature(&self, id: ModelId, signature: &StoredSignature) -> Result<Option<Unseen>, DatabaseError> {
        let summary = serde_json::to_string(&signature.summary).map_err(|error| damaged("a summary", error))?;
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE signature SET version = $1, summary = $2, content = $3, checksum = $4 WHERE model_id = $5",
        )
        .bind(i64::from(signature.version))
        .bind(summary)
        .bind(&signature.content)
        .bind(checksum_of(&signature.content))
        .bind(id.to_string())
        .execute(&mut *tx)
        .await?;
        if done.rows_affected() == 0 {
            return Ok(None);
        }
        tx.commit_unseen(self).await.map(Some)
    }

    async fn give_up_signatures(&self, ids: &[ModelId]) -> Result<(), DatabaseError> {
        if ids.is_empty() {
            return Ok(());
        }
        let mut tx = self.begin().await?;
        for id in ids {
            sqlx::query("UPDATE signature SET version = $1 WHERE model_id = $2")
                .bind(DAMAGED)
                .bind(id.to_string())
                .execute(&mut *tx)
                .await?;
        }
        tx.commit().await
    }
}

/// Stores the signature of a model; part of a larger transaction.
pub(super) async fn insert(db: &mut Connection, model: &str, signature: &StoredSignature) -> Result<(), DatabaseError> {
    let summary = serde_json::to_string(&signature.summary).map_err(|error| damaged("a summary", error))?;
    sqlx::query("INSERT INTO signature (model_id, version, summary, content, checksum) VALUES ($1, $2, $3, $4, $5)")
        .bind(model)
        .bind(i64::from(signature.version))
        .bind(summary)
        .bind(&signature.content)
        .bind(checksum_of(&signature.content))
        .execute(db)
        .await?;
    Ok(())
}
