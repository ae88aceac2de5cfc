//! Bodies of requests, at the client's pace but not slower than is allowed, and not more of them in memory than is
//! allowed.
//!
//! What counts is the time in which the server waits for the client, not the time in which it does other things.

use std::error::Error;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, HttpBody};
use axum::extract::{Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::Response;
use bytes::Bytes;
use futures_util::StreamExt;
use http_body_util::BodyExt;
use hyper::body::{Frame, SizeHint};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep};

use super::problem::{Code, Problem};
use super::state::AppState;
use visage_service::config::EdgeLimits;

/// How much of a refused body is still read: a client that is cut off in the middle of sending often does not see the
/// answer.
const DRAIN_BYTES: u64 = 64 << 20;
/// For how long.
const DRAIN_TIME: Duration = Duration::from_secs(5);
/// What the budget of buffers is counted in.
const UNIT: usize = 1 << 10;

/// A body that comes too slowly.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Late {
    /// It came to a standstill.
    #[error("nothing arrived for {:.1} s", .0.as_secs_f64())]
    Silent(Duration),
    /// It trickles.
    #[error("{received} bytes arrived in {:.1} s of waiting, less than {rate} a second", .waited.as_secs_f64())]
    Slow {
        /// What arrived.
        received: u64,
        /// How long the server waited for it in all.
        waited: Duration,
        /// The least rate.
        rate: u64,
    },
}

/// A body whose client is waited for only so long. Clones share it.
#[derive(Clone)]
struct Paced(Arc<Mutex<Inner>>);

struct Inner {
    body: Body,
    limits: EdgeLimits,
    received: u64,
    /// The time that went by in waits that are over.
    waited: Duration,
    wait: Option<(Instant, Pin<Box<Sleep>>)>,
    /// Whether anybody has asked for it.
    touched: bool,
    /// Whether nothing more will come.
    over: bool,
}

impl Inner {
    /// How long may be waited from now on.
    fn patience(&self) -> Duration {
        let earned = Duration::from_secs_f64(self.received as f64 / self.limits.body_rate.max(1) as f64);
        (self.limits.body_time + earned).saturating_sub(self.waited).min(self.limits.body_stall)
    }

    fn late(&self, silence: Duration) -> Late {
        if silence >= self.limits.body_stall || self.received == 0 {
            return Late::Silent(silence);
        }
        Late::Slow { received: self.received, waited: self.waited + silence, rate: self.limits.body_rate }
    }
}

impl Paced {
    fn new(body: Body, limits: EdgeLimits) -> Paced {
        let over = body.is_end_stream();
        let inner = Inner { body, limits, received: 0, waited: Duration::ZERO, wait: None, touched: false, over };
        Paced(Arc::new(Mutex::new(inner)))
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads on for a while, so that the client gets to the answer.
    async fn drain(mut self) {
        let reading = async {
            let mut read = 0;
            while let Some(Ok(frame)) = self.frame().await {
                read += frame.data_ref().map_or(0, |data| data.len() as u64);
                if read > DRAIN_BYTES {
                    break;
                }
            }
        };
        // whoever is not done by then has to be cut off
        let _ = tokio::time::timeout(DRAIN_TIME, reading).await;
    }
}

impl HttpBody for Paced {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let mut guard = self.lock();
        let inner = &mut *guard;
        inner.touched = true;
        if let Poll::Ready(frame) = Pin::new(&mut inner.body).poll_frame(context) {
            if let Some((begin, _)) = inner.wait.take() {
                inner.waited += begin.elapsed();
            }
            match &frame {
                Some(Ok(frame)) => inner.received += frame.data_ref().map_or(0, |data| data.len() as u64),
                Some(Err(_)) | None => inner.over = true,
            }
            return Poll::Ready(frame);
        }
        let patience = inner.patience();
        let (begin, timer) = inner.wait.get_or_insert_with(|| (Instant::now(), Box::pin(tokio::time::sleep(patience))));
        ready!(timer.as_mut().poll(context));
        let silence = begin.elapsed();
        inner.over = true;
        Poll::Ready(Some(Err(axum::Error::new(inner.late(silence)))))
    }

    fn is_end_stream(&self) -> bool {
        let inner = self.lock();
        inner.over || inner.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.lock().body.size_hint()
    }
}

/// Gives each request a body that is waited for only so long, and reads on a little when a request was refused before
/// all of it had arrived.
pub async fn paced(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let (parts, body) = request.into_parts();
    // whoever asks first has sent nothing yet, and must not be told to go on
    let asks_first = parts.headers.contains_key(header::EXPECT);
    let body = Paced::new(body, state.context.config.edge);
    let response = next.run(Request::from_parts(parts, Body::new(body.clone()))).await;
    let unread = {
        let inner = body.lock();
        !inner.over && (inner.touched || !asks_first)
    };
    if unread && (response.status().is_client_error() || response.status().is_server_error()) {
        body.drain().await;
    }
    response
}

/// A body of somebody else than a client who is waited for as long.
pub fn at_least_so_fast(body: Body, limits: EdgeLimits) -> Body {
    Body::new(Paced::new(body, limits))
}

