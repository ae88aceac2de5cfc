//! Connections: how many there are, and how long a client may keep one without using it.
//!
//! Each takes a place before it is accepted; whoever finds none waits in the system's queue. A place comes free after a
//! stated time at the latest when its client does nothing.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tokio_io_timeout::TimeoutStream;
use tokio_util::sync::CancellationToken;
use tower::ServiceBuilder;

use super::forwarded::Peer;
use super::tls::Tls;
use visage_service::config::EdgeLimits;

/// The most bytes of a request's head.
const HEAD_BYTES: usize = 32 << 10;
/// The most that is kept of what has arrived on a connection and was not read yet.
const BUFFER_BYTES: usize = 64 << 10;
/// How long nothing is accepted after the system could not.
const PAUSE: Duration = Duration::from_millis(200);
/// Descriptors of the process that no connection takes: database, logs, files of jobs.
const DESCRIPTORS_KEPT: u64 = 128;
/// Descriptors of a connection: itself, and the file that it sends or receives.
const DESCRIPTORS_EACH: u64 = 2;

/// How many connections there are, and were.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Connections {
    /// Those that there are.
    pub open: usize,
    /// All that were accepted so far.
    pub accepted: u64,
}

/// The connections that there can be: those that are wished for, or as many as the descriptors of the process allow.
pub fn most(wished: usize) -> usize {
    let Some(descriptors) = descriptors() else { return wished.max(1) };
    let most = descriptors.saturating_sub(DESCRIPTORS_KEPT) / DESCRIPTORS_EACH;
    let most = usize::try_from(most).unwrap_or(usize::MAX).max(1);
    if wished > most {
        tracing::warn!("{descriptors} descriptors are enough for {most} of {wished} connections: raise ulimit -n");
    }
    wished.clamp(1, most)
}

#[cfg(unix)]
fn descriptors() -> Option<u64> {
    use nix::sys::resource::{Resource, getrlimit};
    getrlimit(Resource::RLIMIT_NOFILE).ok().map(|(soft, _)| soft)
}

#[cfg(not(unix))]
fn descriptors() -> Option<u64> {
    None
}

/// Serves until `stop`, then until all that was begun has been answered. When this is dropped, connections are cut.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: EdgeLimits,
    stop: CancellationToken,
    count: watch::Sender<Connections>,
    tls: Option<Tls>,
) {
    let places = Arc::new(Semaphore::new(limits.connections.max(1)));
    let mut door = Door { listener, places, full: false, failing: false };
    let mut open = JoinSet::new();
    loop {
        tokio::select! {
            accepted = door.next() => {
                open.spawn(connection(accepted, router.clone(), limits, stop.clone(), tls.clone()));
                count.send_modify(|count| *count = Connections { open: open.len(), accepted: count.accepted + 1 });
            }
            Some(_) = open.join_next() => count.send_modify(|count| count.open = open.len()),
            () = stop.cancelled() => break,
        }
    }
    drop(door);
    while open.join_next().await.is_some() {
        count.send_modify(|count| count.open = open.len());
    }
}

/// Where connections come in.
struct Door {
    listener: TcpListener,
    places: Arc<Semaphore>,
    /// Whether the log has been told that all places are taken.
    full: bool,
    /// Whether the log has been told that the system accepts none.
    failing: bool,
}

impl Door {
    /// The next connection, with its place.
    async fn next(&mut self) -> (TcpStream, OwnedSemaphorePermit) {
        loop {
            let place = self.place().await;
            match self.listener.accept().await {
                Ok((stream, _)) => {
                    self.failing = false;
                    return (stream, place);
                }
                Err(error) if is_of_the_client(&error) => {}
                Err(error) => {
                    // out of descriptors or memory: what is there already goes on, and sets some free
                    if !std::mem::replace(&mut self.failing, true) {
                        tracing::error!("connections can't be accepted: {error}");
                    }
                    tokio::time::sleep(PAUSE).await;
                }
            }
        }
    }

    async fn place(&mut self) -> OwnedSemaphorePermit {
        if let Ok(place) = self.places.clone().try_acquire_owned() {
            self.full = false;
            return place;
        }
        if !std::mem::replace(&mut self.full, true) {
            tracing::warn!("all connections are taken: others wait");
        }
        match self.places.clone().acquire_owned().await {
            Ok(place) => place,
            // never closed
            Err(_) => std::future::pending().await,
        }
    }
}

fn is_of_the_client(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionRefused | ConnectionAborted | ConnectionReset)
}

async fn connection(
    (stream, place): (TcpStream, OwnedSemaphorePermit),
    router: Router,
    limits: EdgeLimits,
    stop: CancellationToken,
    tls: Option<Tls>,
) {
    let _place = place;
    // an answer of several pieces must not wait for the acknowledgement of the first
    let _ = stream.set_nodelay(true);
    let address = stream.peer_addr().map(|addr| addr.ip());
    let peer = address.ok().map(|address| Peer { address, is_secure: tls.is_some() });
    let Some(tls) = tls else { return answer(stream, peer, router, limits, stop).await };
    // hands are shaken before the head of a request, and may take as long
    match tokio::time::timeout(limits.head_time, tls.accept(stream)).await {
        Ok(Ok(stream)) => answer(stream, peer, router, limits, stop).await,
        Ok(Err(error)) => tracing::debug!("a connection ended before there was TLS: {error}"),
        Err(_) => tracing::debug!("a connection ended since there was no TLS in time"),
    }
}

/// Answers what comes on a connection until its end.
async fn answer(
    stream: impl AsyncRead + AsyncWrite + Send + 'static,
    peer: Option<Peer>,
    router: Router,
    limits: EdgeLimits,
    stop: CancellationToken,
) {
    let from = move |mut request: hyper::Request<hyper::body::Incoming>| {
        if let Some(peer) = peer {
            request.extensions_mut().insert(peer);
        }
        request
    };
    let service = ServiceBuilder::new().map_request(from).service(router);
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(limits.answer_stall));
    let mut serving = std::pin::pin!(
        http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(limits.head_time)
            .max_header_size(HEAD_BYTES)
            .max_buf_size(BUFFER_BYTES)
            .serve_connection(TokioIo::new(Box::pin(stream)), TowerToHyperService::new(service))
    );
    let served = tokio::select! {
        served = serving.as_mut() => served,
        () = stop.cancelled() => {
            serving.as_mut().graceful_shutdown();
            serving.await
        }
    };
    if let Err(error) = served {
        tracing::debug!("a connection ended: {error}");
    }
}
