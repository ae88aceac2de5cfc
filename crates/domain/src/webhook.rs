//! Webhooks: addresses that get messages, the kinds of events, and whether each message was delivered.

use jiff::Timestamp;
use visage_geometry::names::UnknownName;

use super::{DeliveryId, JobId, JobKind, JobStatus, KeyId, ModelId, WebhookId};

/// A kind of event.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    serde::Serialize,
    serde::Deserialize,
    utoipa::ToSchema,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
)]
#[strum(parse_err_ty = UnknownName, parse_err_fn = no_event)]
pub enum EventKind {
    /// A job has ended well.
    #[serde(rename = "job.succeeded")]
    #[strum(serialize = "job.succeeded")]
    JobSucceeded,
    /// A job has ended with an error.
    #[serde(rename = "job.failed")]
    #[strum(serialize = "job.failed")]
    JobFailed,
    /// A job was stopped on request.
    #[serde(rename = "job.canceled")]
    #[strum(serialize = "job.canceled")]
    JobCanceled,
    /// A model is in the gallery: uploaded, or made by a job.
    #[serde(rename = "model.added")]
    #[strum(serialize = "model.added")]
    ModelAdded,
    /// A model is not in the gallery any more.
    #[serde(rename = "model.deleted")]
    #[strum(serialize = "model.deleted")]
    ModelDeleted,
    /// Somebody tries whether a webhook works.
    #[serde(rename = "webhook.ping")]
    #[strum(serialize = "webhook.ping")]
    Ping,
}

impl EventKind {
    /// All of them.
    pub const ALL: &[EventKind] = <EventKind as strum::VariantArray>::VARIANTS;

    /// As it is written in bodies, tables and the API.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_event(text: &str) -> UnknownName {
    UnknownName::of::<EventKind>("kind of event", text)
}

/// Something that has happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A job has ended.
    JobEnded {
        /// Which job.
        id: JobId,
        /// What it was for.
        kind: JobKind,
        /// How it ended.
        status: JobStatus,
        /// The model that it has left.
        model: Option<ModelId>,
    },
    /// A model is in the gallery.
    ModelAdded(ModelId),
    /// A model is not in the gallery any more.
    ModelDeleted(ModelId),
    /// Somebody tries whether a webhook works.
    Ping(WebhookId),
}

/// The body of a message. It holds ids alone: whoever gets it asks for the rest, with a key.
#[derive(serde::Serialize)]
struct Message {
    r#type: &'static str,
    timestamp: String,
    data: Data,
}

#[derive(Default, serde::Serialize)]
struct Data {
    #[serde(skip_serializing_if = "Option::is_none")]
    webhook_id: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    job_id: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    kind: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    model_id: Option<String>,
}

impl Event {
    /// Its kind.
    pub fn kind(&self) -> EventKind {
        match self {
            Event::JobEnded { status: JobStatus::Succeeded, .. } => EventKind::JobSucceeded,
            Event::JobEnded { status: JobStatus::Canceled, .. } => EventKind::JobCanceled,
            Event::JobEnded { .. } => EventKind::JobFailed,
            Event::ModelAdded(_) => EventKind::ModelAdded,
            Event::ModelDeleted(_) => EventKind::ModelDeleted,
            Event::Ping(_) => EventKind::Ping,
        }
    }

    /// What is sent of it, as JSON; `at` is when it happened.
    pub fn body(&self, at: Timestamp) -> Result<String, serde_json::Error> {
        let model = |id: &ModelId| Data { model_id: Some(id.to_string()), ..Data::default() };
        let data = match self {
            Event::JobEnded { id, kind, model, .. } => Data {
                job_id: Some(id.to_string()),
                kind: Some(kind.name()),
                model_id: model.map(|id| id.to_string()),
                ..Data::default()
            },
            Event::ModelAdded(id) | Event::ModelDeleted(id) => model(id),
            Event::Ping(id) => Data { webhook_id: Some(id.to_string()), ..Data::default() },
        };
        serde_json::to_string(&Message { r#type: self.kind().name(), timestamp: at.to_string(), data })
    }
}

/// What messages of a webhook are signed with. It has to be kept as it is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct WebhookSecret(pub [u8; 32]);

/// Without the secret.
impl std::fmt::Debug for WebhookSecret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("WebhookSecret")
    }
}

