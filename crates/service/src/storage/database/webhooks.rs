//! Webhooks and the messages to them.

use std::time::Duration;

use async_trait::async_trait;
use jiff::Timestamp;

use crate::storage::DatabaseError;
use visage_domain::{
    Attempt, DeliveryClaim, DeliveryId, DeliveryRecord, DeliveryStatus, NewWebhook, Page, PageRequest, WebhookId,
    WebhookRecord,
};

/// Webhooks and the messages to them. A message is queued in the transaction of what it tells, by whatever writes that,
/// for each webhook that wants its kind.
#[async_trait]
pub trait Webhooks {
    /// Stores a webhook; there may be so many. One whose key is revoked goes with it.
    async fn create_webhook(&self, webhook: &NewWebhook, limit: usize) -> Result<(), DatabaseError>;

    /// Webhooks, newest first.
    async fn webhooks(&self, page: &PageRequest) -> Result<Page<WebhookRecord>, DatabaseError>;

    /// One webhook.
    async fn webhook(&self, id: WebhookId) -> Result<WebhookRecord, DatabaseError>;

    /// Deletes a webhook with all messages to it.
    async fn delete_webhook(&self, id: WebhookId) -> Result<(), DatabaseError>;

    /// Queues a message that tells of nothing.
    async fn ping_webhook(&self, id: WebhookId) -> Result<DeliveryRecord, DatabaseError>;

    /// Messages to a webhook, newest first.
    async fn deliveries(
        &self,
        id: WebhookId,
        status: Option<DeliveryStatus>,
        page: &PageRequest,
    ) -> Result<Page<DeliveryRecord>, DatabaseError>;

    /// Queues a message that has ended once more, with all its attempts, under its id.
    async fn replay_delivery(&self, id: WebhookId, delivery: DeliveryId) -> Result<DeliveryRecord, DatabaseError>;

    /// The same for all dead messages to a webhook; answers with their number.
    async fn replay_dead(&self, id: WebhookId) -> Result<u64, DatabaseError>;

    /// When the next message is to be sent, of those to other webhooks than these.
    async fn next_delivery(&self, except: &[WebhookId]) -> Result<Option<Timestamp>, DatabaseError>;

    /// Takes the next message that is to be sent now. If nothing is said of it for as long as `lease`, it may be taken
    /// again.
    async fn claim_delivery(
        &self,
        except: &[WebhookId],
        lease: Duration,
    ) -> Result<Option<DeliveryClaim>, DatabaseError>;

    /// Writes what came of an attempt; nothing if somebody else has taken the message meanwhile.
    async fn end_attempt(&self, claim: &DeliveryClaim, attempt: &Attempt) -> Result<(), DatabaseError>;

    /// Forgets what was delivered and what is dead since before these times, and webhooks whose key has expired.
    async fn forget_deliveries(&self, delivered: Timestamp, dead: Timestamp) -> Result<(), DatabaseError>;
}
