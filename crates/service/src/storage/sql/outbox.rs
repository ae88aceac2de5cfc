//! What webhooks are to be told is written in the transaction of what has happened: neither is there without the other.

use super::{Writing, damaged, stored_id, stored_name, timestamp, to_i64};
use crate::storage::DatabaseError;
use visage_domain::{DeliveryId, Event, JobStatus, SeatId};

/// Messages to one webhook that may wait: a receiver that is gone must not fill the disk.
pub(super) const MOST_PENDING: u64 = 10_000;

/// Queues a message for each webhook that wants events of this kind.
pub(super) async fn tell(db: &mut Writing, event: &Event) -> Result<(), DatabaseError> {
    let hooks: Vec<String> = sqlx::query_scalar(
        "SELECT webhook.id FROM webhook LEFT JOIN api_key ON api_key.id = webhook.key_id
         WHERE $1 IN (SELECT value FROM json_each(webhook.events))
           AND (api_key.expires_at IS NULL OR api_key.expires_at > $2)
         ORDER BY webhook.id",
    )
    .bind(event.kind().name())
    .bind(db.now_ms())
    .fetch_all(&mut **db)
    .await?;
    for hook in hooks {
        queue(db, &hook, event).await?;
    }
    Ok(())
}

/// The same of jobs that have ended together: their ids and kinds, as `RETURNING id, kind` gives them.
pub(super) async fn tell_ends(
    db: &mut Writing,
    jobs: &[(String, String)],
    status: JobStatus,
) -> Result<(), DatabaseError> {
    for (id, kind) in jobs {
        let kind = stored_name("a kind of job", kind)?;
        tell(db, &Event::JobEnded { id: stored_id!(JobId, id)?, kind, status, model: None }).await?;
    }
    Ok(())
}

/// Queues a message for one webhook, or counts it as missed if too many wait.
pub(super) async fn queue(db: &mut Writing, hook: &str, event: &Event) -> Result<Option<DeliveryId>, DatabaseError> {
    let (id, now) = (DeliveryId::new(), db.now_ms());
    let body = event.body(timestamp(now)?).map_err(|error| damaged("an event", error))?;
    let queued = sqlx::query(
        "INSERT INTO delivery (id, webhook_id, event, body, at) SELECT $1, $2, $3, $4, $5
         WHERE (SELECT count(*) FROM delivery WHERE webhook_id = $2 AND status = 'pending') < $6",
    )
    .bind(id.to_string())
    .bind(hook)
    .bind(event.kind().name())
    .bind(body)
    .bind(now)
    .bind(to_i64(MOST_PENDING))
    .execute(&mut **db)
    .await?;
    if queued.rows_affected() == 1 {
        return Ok(Some(id));
    }
    sqlx::query("UPDATE webhook SET missed = missed + 1 WHERE id = $1").bind(hook).execute(&mut **db).await?;
    Ok(None)
}

/// At the start of a process: what the one before was sending from its seat is sent at once.
pub(super) async fn take_back(db: &mut Writing, seat: SeatId) -> Result<(), DatabaseError> {
    sqlx::query("UPDATE delivery SET at = $1, seat = NULL WHERE status = 'pending' AND seat = $2")
        .bind(db.now_ms())
        .bind(seat.to_string())
        .execute(&mut **db)
        .await?;
    Ok(())
}