/// What is wrong with a body that ended before its time.
pub fn broken(what: &str, error: &(dyn Error + 'static)) -> Problem {
    match cause::<Late>(error) {
        Some(late) => late_problem(late),
        None => {
            let detail = format!("{what} can't be read to its end: {}", deepest(error));
            Problem::new(Code::MalformedRequest, detail, "send the request again, whole")
        }
    }
}

fn late_problem(late: &Late) -> Problem {
    let hint = "send the request again, quicker; scans can be sent one by one with PUT; GET /v1/info states the limits";
    Problem::new(Code::UploadStalled, late.to_string(), hint)
}

/// The error of this kind among the causes of another.
pub fn cause<'a, E: Error + 'static>(error: &'a (dyn Error + 'static)) -> Option<&'a E> {
    chain(error).find_map(|error| error.downcast_ref())
}

fn deepest<'a>(error: &'a (dyn Error + 'static)) -> &'a (dyn Error + 'static) {
    chain(error).last().unwrap_or(error)
}

fn chain<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |error: &&'a (dyn Error + 'static)| Error::source(*error))
}

/// Room for what of a request has to be in memory while it arrives, out of a budget that all requests share.
pub struct Room {
    budget: Arc<Semaphore>,
    taken: Option<OwnedSemaphorePermit>,
    bytes: usize,
}

impl Room {
    /// None yet.
    pub fn new(state: &AppState) -> Room {
        Room { budget: state.buffers.clone(), taken: None, bytes: 0 }
    }

    /// A budget of so many bytes.
    pub fn budget(bytes: usize) -> Arc<Semaphore> {
        Arc::new(Semaphore::new((bytes / UNIT).min(Semaphore::MAX_PERMITS)))
    }

    /// Makes room for so many more bytes.
    pub fn take(&mut self, bytes: usize) -> Result<(), Problem> {
        self.bytes += bytes;
        let held = self.taken.as_ref().map_or(0, OwnedSemaphorePermit::num_permits);
        let missing = u32::try_from(self.bytes.div_ceil(UNIT).saturating_sub(held)).unwrap_or(u32::MAX);
        if missing == 0 {
            return Ok(());
        }
        let more = self.budget.clone().try_acquire_many_owned(missing).map_err(|_| {
            let detail = "too many requests are being received at the same time";
            Problem::new(Code::Overloaded, detail, "send the request again in a moment").retry_after(1)
        })?;
        match &mut self.taken {
            Some(taken) => taken.merge(more),
            None => self.taken = Some(more),
        }
        Ok(())
    }
}

/// The whole body, if it is not larger than `limit`.
pub async fn read_body(state: &AppState, request: Request, limit: usize) -> Result<Bytes, Problem> {
    let mut room = Room::new(state);
    let mut content = Vec::new();
    let mut body = request.into_body().into_data_stream();
    while let Some(chunk) = body.next().await {
        let chunk = chunk.map_err(|error| broken("the body", &error))?;
        if content.len() + chunk.len() > limit {
            let detail = format!("this body may have at most {limit} bytes");
            return Err(Problem::new(Code::TooLarge, detail, "send less; GET /v1/info states the limits"));
        }
        room.take(chunk.len())?;
        content.extend_from_slice(&chunk);
    }
    Ok(content.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(time: u64, rate: u64, stall: u64) -> EdgeLimits {
        EdgeLimits {
            body_time: Duration::from_secs(time),
            body_rate: rate,
            body_stall: Duration::from_secs(stall),
            ..EdgeLimits::default()
        }
    }

    #[test]
    fn patience_is_earned_by_bytes_and_used_up_by_waiting() {
        let body = Paced::new(Body::from("x"), limits(10, 1000, 60));
        let mut inner = body.lock();
        assert_eq!(inner.patience(), Duration::from_secs(10));
        inner.received = 30_000;
        assert_eq!(inner.patience(), Duration::from_secs(40));
        inner.waited = Duration::from_secs(35);
        assert_eq!(inner.patience(), Duration::from_secs(5));
        inner.waited = Duration::from_secs(50);
        assert_eq!(inner.patience(), Duration::ZERO);
        inner.received = u64::MAX;
        assert_eq!(inner.patience(), Duration::from_secs(60), "however quick it was, it must not stop for long");
    }

    #[test]
    fn room_is_shared_and_given_back() {
        let budget = Room::budget(10 * UNIT);
        let room = || Room { budget: budget.clone(), taken: None, bytes: 0 };
        let (mut first, mut second) = (room(), room());
        for _ in 0..9 * UNIT {
            first.take(1).expect("room for single bytes");
        }
        second.take(UNIT).expect("the rest");
        assert_eq!(second.take(1).expect_err("nothing is left").code(), Code::Overloaded);
        drop(first);
        second.take(9 * UNIT - 1).expect("room again");
    }

    #[test]
    fn a_late_body_is_found_however_deep_the_error_is() {
        let late = Late::Silent(Duration::from_secs(3));
        let wrapped = axum::Error::new(axum::Error::new(late.clone()));
        assert_eq!(cause::<Late>(&wrapped), Some(&late));
        assert_eq!(broken("the body", &wrapped).code(), Code::UploadStalled);
        assert_eq!(broken("the body", &std::io::Error::other("cut")).code(), Code::MalformedRequest);
    }
}
