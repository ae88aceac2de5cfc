//! Other processes on the database: what they commit is told by `NOTIFY`, which may be lost, and stands in the tables, which is what counts.

use std::time::Duration;

use async_trait::async_trait;
use sqlx::postgres::{PgListener, PgRow};
use sqlx::{AssertSqlSafe, FromRow};

use super::PostgresDatabase;
use super::sql::segments::Row;
use super::sql::{to_i64, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::{Alone, Exclusive, GalleryChanges, News, Others};

/// The channel of `NOTIFY`.
const CHANNEL: &str = "visage";
/// How often everything is looked at though nothing was heard: a connection may be lost without a sound.
const LOOK: Duration = Duration::from_secs(2);
/// How long a connection that can't be had is not tried again.
const AGAIN: Duration = Duration::from_millis(500);
/// How long changes of the gallery are kept: for as long as that an index can be behind without being loaded anew.
const KEEP: Duration = Duration::from_secs(24 * 3600);
const ALL: [News; 3] = [News::Work, News::Progress, News::Gallery];

/// The names among advisory locks.
fn lock(what: Alone) -> i64 {
    match what {
        Alone::Upkeep => 0x7669_7361_6765_0003,
        Alone::ConditionalChange => 0x7669_7361_6765_0004,
    }
}

impl PostgresDatabase {
    async fn hear(&self, hear: &(dyn Fn(News) + Send + Sync)) -> Result<(), sqlx::Error> {
        let mut listener = PgListener::connect_with(&self.waiting).await?;
        listener.listen(CHANNEL).await?;
        // what was told before is in the tables
        ALL.into_iter().for_each(hear);
        loop {
            match tokio::time::timeout(LOOK, listener.try_recv()).await {
                Ok(told) => match told?.map(|told| told.payload().to_owned()).as_deref() {
                    Some("work" | "messages") => hear(News::Work),
                    Some("progress") => hear(News::Progress),
                    Some("gallery") => hear(News::Gallery),
                    // by another version; or the connection was lost, and is there again
                    Some(_) | None => ALL.into_iter().for_each(hear),
                },
                Err(_silence) => ALL.into_iter().for_each(hear),
            }
        }
    }

    /// Held by a transaction, which ends when it is dropped, and with its connection.
    async fn held(&self, statement: &str, what: Alone) -> Result<(bool, Exclusive), DatabaseError> {
        let mut transaction = self.waiting.begin().await?;
        sqlx::query("SET LOCAL idle_in_transaction_session_timeout = 0").execute(&mut *transaction).await?;
        let lock = AssertSqlSafe(format!("SELECT coalesce({statement}({})::text, '') <> 'false'", lock(what)));
        let is_held: bool = sqlx::query_scalar(lock).fetch_one(&mut *transaction).await?;
        Ok((is_held, Box::new(transaction)))
    }
}

#[async_trait]
impl Others for PostgresDatabase {
    async fn gallery_version(&self) -> Result<Option<u64>, DatabaseError> {
        let version: i64 = sqlx::query_scalar("SELECT version FROM gallery_version").fetch_one(&self.readers).await?;
        Ok(Some(to_u64(version)))
    }

    async fn gallery_changes(&self, after: u64, limit: usize) -> Result<Option<GalleryChanges>, DatabaseError> {
        let mut tx = self.snapshot().await?;
        let (version, forgotten): (i64, i64) =
            sqlx::query_as("SELECT version, forgotten FROM gallery_version").fetch_one(&mut *tx).await?;
        if after < to_u64(forgotten) {
            return Ok(None);
        }
        let rows: Vec<PgRow> = sqlx::query(
            "SELECT gallery_change.version, gallery_change.model_id AS id, label, unit, job_id IS NULL AS uploaded, content,
                    signature.checksum AS checksum
             FROM gallery_change
             LEFT JOIN model ON model.id = gallery_change.model_id
             LEFT JOIN signature ON signature.model_id = gallery_change.model_id
             WHERE gallery_change.version > $1 ORDER BY gallery_change.version LIMIT $2",
        )
        .bind(to_i64(after))
        .bind(to_i64(limit as u64))
        .fetch_all(&mut *tx)
        .await?;
        let mut changes = GalleryChanges { version: to_u64(version), models: Vec::with_capacity(rows.len()) };
        for row in &rows {
            changes.models.push(Row::from_row(row)?.unfiled()?);
        }
        if let Some(last) = rows.last().filter(|_| rows.len() >= limit) {
            changes.version = to_u64(sqlx::Row::try_get(last, "version")?);
        }
        Ok(Some(changes))
    }

    async fn forget_gallery_changes(&self) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        let oldest = tx.now_ms().saturating_sub(to_i64(KEEP.as_secs()).saturating_mul(1000));
        sqlx::query(
            "WITH gone AS (DELETE FROM gallery_change WHERE at < $1 RETURNING version)
             UPDATE gallery_version SET forgotten = greatest(forgotten, (SELECT coalesce(max(version), 0) FROM gone))",
        )
        .bind(oldest)
        .execute(&mut *tx)
        .await?;
        tx.commit().await
    }

    async fn listen(&self, hear: &(dyn Fn(News) + Send + Sync)) {
        loop {
            if let Err(error) = self.hear(hear).await {
                tracing::warn!("news of other servers can't be heard: {error}; it is tried again");
            }
            tokio::time::sleep(AGAIN).await;
            // until then somebody may wait for what was written before
            ALL.into_iter().for_each(hear);
        }
    }

    async fn try_alone(&self, what: Alone) -> Result<Option<Exclusive>, DatabaseError> {
        let (is_held, exclusive) = self.held("pg_try_advisory_xact_lock", what).await?;
        Ok(is_held.then_some(exclusive))
    }

    async fn wait_for(&self, what: Alone, is_shared: bool) -> Result<Exclusive, DatabaseError> {
        if !self.is_shared {
            // what is in memory does for one process
            return Ok(Box::new(()));
        }
        let statement = if is_shared { "pg_advisory_xact_lock_shared" } else { "pg_advisory_xact_lock" };
        Ok(self.held(statement, what).await?.1)
    }
}
