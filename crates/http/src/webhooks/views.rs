//! Webhooks and the messages to them, as they go over the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::base::link;
use crate::schemas::ShortText;
use visage_domain::{DeliveryRecord, DeliveryStatus, EventKind, WebhookRecord};

/// A webhook that is to be made.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewWebhookBody {
    /// What it is for.
    #[schema(value_type = ShortText)]
    pub name: String,
    /// Where messages are sent: `https://` to a public address, or also `http://` to a network that the operator allows.
    #[schema(max_length = 2000, example = "https://app.example/hooks/visage")]
    pub url: String,
    /// What is told.
    #[schema(min_items = 1)]
    pub events: Vec<EventKind>,
}

/// A webhook.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Webhook)]
pub struct WebhookView {
    /// Its id.
    #[schema(format = "uuid")]
    id: String,
    /// What it is for.
    name: String,
    /// Where messages are sent.
    url: String,
    /// What is told.
    events: Vec<EventKind>,
    /// The key that has made it: when that is revoked, or expires, the webhook is deleted. Null for who needed none.
    #[schema(format = "uuid")]
    key_id: Option<String>,
    /// When it was made (UTC, RFC 3339).
    created_at: String,
    /// Messages that wait to be delivered.
    pending: u64,
    /// Messages that could not be delivered.
    dead: u64,
    /// Messages that were never queued, since too many waited.
    missed: u64,
    /// Its address.
    href: String,
}

impl WebhookView {
    /// As it is stored.
    pub fn of(webhook: WebhookRecord) -> WebhookView {
        WebhookView {
            id: webhook.id.to_string(),
            name: webhook.name,
            url: webhook.url,
            events: webhook.events,
            key_id: webhook.key.map(|key| key.to_string()),
            created_at: webhook.id.created_at().to_string(),
            pending: webhook.pending,
            dead: webhook.dead,
            missed: webhook.missed,
            href: link(&format!("/v1/webhooks/{}", webhook.id)),
        }
    }
}

impl WebhookView {
    /// Its address.
    pub fn href(&self) -> &str {
        &self.href
    }
}

/// A webhook that was just made.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct NewWebhookView {
    /// The webhook.
    #[serde(flatten)]
    pub webhook: WebhookView,
    /// What its messages are signed with (Standard Webhooks). It is told this once.
    pub secret: String,
}

/// Webhooks, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct WebhookList {
    /// The webhooks.
    pub items: Vec<WebhookView>,
    /// Where the next page begins; null on the last one.
    pub next_cursor: Option<String>,
}

/// A message to a webhook, and what came of it.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Delivery)]
pub struct DeliveryView {
    /// Its id, which it has as `webhook-id` however often it is sent.
    #[schema(format = "uuid")]
    id: String,
    /// The kind of event.
    event: EventKind,
    /// Where it stands.
    status: DeliveryStatus,
    /// When it happened (UTC, RFC 3339).
    created_at: String,
    /// How often it was sent.
    attempts: u32,
    /// When it is sent next; null if it has ended.
    next_attempt_at: Option<String>,
    /// When it was taken or given up; null if it waits.
    ended_at: Option<String>,
    /// The status of the last answer; null if there was none.
    answer: Option<u16>,
    /// Why the last attempt failed.
    error: Option<String>,
}

impl DeliveryView {
    /// As it is stored.
    pub fn of(delivery: DeliveryRecord) -> DeliveryView {
        let at = Some(delivery.at.to_string());
        let (next_attempt_at, ended_at) =
            if delivery.status == DeliveryStatus::Pending { (at, None) } else { (None, at) };
        DeliveryView {
            id: delivery.id.to_string(),
            event: delivery.event,
            status: delivery.status,
            created_at: delivery.id.created_at().to_string(),
            attempts: delivery.attempts,
            next_attempt_at,
            ended_at,
            answer: delivery.answer,
            error: delivery.error,
        }
    }
}

/// Messages to a webhook, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct DeliveryList {
    /// The messages.
    pub items: Vec<DeliveryView>,
    /// Where the next page begins; null on the last one.
    pub next_cursor: Option<String>,
}

/// How many messages are sent once more.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ReplayedView {
    /// Their number.
    pub replayed: u64,
}
