//! What every handler can reach.

use std::collections::HashSet;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

use axum::http::StatusCode;
use tokio::sync::{RwLock, Semaphore, watch};
use tokio_util::sync::CancellationToken;

use super::access::{Anonymous, Usage};
use super::base;
use super::body::Room;
use super::connections::Connections;
use super::describe::Turns;
use super::hosts::Hosts;
use super::metrics::Requests;
use super::outgoing::Dialer;
use super::pictures::Drawn;
use super::problem::{Code, Problem};
use super::uploads::Receivers;
use visage_domain::ReplayKey;
use visage_service::app::context::ServiceContext;
use visage_service::config::Limits;

/// The state of the service. Cheap to clone: each request does so several times.
#[derive(Clone)]
pub struct AppState(Arc<Shared>);

impl Deref for AppState {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}

/// What all requests share.
pub struct Shared {
    /// Database, files, gallery, engine and what runs now.
    pub context: ServiceContext,
    /// Bounds how many files are in memory to be checked.
    pub checks: Arc<Semaphore>,
    /// Bounds how many files are in memory to be written in another format.
    pub conversions: Arc<Semaphore>,
    /// Bounds how many models are described for requests at a time.
    pub describing: Turns,
    /// Bounds how many pictures are drawn at a time: they don't wait for what takes longer.
    pub drawing: Turns,
    /// The last pictures.
    pub drawn: Arc<Drawn>,
    /// What of requests may be in memory while they arrive.
    pub buffers: Arc<Semaphore>,
    /// By which names the service may be called.
    pub hosts: Hosts,
    /// Whether those without a key may do everything.
    pub anonymous: Anonymous,
    /// Requests, counted.
    pub requests: Arc<Requests>,
    /// How many connections there are.
    pub connections: watch::Receiver<Connections>,
    /// What each key has asked for.
    pub usage: Arc<Usage>,
    /// Held for a change; alone for one that depends on the state of what it changes.
    pub changes: Arc<RwLock<()>>,
    /// Who receives the pieces of which file.
    pub receivers: Arc<Receivers>,
    /// Fetches scans, if that is allowed.
    pub dialer: Option<Dialer>,
    /// Set when the server goes down.
    pub stop: CancellationToken,
    /// Requests with an idempotency key that are being worked on.
    in_progress: Arc<Mutex<HashSet<(&'static str, String)>>>,
}

impl AppState {
    /// The state of a service that has just started.
    pub fn new(
        context: ServiceContext,
        hosts: Hosts,
        connections: watch::Receiver<Connections>,
        stop: CancellationToken,
    ) -> Self {
        let limits = &context.config.limits;
        AppState(Arc::new(Shared {
            checks: Arc::new(Semaphore::new(limits.concurrent_checks.max(1))),
            conversions: Arc::new(Semaphore::new(limits.concurrent_conversions.max(1))),
            describing: Turns::new(limits.concurrent_describing),
            drawing: Turns::new(limits.concurrent_describing),
            drawn: Arc::default(),
            buffers: Room::budget(limits.buffered_bytes),
            anonymous: Anonymous::new(context.config.open, context.config.is_exposed()),
            requests: Arc::default(),
            connections,
            usage: Arc::default(),
            hosts,
            changes: Arc::default(),
            receivers: Arc::default(),
            dialer: (!context.config.fetch_from.is_empty()).then(Dialer::of_system),
            stop,
            in_progress: Arc::default(),
            context,
        }))
    }

    /// Bounds on requests.
    pub fn limits(&self) -> &Limits {
        &self.context.config.limits
    }

    /// Marks a request with an idempotency key as being worked on, until the answer is dropped.
    pub fn occupy(&self, route: &'static str, key: &str) -> Result<Occupied, Problem> {
        let entry = (route, key.to_owned());
        if !self.in_progress.lock().unwrap_or_else(PoisonError::into_inner).insert(entry.clone()) {
            let detail = "a request with the same idempotency key is being worked on";
            return Err(Problem::new(Code::RequestInProgress, detail, "repeat it in a moment").retry_after(1));
        }
        Ok(Occupied { state: self.clone(), entry })
    }
}

/// A request with an idempotency key that is being worked on.
pub struct Occupied {
    state: AppState,
    entry: (&'static str, String),
}

impl Occupied {
    /// The key with the hash of the body, once that is known.
    pub fn replay_key(&self, body_hash: String) -> ReplayKey {
        ReplayKey { route: self.entry.0, key: self.entry.1.clone(), body_hash }
    }
}

impl Drop for Occupied {
    fn drop(&mut self) {
        self.state.in_progress.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.entry);
    }
}

/// Runs blocking work on a thread for it; a panic there is an internal error of this request alone.
pub async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
    let span = tracing::Span::current();
    tokio::task::spawn_blocking(move || span.in_scope(work)).await.map_err(Problem::internal)
}

/// Runs work to its end even when the client goes away: what changes files and rows must not stop halfway.
pub async fn uninterrupted<T: Send + 'static>(
    work: impl Future<Output = Result<T, Problem>> + Send + 'static,
) -> Result<T, Problem> {
    use tracing::Instrument;
    tokio::spawn(base::carried(work).in_current_span()).await.map_err(Problem::internal)?
}

/// Runs a deletion to its end even when the client goes away, and answers that it is done.
pub async fn deleted(
    deleting: impl Future<Output = Result<(), Problem>> + Send + 'static,
) -> Result<StatusCode, Problem> {
    uninterrupted(deleting).await?;
    Ok(StatusCode::NO_CONTENT)
}
