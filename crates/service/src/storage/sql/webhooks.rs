//! Webhooks and the messages to them; what queues messages is in `outbox`.

use std::time::Duration;

use jiff::Timestamp;

use super::rows::row;
use super::{Connection, Store, damaged, outbox, sql_limit, stored_id, stored_name, timestamp, to_i64, to_u32, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::Webhooks;
use async_trait::async_trait;
use visage_domain::{
    Attempt, DeliveryClaim, DeliveryId, DeliveryRecord, DeliveryStatus, Event, EventKind, NewWebhook, Page,
    PageRequest, WebhookId, WebhookRecord, WebhookSecret,
};

row! {
    struct WebhookRow {
        id: String,
        key_id: Option<String>,
        name: String,
        url: String,
        events: String,
        missed: i64,
        pending: i64,
        dead: i64,
    }
}

impl WebhookRow {
    fn record(self) -> Result<WebhookRecord, DatabaseError> {
        Ok(WebhookRecord {
            id: stored_id!(WebhookId, &self.id)?,
            key: self.key_id.map(|text| stored_id!(KeyId, &text)).transpose()?,
            name: self.name,
            url: self.url,
            events: serde_json::from_str::<Vec<EventKind>>(&self.events).map_err(|error| damaged("events", error))?,
            pending: to_u64(self.pending),
            dead: to_u64(self.dead),
            missed: to_u64(self.missed),
        })
    }
}

/// A webhook with the numbers of messages that wait and that are dead.
const WEBHOOK: &str = "SELECT id, key_id, name, url, events, missed,
    (SELECT count(*) FROM delivery WHERE webhook_id = webhook.id AND status = 'pending') AS pending,
    (SELECT count(*) FROM delivery WHERE webhook_id = webhook.id AND status = 'dead') AS dead
    FROM webhook";

row! {
    struct DeliveryRow {
        id: String,
        event: String,
        status: String,
        attempts: i64,
        at: i64,
        answer: Option<i64>,
        error: Option<String>,
    }
}

impl DeliveryRow {
    fn record(self) -> Result<DeliveryRecord, DatabaseError> {
        Ok(DeliveryRecord {
            id: stored_id!(DeliveryId, &self.id)?,
            event: stored_name("an event", &self.event)?,
            status: stored_name("a status", &self.status)?,
            attempts: to_u32(self.attempts),
            at: timestamp(self.at)?,
            answer: self.answer.map(u16::try_from).transpose().map_err(|error| damaged("an answer", error))?,
            error: self.error,
        })
    }
}

row! {
    struct ClaimRow {
        id: String,
        webhook_id: String,
        url: String,
        secret: Vec<u8>,
        body: String,
        attempts: i64,
    }
}

impl ClaimRow {
    fn claim(self) -> Result<DeliveryClaim, DatabaseError> {
        let secret = self.secret.try_into().map_err(|_| damaged("a secret", "it has not 32 bytes"))?;
        Ok(DeliveryClaim {
            id: stored_id!(DeliveryId, &self.id)?,
            webhook: stored_id!(WebhookId, &self.webhook_id)?,
            url: self.url,
            secret: WebhookSecret(secret),
            body: self.body,
            attempts: to_u32(self.attempts),
        })
    }
}

#[async_trait]
impl Webhooks for Store {
    async fn create_webhook(&self, webhook: &NewWebhook, limit: usize) -> Result<(), DatabaseError> {
        let events = serde_json::to_string(&webhook.events).map_err(|error| damaged("events", error))?;
        let mut tx = self.begin().await?;
        let count: i64 = sqlx::query_scalar("SELECT count(*) FROM webhook").fetch_one(&mut *tx).await?;
        if count >= to_i64(limit as u64) {
            return Err(DatabaseError::TooManyWebhooks { limit });
        }
        sqlx::query("INSERT INTO webhook (id, key_id, name, url, events, secret) VALUES ($1, $2, $3, $4, $5, $6)")
            .bind(webhook.id.to_string())
            .bind(webhook.key.map(|key| key.to_string()))
            .bind(&webhook.name)
            .bind(&webhook.url)
            .bind(events)
            .bind(webhook.secret.0.as_slice())
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }

    async fn webhooks(&self, page: &PageRequest) -> Result<Page<WebhookRecord>, DatabaseError> {
        let sql = format!("{WEBHOOK} WHERE $1 IS NULL OR id < $1 ORDER BY id DESC LIMIT $2");
        let rows: Vec<WebhookRow> = sqlx::query_as(sqlx::AssertSqlSafe(sql))
            .bind(page.before.as_deref())
            .bind(sql_limit(page))
            .fetch_all(&self.readers)
            .await?;
        let records = rows.into_iter().map(WebhookRow::record).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(records, page.limit))
    }

    async fn webhook(&self, id: WebhookId) -> Result<WebhookRecord, DatabaseError> {
        let row: Option<WebhookRow> = sqlx::query_as(sqlx::AssertSqlSafe(format!("{WEBHOOK} WHERE id = $1")))
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        row.ok_or_else(|| not_found(id))?.record()
    }

    async fn delete_webhook(&self, id: WebhookId) -> Result<(), DatabaseError> {
        let delete = || async {
            let mut tx = self.begin_any().await?;
            let done = sqlx::query("DELETE FROM webhook WHERE id = $1").bind(id.to_string()).execute(&mut *tx).await?;
            if done.rows_affected() == 0 {
                return Err(not_found(id));
            }
            tx.commit().await
        };
        self.with_reserve(delete).await
    }

    async fn ping_webhook(&self, id: WebhookId) -> Result<DeliveryRecord, DatabaseError> {
        let mut tx = self.begin().await?;
        check_there(&mut tx, id).await?;
        let queued = outbox::queue(&mut tx, &id.to_string(), &Event::Ping(id)).await?;
        let delivery = queued.ok_or(DatabaseError::QueueFull { limit: outbox::MOST_PENDING as usize })?;
        let record = delivery_of(&mut tx, id, delivery).await?;
        tx.commit().await?;
        Ok(record)
    }

    async fn deliveries(
        &self,
        id: WebhookId,
        status: Option<DeliveryStatus>,
        page: &PageRequest,
    ) -> Result<Page<DeliveryRecord>, DatabaseError> {
        let mut db = self.snapshot().await?;
        check_there(&mut db, id).await?;
        let rows: Vec<DeliveryRow> = sqlx::query_as(
            "SELECT * FROM delivery WHERE webhook_id = $1 AND ($2 IS NULL OR status = $2) AND ($3 IS NULL OR id < $3)
             ORDER BY id DESC LIMIT $4",
        )
        .bind(id.to_string())
        .bind(status.map(DeliveryStatus::name))
        .bind(page.before.as_deref())
        .bind(sql_limit(page))
        .fetch_all(&mut *db)
        .await?;
        let records = rows.into_iter().map(DeliveryRow::record).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(records, page.limit))
    }

    async fn replay_delivery(&self, id: WebhookId, delivery: DeliveryId) -> Result<DeliveryRecord, DatabaseError> {
        let mut tx = self.begin().await?;
        if delivery_of(&mut tx, id, delivery).await?.status == DeliveryStatus::Pending {
            return Err(DatabaseError::StillPending { id: delivery });
        }
        sqlx::query("UPDATE delivery SET status = 'pending', attempts = 0, at = $1 WHERE id = $2")
            .bind(tx.now_ms())
            .bind(delivery.to_string())
            .execute(&mut *tx)
            .await?;
        let record = delivery_of(&mut tx, id, delivery).await?;
        tx.commit().await?;
        Ok(record)
    }

    async fn replay_dead(&self, id: WebhookId) -> Result<u64, DatabaseError> {
        let mut tx = self.begin().await?;
        check_there(&mut tx, id).await?;
        let done = sqlx::query(
            "UPDATE delivery SET status = 'pending', attempts = 0, at = $1 WHERE webhook_id = $2 AND status = 'dead'",
        )
        .bind(tx.now_ms())
        .bind(id.to_string())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected())
    }

    async fn next_delivery(&self, except: &[WebhookId]) -> Result<Option<Timestamp>, DatabaseError> {
        let at: Option<i64> = sqlx::query_scalar(
            "SELECT at FROM delivery
             WHERE status = 'pending' AND webhook_id NOT IN (SELECT value FROM json_each($1)) ORDER BY at LIMIT 1",
        )
        .bind(list(except)?)
        .fetch_optional(&self.readers)
        .await?;
        at.map(timestamp).transpose()
    }

    async fn claim_delivery(
        &self,
        except: &[WebhookId],
        lease: Duration,
    ) -> Result<Option<DeliveryClaim>, DatabaseError> {
        let mut tx = self.begin_any().await?;
        let now = tx.now_ms();
        let row: Option<ClaimRow> = sqlx::query_as(
            "UPDATE delivery SET attempts = attempts + 1, at = $1, seat = $4
             WHERE id = (SELECT id FROM delivery WHERE status = 'pending' AND at <= $2
                           AND webhook_id NOT IN (SELECT value FROM json_each($3)) ORDER BY at, id LIMIT 1)
             RETURNING id, webhook_id, body, attempts,
                       (SELECT url FROM webhook WHERE webhook.id = webhook_id) AS url,
                       (SELECT secret FROM webhook WHERE webhook.id = webhook_id) AS secret",
        )
        .bind(now.saturating_add(i64::try_from(lease.as_millis()).unwrap_or(i64::MAX)))
        .bind(now)
        .bind(list(except)?)
        .bind(self.owner.seat.to_string())
        .fetch_optional(&mut *tx)
        .await?;
        tx.commit().await?;
        row.map(ClaimRow::claim).transpose()
    }

    async fn end_attempt(&self, claim: &DeliveryClaim, attempt: &Attempt) -> Result<(), DatabaseError> {
        let end = || async {
            let mut tx = self.begin_any().await?;
            sqlx::query(
                "UPDATE delivery SET status = $1, at = $2, answer = $3, error = $4, seat = NULL
                 WHERE id = $5 AND status = 'pending' AND attempts = $6",
            )
            .bind(attempt.status.name())
            .bind(attempt.at.as_millisecond())
            .bind(attempt.answer.map(i64::from))
            .bind(&attempt.error)
            .bind(claim.id.to_string())
            .bind(i64::from(claim.attempts))
            .execute(&mut *tx)
            .await?;
            tx.commit().await
        };
        self.with_reserve(end).await
    }

    async fn forget_deliveries(&self, delivered: Timestamp, dead: Timestamp) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        for (status, before) in [("delivered", delivered), ("dead", dead)] {
            sqlx::query("DELETE FROM delivery WHERE status = $1 AND at < $2")
                .bind(status)
                .bind(before.as_millisecond())
                .execute(&mut *tx)
                .await?;
        }
        let over = "DELETE FROM webhook WHERE key_id IN (SELECT id FROM api_key WHERE expires_at <= $1)";
        sqlx::query(over).bind(tx.now_ms()).execute(&mut *tx).await?;
        tx.commit().await
    }
}

fn not_found(id: WebhookId) -> DatabaseError {
    DatabaseError::NotFound { kind: "webhook", id: id.to_string() }
}

fn list(ids: &[WebhookId]) -> Result<String, DatabaseError> {
    let ids: Vec<String> = ids.iter().map(WebhookId::to_string).collect();
    serde_json::to_string(&ids).map_err(|error| damaged("ids of webhooks", error))
}

async fn check_there(db: &mut Connection, id: WebhookId) -> Result<(), DatabaseError> {
    let is_there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM webhook WHERE id = $1)")
        .bind(id.to_string())
        .fetch_one(db)
        .await?;
    if is_there { Ok(()) } else { Err(not_found(id)) }
}

async fn delivery_of(
    db: &mut Connection,
    id: WebhookId,
    delivery: DeliveryId,
) -> Result<DeliveryRecord, DatabaseError> {
    let row: Option<DeliveryRow> = sqlx::query_as("SELECT * FROM delivery WHERE id = $1 AND webhook_id = $2")
        .bind(delivery.to_string())
        .bind(id.to_string())
        .fetch_optional(db)
        .await?;
    row.ok_or_else(|| DatabaseError::NotFound { kind: "delivery", id: delivery.to_string() })?.record()
}
