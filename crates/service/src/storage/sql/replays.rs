//! Answers kept for POSTs that carry an `Idempotency-Key`: written in the same transaction as what they created.

use std::time::Duration;

use super::rows::row;
use super::{Connection, Store, Writing, damaged};
use crate::storage::DatabaseError;
use crate::storage::database::Replays;
use async_trait::async_trait;
use visage_domain::{Replay, ReplayKey};

/// How long a repeated request gets its first answer.
const KEEP: Duration = Duration::from_secs(24 * 3600);

row! {
    struct Row {
        body_hash: String,
        status: i64,
        location: String,
        body: String,
        resource_id: String,
    }
}

#[async_trait]
impl Replays for Store {
    async fn replay(&self, key: &ReplayKey) -> Result<Option<Replay>, DatabaseError> {
        let row: Option<Row> = sqlx::query_as(
            "SELECT body_hash, status, location, body, resource_id FROM replay WHERE route = $1 AND key = $2",
        )
        .bind(key.route)
        .bind(&key.key)
        .fetch_optional(&self.readers)
        .await?;
        let Some(row) = row else { return Ok(None) };
        if row.body_hash != key.body_hash {
            return Err(DatabaseError::KeyReused { key: key.key.clone() });
        }
        Ok(Some(Replay {
            key: key.clone(),
            status: u16::try_from(row.status).map_err(|error| damaged("a status", error))?,
            location: row.location,
            body: row.body,
            resource_id: row.resource_id,
        }))
    }

    async fn forget_old_replays(&self) -> Result<u64, DatabaseError> {
        let mut tx = self.begin_any().await?;
        let oldest = tx.now_ms() - i64::try_from(KEEP.as_millis()).unwrap_or(i64::MAX);
        let done = sqlx::query("DELETE FROM replay WHERE created_at < $1").bind(oldest).execute(&mut *tx).await?;
        tx.commit().await?;
        Ok(done.rows_affected())
    }
}

/// Keeps an answer; part of the transaction that creates the resource.
pub(super) async fn insert(db: &mut Writing, replay: &Replay) -> Result<(), DatabaseError> {
    let kept = sqlx::query(
        "INSERT INTO replay (route, key, body_hash, status, location, body, resource_id, created_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT DO NOTHING",
    )
    .bind(replay.key.route)
    .bind(&replay.key.key)
    .bind(&replay.key.body_hash)
    .bind(i64::from(replay.status))
    .bind(&replay.location)
    .bind(&replay.body)
    .bind(&replay.resource_id)
    .bind(db.now_ms())
    .execute(&mut **db)
    .await?;
    // the same request has come to another process, which was first
    if kept.rows_affected() == 0 {
        return Err(DatabaseError::DoneMeanwhile { key: replay.key.key.clone() });
    }
    Ok(())
}

/// Forgets the answers about a resource that is deleted.
pub(super) async fn delete_of(db: &mut Connection, resource_id: &str) -> Result<(), DatabaseError> {
    sqlx::query("DELETE FROM replay WHERE resource_id = $1").bind(resource_id).execute(db).await?;
    Ok(())
}
