//! Sends what waits: one message at a time to each webhook, all webhooks beside each other, and again where that failed.
//!
//! A message is taken for a while (its lease), sent, and then what came of it is written. A process that ends in between
//! leaves a message that is sent once more, under the same id: receivers may get it twice, and never not at all.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use tokio::task::{Id, JoinSet};

use super::courier::{Courier, Letter};
use super::{signature, with_jitter};
use crate::app::context::ServiceContext;
use crate::app::monitor::JobMonitor;
use crate::config::{NoAddress, ServerConfig};
use crate::storage::{Database, DatabaseError};
use visage_domain::{Attempt, DeliveryClaim, DeliveryStatus, WebhookId};

/// How often it is looked for messages that nobody announced.
const LOOK: Duration = Duration::from_secs(5);
/// The least time between two looks.
const PACE: Duration = Duration::from_millis(50);
/// How much longer than an attempt may take nobody else takes its message.
const MARGIN: Duration = Duration::from_secs(15);
/// A receiver that answers so wants no more of it.
const GONE: u16 = 410;

/// Sends until it is dropped.
pub async fn run(context: &ServiceContext, courier: Arc<dyn Courier>) {
    let mut bell = context.monitor.status_changes();
    let sender = Sender {
        database: context.database.clone(),
        monitor: context.monitor.clone(),
        config: context.config.clone(),
        courier,
    };
    let (mut sending, mut busy) = (JoinSet::new(), HashMap::new());
    loop {
        // what changes from now on rings again
        bell.mark_unchanged();
        let pause = sender.take_up(&mut sending, &mut busy).await.unwrap_or_else(|error| {
            tracing::warn!("looking for messages to webhooks: {error}");
            LOOK
        });
        let news = async {
            tokio::time::sleep(PACE).await;
            // the monitor is held by the sender
            let _ = tokio::time::timeout(pause, bell.changed()).await;
        };
        tokio::select! {
            () = news => {}
            Some(ended) = sending.join_next_with_id() => {
                let id = match ended {
                    Ok((id, ())) => id,
                    Err(error) => {
                        tracing::error!("a message to a webhook was given up: {error}");
                        error.id()
                    }
                };
                busy.remove(&id);
            }
        }
    }
}

#[derive(Clone)]
struct Sender {
    database: Arc<dyn Database>,
    monitor: Arc<JobMonitor>,
    config: Arc<ServerConfig>,
    courier: Arc<dyn Courier>,
}

impl Sender {
    /// Begins to send what is due; answers with how long nothing else will be.
    async fn take_up(
        &self,
        sending: &mut JoinSet<()>,
        busy: &mut HashMap<Id, WebhookId>,
    ) -> Result<Duration, DatabaseError> {
        let lease = self.config.webhooks.patience + MARGIN;
        loop {
            let except: Vec<WebhookId> = busy.values().copied().collect();
            // looking takes no lock
            let Some(next) = self.database.next_delivery(&except).await? else { return Ok(LOOK) };
            let wait = Duration::try_from(next.duration_since(Timestamp::now())).unwrap_or_default();
            if !wait.is_zero() {
                return Ok(wait.min(LOOK));
            }
            let Some(claim) = self.database.claim_delivery(&except, lease).await? else { return Ok(PACE) };
            let (sender, webhook) = (self.clone(), claim.webhook);
            let task = sending.spawn(async move { sender.attempt(claim).await });
            busy.insert(task.id(), webhook);
        }
    }

    async fn attempt(&self, claim: DeliveryClaim) {
        let answer = self.send(&claim).await;
        let attempt = self.judged(&claim, answer);
        let end = match attempt.status {
            DeliveryStatus::Pending => "failed",
            ended => ended.name(),
        };
        self.monitor.figures.message_sent(end);
        if let Some(error) = &attempt.error {
            tracing::warn!(webhook.id = %claim.webhook, delivery.id = %claim.id, attempt = claim.attempts,
                           "a message to a webhook was not taken: {error}");
        }
        if let Err(error) = self.database.end_attempt(&claim, &attempt).await {
            tracing::warn!(delivery.id = %claim.id, "what came of a message is not stored, it is sent again: {error}");
        }
        self.monitor.announce_change();
    }

