//! One line a request: what it was answered with and when, or that its client has left.

use std::time::Instant;

use axum::extract::Request;
use axum::middleware::Next;
use axum::response::Response;

/// Logs an answer, or at its drop that there was none.
struct Line {
    begin: Instant,
    answered: bool,
}

impl Line {
    fn milliseconds(&self) -> u64 {
        u64::try_from(self.begin.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if !self.answered {
            tracing::info!(ms = self.milliseconds(), "the client left before the answer");
        }
    }
}

/// Logs each request at its answer; method, path and id are in the span. Signs of life are of interest to nobody who
/// does not look for them.
pub async fn logged(request: Request, next: Next) -> Response {
    let is_probe = matches!(request.uri().path(), "/healthz" | "/readyz");
    let mut line = Line { begin: Instant::now(), answered: false };
    let response = next.run(request).await;
    line.answered = true;
    let (status, ms) = (response.status().as_u16(), line.milliseconds());
    if is_probe && response.status().is_success() {
        tracing::debug!(status, ms, "answered");
    } else {
        tracing::info!(status, ms, "answered");
    }
    response
}
