//! Signatures as they are stored: a BLOB a model with its version and its checksum.

use sqlx::SqliteConnection;

use super::{SqliteDatabase, damaged, stored_id, to_i64};
use crate::storage::database::Signatures;
use crate::storage::{DatabaseError, Unseen};
use async_trait::async_trait;
use visage_domain::{ModelId, StoredContent, StoredSignature};

/// The version of a signature that turned out to be damaged: it is of no operator, and so it is made anew.
const DAMAGED: u32 = 0;
/// Checksums of signatures from before there were any, made in one transaction.
const AT_ONCE: i64 = 1000;

/// Bytes held against their checksum.
pub(super) fn checked(content: Vec<u8>, checksum: Option<&str>) -> StoredContent {
    // without one it is from before, and the start has filled it in by now
    match checksum {
        Some(checksum) if checksum != checksum_of(&content) => StoredContent::Damaged,
        _ => StoredContent::Whole(content),
    }
}

fn checksum_of(content: &[u8]) -> String {
    blake3::hash(content).to_hex().to_string()
}

#[async_trait]
impl Signatures for SqliteDatabase {
    async fn signature(&self, id: ModelId) -> Result<Option<Vec<u8>>, DatabaseError> {
        let row: Option<(Vec<u8>, Option<String>)> =
            sqlx::query_as("SELECT content, checksum FROM signature WHERE model_id = ?")
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
            "SELECT model_id, content, checksum FROM signature WHERE model_id > ? ORDER BY model_id LIMIT ?",
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
        let done =
            sqlx::query("UPDATE signature SET version = ?, summary = ?, content = ?, checksum = ? WHERE model_id = ?")
                .bind(signature.version)
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
            sqlx::query("UPDATE signature SET version = ? WHERE model_id = ?")
                .bind(DAMAGED)
                .bind(id.to_string())
                .execute(&mut *tx)
                .await?;
        }
        tx.commit().await
    }
}

impl SqliteDatabase {
    /// Gives signatures from before there were checksums theirs.
    pub(super) async fn fill_in_checksums(&self) -> Result<(), DatabaseError> {
        loop {
            let rows: Vec<(String, Vec<u8>)> =
                sqlx::query_as("SELECT model_id, content FROM signature WHERE checksum IS NULL LIMIT ?")
                    .bind(AT_ONCE)
                    .fetch_all(&self.readers)
                    .await?;
            if rows.is_empty() {
                return Ok(());
            }
            let mut tx = self.begin_any().await?;
            for (id, content) in rows {
                sqlx::query("UPDATE signature SET checksum = ? WHERE model_id = ?")
                    .bind(checksum_of(&content))
                    .bind(id)
                    .execute(&mut *tx)
                    .await?;
            }
            tx.commit().await?;
        }
    }
}

/// Stores the signature of a model; part of a larger transaction.
pub(super) async fn insert(
    db: &mut SqliteConnection,
    model: &str,
    signature: &StoredSignature,
) -> Result<(), DatabaseError> {
    let summary = serde_json::to_string(&signature.summary).map_err(|error| damaged("a summary", error))?;
    sqlx::query("INSERT INTO signature (model_id, version, summary, content, checksum) VALUES (?, ?, ?, ?, ?)")
        .bind(model)
        .bind(signature.version)
        .bind(summary)
        .bind(&signature.content)
        .bind(checksum_of(&signature.content))
        .execute(db)
        .await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;
    use crate::storage::database::*;
    use visage_domain::NewModel;
    use visage_shape::faces::{Signature, SignatureSummary};

    fn signed() -> NewModel {
        let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
        let signature = StoredSignature { version: Signature::VERSION, summary, content: vec![1, 2, 3] };
        NewModel { signature: Some(signature), ..NewModel::example(None) }
    }

    #[tokio::test]
    async fn a_flipped_byte_is_seen_by_everybody_who_reads_it() {
        let (store, _folder) = testing::store().await;
        let model = signed();
        drop(store.create_model(&model, None).await.expect("stored"));
        sqlx::query("UPDATE signature SET content = x'010203'").execute(&store.writer).await.expect("the same");
        assert_eq!(store.signature(model.id).await.expect("whole"), Some(vec![1, 2, 3]));
        sqlx::query("UPDATE signature SET content = x'010703'").execute(&store.writer).await.expect("flipped");
        assert!(matches!(store.signature(model.id).await, Err(DatabaseError::Damaged { what: "a signature", .. })));
        let read = store.signatures_after(None, 5).await.expect("read");
        assert_eq!(read, [(model.id, StoredContent::Damaged)]);
        assert_eq!(store.matched_models(&[model.id]).await.expect("read")[0].signature, None);

        assert_eq!(store.backlog().await.expect("read").stale_signatures, 0);
        store.give_up_signatures(&[model.id]).await.expect("given up");
        assert_eq!(store.backlog().await.expect("read").stale_signatures, 1, "it is to be made anew");
    }

    #[tokio::test]
    async fn signatures_from_before_get_their_checksums() {
        let (store, _folder) = testing::store().await;
        drop(store.create_model(&signed(), None).await.expect("stored"));
        sqlx::query("UPDATE signature SET checksum = NULL").execute(&store.writer).await.expect("from before");
        store.fill_in_checksums().await.expect("filled in");
        let checksum: String =
            sqlx::query_scalar("SELECT checksum FROM signature").fetch_one(&store.readers).await.expect("there");
        assert_eq!(checksum, checksum_of(&[1, 2, 3]));
    }
}
