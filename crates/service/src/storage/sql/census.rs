//! How much of everything there is.

use super::{DATABASE_BYTES, Store, to_u64};
use crate::storage::DatabaseError;
use visage_domain::Census;

impl Store {
    /// All of it in one snapshot; reads the indices of the tables of files once.
    pub(in super::super) async fn counted(&self) -> Result<Census, DatabaseError> {
        let mut tx = self.snapshot().await?;
        let counts: (i64, i64, i64, i64, i64, i64, i64) = sqlx::query_as(
            "SELECT (SELECT count(*) FROM scan_set), (SELECT count(*) FROM scan), (SELECT count(*) FROM model),
                    (SELECT count(*) FROM standard),
                    (SELECT count(*) FROM delivery WHERE status = 'pending'),
                    (SELECT count(*) FROM delivery WHERE status = 'dead'), (SELECT count(*) FROM bin)",
        )
        .fetch_one(&mut *tx)
        .await?;
        let file_bytes: i64 = sqlx::query_scalar(
            "SELECT CAST((SELECT coalesce(sum(bytes), 0) FROM scan) + (SELECT coalesce(sum(bytes), 0) FROM asset)
                  + (SELECT coalesce(sum(bytes), 0) FROM standard)
                  + (SELECT coalesce(sum(bytes), 0) FROM binned_scan)
                  + (SELECT coalesce(sum(bytes), 0) FROM binned_asset) AS BIGINT)",
        )
        .fetch_one(&mut *tx)
        .await?;
        let database_bytes: i64 = sqlx::query_scalar(DATABASE_BYTES).fetch_one(&mut *tx).await?;
        let jobs: Vec<(String, String, i64)> =
            sqlx::query_as("SELECT kind, status, count(*) FROM job GROUP BY kind, status ORDER BY kind, status")
                .fetch_all(&mut *tx)
                .await?;
        let verdicts: Vec<(String, i64)> = sqlx::query_as(
            "SELECT quality, count(*) FROM model WHERE quality IS NOT NULL GROUP BY quality ORDER BY quality",
        )
        .fetch_all(&mut *tx)
        .await?;
        Ok(Census {
            scan_sets: to_u64(counts.0),
            scans: to_u64(counts.1),
            models: to_u64(counts.2),
            standards: to_u64(counts.3),
            messages_pending: to_u64(counts.4),
            messages_dead: to_u64(counts.5),
            bin_entries: to_u64(counts.6),
            file_bytes: to_u64(file_bytes),
            database_bytes: to_u64(database_bytes),
            jobs: jobs.into_iter().map(|(kind, status, count)| (kind, status, to_u64(count))).collect(),
            verdicts: verdicts.into_iter().map(|(verdict, count)| (verdict, to_u64(count))).collect(),
        })
    }
}