/// A webhook that is to be stored.
#[derive(Debug, Clone)]
pub struct NewWebhook {
    /// Its id.
    pub id: WebhookId,
    /// The key that it goes with; `None` for who needed none.
    pub key: Option<KeyId>,
    /// What it is for, in the words of who made it.
    pub name: String,
    /// Where messages are sent.
    pub url: String,
    /// What is told.
    pub events: Vec<EventKind>,
    /// What messages are signed with.
    pub secret: WebhookSecret,
}

/// A webhook as it is shown: without its secret.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WebhookRecord {
    /// Its id.
    pub id: WebhookId,
    /// The key that it goes with.
    pub key: Option<KeyId>,
    /// What it is for.
    pub name: String,
    /// Where messages are sent.
    pub url: String,
    /// What is told.
    pub events: Vec<EventKind>,
    /// Messages that wait to be delivered.
    pub pending: u64,
    /// Messages that could not be delivered.
    pub dead: u64,
    /// Messages that were never queued, since too many waited.
    pub missed: u64,
}

/// Where a message stands.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    utoipa::ToSchema,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case", parse_err_ty = UnknownName, parse_err_fn = no_delivery_status)]
pub enum DeliveryStatus {
    /// It waits to be sent, or to be sent again.
    Pending,
    /// It was taken.
    Delivered,
    /// It was not taken however often it was sent.
    Dead,
}

impl DeliveryStatus {
    /// As it is written in tables and the API.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_delivery_status(text: &str) -> UnknownName {
    UnknownName::of::<DeliveryStatus>("status of a delivery", text)
}

/// A message to a webhook, and what came of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeliveryRecord {
    /// Its id: the receiver knows by it what it has had before.
    pub id: DeliveryId,
    /// The kind of event.
    pub event: EventKind,
    /// Where it stands.
    pub status: DeliveryStatus,
    /// How often it was sent.
    pub attempts: u32,
    /// When it is sent next, if it waits; else when it ended.
    pub at: Timestamp,
    /// The status of the last answer, if there was one.
    pub answer: Option<u16>,
    /// Why the last attempt failed.
    pub error: Option<String>,
}

/// A message that is being sent.
#[derive(Debug, Clone)]
pub struct DeliveryClaim {
    /// Its id.
    pub id: DeliveryId,
    /// Whose it is.
    pub webhook: WebhookId,
    /// Where it goes.
    pub url: String,
    /// What it is signed with.
    pub secret: WebhookSecret,
    /// What is sent.
    pub body: String,
    /// How often it was sent, with this time.
    pub attempts: u32,
}

/// What came of an attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attempt {
    /// Where the message stands now.
    pub status: DeliveryStatus,
    /// When it is sent next, if it waits; else now.
    pub at: Timestamp,
    /// The status of the answer.
    pub answer: Option<u16>,
    /// Why it failed.
    pub error: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_read_as_they_are_written_in_tables_and_in_json() {
        let schema = serde_json::to_value(<EventKind as utoipa::PartialSchema>::schema()).expect("plain data");
        assert_eq!(
            schema["enum"],
            serde_json::json!(EventKind::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>())
        );
        for &kind in EventKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
            assert_eq!(serde_json::to_string(&kind).expect("plain data"), format!("{:?}", kind.name()));
        }
        for &status in <DeliveryStatus as strum::VariantArray>::VARIANTS {
            assert_eq!(status.name().parse(), Ok(status));
        }
    }

    #[test]
    fn a_message_holds_ids_alone() {
        let (id, model) = (JobId::new(), ModelId::new());
        let ended = Event::JobEnded { id, kind: JobKind::Register, status: JobStatus::Succeeded, model: Some(model) };
        let body = ended.body(Timestamp::UNIX_EPOCH).expect("plain data");
        assert_eq!(
            body,
            format!(
                r#"{{"type":"job.succeeded","timestamp":"1970-01-01T00:00:00Z","data":{{"job_id":"{id}","kind":"register","model_id":"{model}"}}}}"#
            )
        );
    }
}
