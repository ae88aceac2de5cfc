//! Webhooks: signed messages to registered addresses when a job ends and when a model is added or deleted.
//!
//! Storage queues a message in the transaction of what it is about; here it is sent.
//! - `signature`: how a message shows that it is from here (Standard Webhooks)
//! - `sender`: sends what waits, again where it has to
//! - `courier`: the seam to the network

mod courier;
mod sender;
mod signature;

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::access::NoRandomness;
use crate::config::Address;
use crate::storage::{Database, DatabaseError};
use visage_domain::{EventKind, KeyId, NewWebhook, WebhookId, WebhookSecret};

pub use courier::{Courier, Letter, Unreached};
pub use sender::run;
pub use signature::written as written_secret;

/// Webhooks that are kept at a time. Each is served by itself, so one that hangs holds up no other.
pub const MOST_WEBHOOKS: usize = 32;
/// How long it is kept what was delivered.
const KEEP_DELIVERED: SignedDuration = SignedDuration::from_hours(24 * 7);
/// How long it is kept what could not be delivered.
const KEEP_DEAD: SignedDuration = SignedDuration::from_hours(24 * 30);

/// Why a webhook could not be made.
#[derive(Debug, thiserror::Error)]
pub enum WebhookError {
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The system.
    #[error(transparent)]
    Randomness(#[from] NoRandomness),
}

/// Makes a webhook of a key; its secret is told this once.
pub async fn create(
    database: &dyn Database,
    key: Option<KeyId>,
    name: String,
    address: &Address,
    events: Vec<EventKind>,
) -> Result<(WebhookId, WebhookSecret), WebhookError> {
    let mut secret = [0; 32];
    getrandom::fill(&mut secret).map_err(NoRandomness::from)?;
    let (id, secret) = (WebhookId::new(), WebhookSecret(secret));
    let webhook = NewWebhook { id, key, name, url: address.to_string(), events, secret };
    database.create_webhook(&webhook, MOST_WEBHOOKS).await?;
    Ok((id, secret))
}

/// Forgets messages that ended long ago, and webhooks whose key has expired.
pub async fn clean_up(database: &dyn Database, now: Timestamp) -> Result<(), DatabaseError> {
    let before = |kept| now.saturating_sub(kept).unwrap_or(now);
    database.forget_deliveries(before(KEEP_DELIVERED), before(KEEP_DEAD)).await
}

/// A pause and up to a fifth more: receivers that come back are not asked by everybody at once.
fn with_jitter(pause: Duration) -> Duration {
    let random = getrandom::u32().unwrap_or(0);
    pause + pause.mul_f64(0.2 * f64::from(random) / f64::from(u32::MAX))
}
