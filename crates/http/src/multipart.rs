//! Forms as they arrive, with bounds on what the parser keeps: it looks for the end of what comes before the first part,
//! and of the head of each part, in memory.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::task::{Context, Poll};

use axum::body::BodyDataStream;
use axum::extract::Request;
use axum::http::header;
use bytes::Bytes;
use futures_util::Stream;

use super::body::{broken, cause};
use super::disposition;
use super::problem::{Code, Problem};

/// The most bytes of a part's head, and of what comes before the first part: heads have a few hundred.
const HEAD_BYTES: usize = 16 << 10;

/// Why a form is read no further.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum Refused {
    #[error("the head of a part, or what comes before the first part, has more than {HEAD_BYTES} bytes")]
    Head,
    #[error("the form has more than {0} bytes")]
    Whole(u64),
}

/// A form, part by part.
pub struct Parts {
    parser: multer::Multipart<'static>,
    gate: Arc<Gate>,
}

/// A part of a form, chunk by chunk.
pub struct Part(multer::Field<'static>);

impl Parts {
    /// The form in a request that has no more than `limit` bytes.
    pub fn of(request: Request, limit: u64) -> Result<Parts, Problem> {
        let media_type = request.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
        let boundary = multer::parse_boundary(media_type.unwrap_or_default()).map_err(|error| {
            Problem::new(Code::MalformedRequest, error.to_string(), "send multipart/form-data with a boundary")
        })?;
        let gate = Arc::new(Gate::default());
        let body = request.into_body().into_data_stream();
        let gated = Gated { body, rest: Bytes::new(), limit, received: 0, pause: false, gate: gate.clone() };
        Ok(Parts { parser: multer::Multipart::new(gated, boundary), gate })
    }

    /// The next part, when all of the one before has been read; `None` at the end.
    pub async fn next(&mut self) -> Result<Option<Part>, Problem> {
        self.gate.begin_head();
        let field = self.parser.next_field().await;
        self.gate.end_head();
        Ok(field.map_err(|error| unreadable(&error))?.map(Part))
    }
}

impl Part {
    /// Its name.
    pub fn name(&self) -> &str {
        self.0.name().unwrap_or_default()
    }

    /// The name of its file, if it has one.
    pub fn file_name(&self) -> Option<String> {
        let header = self.0.headers().get(header::CONTENT_DISPOSITION).map(|value| value.as_bytes());
        disposition::file_name(header, self.0.file_name())
    }

    /// More of its content; `None` at its end.
    pub async fn chunk(&mut self) -> Result<Option<Bytes>, Problem> {
        self.0.chunk().await.map_err(|error| unreadable(&error))
    }
}

fn unreadable(error: &multer::Error) -> Problem {
    match cause::<Refused>(error) {
        Some(refused @ Refused::Head) => {
            let hint = "send multipart/form-data as curl -F or a browser does";
            Problem::new(Code::TooLarge, refused.to_string(), hint)
        }
        Some(refused @ Refused::Whole(_)) => {
            let hint =
                "send the scans one by one with PUT /v1/scan-sets/{id}/scans/{name}; GET /v1/info states the limits";
            Problem::new(Code::TooLarge, refused.to_string(), hint)
        }
        None => broken("the form", error),
    }
}

/// Counts what the parser takes while it looks for a head.
#[derive(Default)]
struct Gate {
    in_head: AtomicBool,
    taken: AtomicU64,
}

impl Gate {
    fn begin_head(&self) {
        self.taken.store(0, Ordering::Relaxed);
        self.in_head.store(true, Ordering::Relaxed);
    }

    fn end_head(&self) {
        self.in_head.store(false, Ordering::Relaxed);
    }
}

/// A body that lets through only so much while the parser looks for a head. The parser takes whatever is ready before it
/// looks, so each chunk is followed by a pause.
struct Gated {
    body: BodyDataStream,
    /// What of a chunk has not been let through yet.
    rest: Bytes,
    limit: u64,
    received: u64,
    pause: bool,
    gate: Arc<Gate>,
}

impl Stream for Gated {
    type Item = Result<Bytes, Box<dyn std::error::Error + Send + Sync>>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        if std::mem::take(&mut self.pause) {
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let in_head = self.gate.in_head.load(Ordering::Relaxed);
        if in_head && self.gate.taken.load(Ordering::Relaxed) >= HEAD_BYTES as u64 {
            return Poll::Ready(Some(Err(Refused::Head.into())));
        }
        if self.rest.is_empty() {
            match Pin::new(&mut self.body).poll_next(context) {
                Poll::Ready(Some(Ok(chunk))) => self.rest = chunk,
                Poll::Ready(Some(Err(error))) => return Poll::Ready(Some(Err(error.into()))),
                Poll::Ready(None) => return Poll::Ready(None),
                Poll::Pending => return Poll::Pending,
            }
            self.received += self.rest.len() as u64;
            if self.received > self.limit {
                return Poll::Ready(Some(Err(Refused::Whole(self.limit).into())));
            }
        }
        let most = if in_head { HEAD_BYTES.min(self.rest.len()) } else { self.rest.len() };
        let chunk = self.rest.split_to(most);
        if in_head {
            self.gate.taken.fetch_add(chunk.len() as u64, Ordering::Relaxed);
        }
        self.pause = true;
        Poll::Ready(Some(Ok(chunk)))
    }
}
