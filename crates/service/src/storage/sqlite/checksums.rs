//! Checksums of signatures from before there were any.

use super::SqliteDatabase;
use super::sql::signatures::checksum_of;
use crate::storage::DatabaseError;

/// Made in one transaction.
const AT_ONCE: i64 = 1000;

impl SqliteDatabase {
    /// Gives signatures from before there were checksums theirs.
    pub(super) async fn fill_in_checksums(&self) -> Result<(), DatabaseError> {
        loop {
            let rows: Vec<(String, Vec<u8>)> =
                sqlx::query_as("SELECT model_id, content FROM signature WHERE checksum IS NULL LIMIT $1")
                    .bind(AT_ONCE)
                    .fetch_all(&self.readers)
                    .await?;
            if rows.is_empty() {
                return Ok(());
            }
            let mut tx = self.begin_any().await?;
            for (id, content) in rows {
                sqlx::query("UPDATE signature SET checksum = $1 WHERE model_id = $2")
                    .bind(checksum_of(&content))
                    .bind(id)
                    .execute(&mut *tx)
                    .await?;
            }
            tx.commit().await?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;
    use crate::storage::database::*;
    use visage_domain::{NewModel, StoredContent, StoredSignature};
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