    async fn send(&self, claim: &DeliveryClaim) -> Result<u16, String> {
        let address = claim.url.parse().map_err(|error: NoAddress| error.to_string())?;
        let (id, seconds) = (claim.id.to_string(), Timestamp::now().as_second());
        let signature = signature::signature(&claim.secret, &id, seconds, &claim.body);
        let headers =
            [("webhook-id", id), ("webhook-timestamp", seconds.to_string()), ("webhook-signature", signature)];
        let letter = Letter { address, headers, body: claim.body.clone() };
        self.courier.deliver(&letter).await.map_err(|error| error.to_string())
    }

    /// What an answer means: whether the message is delivered, is sent once more and when, or is dead.
    fn judged(&self, claim: &DeliveryClaim, answer: Result<u16, String>) -> Attempt {
        let now = Timestamp::now();
        let ended = |status, answer, error| Attempt { status, at: now, answer, error };
        let (answer, error) = match answer {
            Ok(taken @ 200..=299) => return ended(DeliveryStatus::Delivered, Some(taken), None),
            Ok(GONE) => {
                let error = "it answered 410: it wants no more of it".to_owned();
                return ended(DeliveryStatus::Dead, Some(GONE), Some(error));
            }
            Ok(moved @ 300..=399) => (Some(moved), format!("it answered {moved}: redirects are not followed")),
            Ok(other) => (Some(other), format!("it answered {other}")),
            Err(error) => (None, error),
        };
        // the first attempt is number one
        let sent = usize::try_from(claim.attempts).unwrap_or(usize::MAX);
        let Some(pause) = self.config.webhooks.pauses.get(sent.saturating_sub(1)) else {
            return ended(DeliveryStatus::Dead, answer, Some(error));
        };
        let pause = SignedDuration::try_from(with_jitter(*pause)).unwrap_or_default();
        let at = now.saturating_add(pause).unwrap_or(now);
        Attempt { status: DeliveryStatus::Pending, at, answer, error: Some(error) }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use async_trait::async_trait;
    use tokio::sync::mpsc;

    use super::super::{Unreached, create};
    use super::*;
    use crate::app::context::testing::context;
    use crate::config::WebhookSettings;
    use crate::storage::DatabaseError;
    use visage_domain::{DeliveryRecord, EventKind, NewModel, PageRequest};

    type Answer = Result<u16, Unreached>;

    /// Gives the answers that it was told, in their order, and shows what it was to carry.
    struct Scripted {
        answers: Mutex<Vec<Answer>>,
        seen: mpsc::UnboundedSender<Letter>,
    }

    #[async_trait]
    impl Courier for Scripted {
        async fn deliver(&self, letter: &Letter) -> Answer {
            self.seen.send(letter.clone()).expect("the test listens");
            let next = self.answers.lock().expect("never poisoned").pop();
            match next {
                Some(answer) => answer,
                // a receiver that hangs
                None => std::future::pending().await,
            }
        }
    }

    fn scripted(answers: &[Answer]) -> (Arc<Scripted>, mpsc::UnboundedReceiver<Letter>) {
        let (seen, letters) = mpsc::unbounded_channel();
        let answers = Mutex::new(answers.iter().rev().cloned().collect());
        (Arc::new(Scripted { answers, seen }), letters)
    }

    async fn with_pauses(pauses: Vec<Duration>) -> (ServiceContext, impl Sized) {
        let (context, place) = context().await;
        let webhooks = WebhookSettings { pauses, ..WebhookSettings::default() };
        let config = ServerConfig { webhooks, ..context.config.as_ref().clone() };
        (ServiceContext { config: Arc::new(config), ..context }, place)
    }

    async fn hook(context: &ServiceContext, events: &[EventKind]) -> WebhookId {
        let address = "https://a.example/hook".parse().expect("an address");
        let made = create(context.database.as_ref(), None, "h".into(), &address, events.to_vec()).await;
        made.expect("made").0
    }

    async fn deliveries(context: &ServiceContext, id: WebhookId) -> Vec<DeliveryRecord> {
        let page = PageRequest { before: None, limit: 100 };
        context.database.deliveries(id, None, &page).await.expect("listed").items
    }

    /// Runs the sender until the deliveries are so.
    async fn until(
        context: &ServiceContext,
        courier: Arc<Scripted>,
        id: WebhookId,
        wanted: impl Fn(&[DeliveryRecord]) -> bool,
    ) -> Vec<DeliveryRecord> {
        let looked = async {
            loop {
                let found = deliveries(context, id).await;
                if wanted(&found) {
                    return found;
                }
                tokio::task::yield_now().await;
            }
        };
        tokio::select! {
            () = run(context, courier) => unreachable!("it runs for ever"),
            found = looked => found,
        }
    }

    async fn model(context: &ServiceContext) -> visage_domain::ModelId {
        let model = NewModel::example(None);
        drop(context.database.create_model(&model, None).await.expect("stored"));
        model.id
    }

    fn failed() -> Answer {
        Err(Unreached::TimedOut)
    }

    #[tokio::test]
    async fn a_message_is_sent_again_until_it_is_taken_under_one_id() {
        let (context, _place) = with_pauses(vec![Duration::ZERO; 3]).await;
        let id = hook(&context, &[EventKind::ModelAdded]).await;
        let model = model(&context).await;
        let (courier, mut letters) = scripted(&[failed(), Ok(302), Ok(204)]);
        let found = until(&context, courier, id, |all| all[0].status == DeliveryStatus::Delivered).await;
        assert_eq!((found.len(), found[0].attempts, found[0].answer), (1, 3, Some(204)));
        let sent: Vec<Letter> = std::iter::from_fn(|| letters.try_recv().ok()).collect();
        assert_eq!(sent.len(), 3);
        for letter in &sent {
            assert_eq!((&letter.headers[0].1, &letter.body), (&found[0].id.to_string(), &sent[0].body));
            assert!(letter.body.contains(&model.to_string()) && letter.headers[2].1.starts_with("v1,"));
        }
    }

    #[tokio::test]
    async fn what_is_never_taken_is_dead_until_it_is_replayed() {
        let (context, _place) = with_pauses(vec![Duration::ZERO]).await;
        let id = hook(&context, &[EventKind::ModelAdded]).await;
        model(&context).await;
        let (courier, _letters) = scripted(&[Ok(500), Ok(503)]);
        let found = until(&context, courier, id, |all| all[0].status == DeliveryStatus::Dead).await;
        assert_eq!((found[0].attempts, found[0].error.as_deref()), (2, Some("it answered 503")));
        assert_eq!(context.database.webhook(id).await.expect("there").dead, 1);
        assert_eq!(context.database.replay_dead(id).await.expect("replayed"), 1);
        let again = context.database.replay_delivery(id, found[0].id).await;
        assert!(matches!(again, Err(DatabaseError::StillPending { .. })));
        let (courier, _letters) = scripted(&[Ok(200)]);
        until(&context, courier, id, |all| all[0].status == DeliveryStatus::Delivered).await;
    }

    #[tokio::test]
    async fn who_answers_410_is_asked_once() {
        let (context, _place) = with_pauses(vec![Duration::ZERO; 3]).await;
        let id = hook(&context, &[EventKind::ModelAdded]).await;
        model(&context).await;
        let (courier, _letters) = scripted(&[Ok(410)]);
        let found = until(&context, courier, id, |all| all[0].status == DeliveryStatus::Dead).await;
        assert_eq!(found[0].attempts, 1);
    }

    #[tokio::test]
    async fn a_receiver_that_hangs_holds_up_no_other() {
        let (context, _place) = with_pauses(vec![]).await;
        let hangs = hook(&context, &[EventKind::ModelAdded]).await;
        model(&context).await;
        let (courier, mut letters) = scripted(&[]);
        let sender = tokio::spawn({
            let (context, courier) = (context.clone(), courier.clone());
            async move { run(&context, courier).await }
        });
        letters.recv().await.expect("the first is being sent");
        let other = hook(&context, &[EventKind::ModelDeleted]).await;
        courier.answers.lock().expect("never poisoned").push(Ok(200));
        let gone = model(&context).await;
        drop(context.database.delete_model(gone).await.expect("deleted"));
        context.monitor.announce_change();
        let letter = letters.recv().await.expect("the other is sent");
        assert!(letter.body.contains("model.deleted"), "{}", letter.body);
        sender.abort();
        let _ = sender.await;
        // what was being sent when the process ended is not lost
        assert!(deliveries(&context, hangs).await.iter().all(|one| one.status == DeliveryStatus::Pending));
        assert_eq!(deliveries(&context, other).await.len(), 1);
    }

    #[test]
    fn a_pause_gets_up_to_a_fifth_longer() {
        let pauses: Vec<Duration> = (0..100).map(|_| with_jitter(Duration::from_secs(10))).collect();
        assert!(pauses.iter().all(|pause| (10.0..=12.0).contains(&pause.as_secs_f64())));
        assert!(pauses.iter().any(|pause| *pause != pauses[0]));
    }
}
