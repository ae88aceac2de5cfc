//! `Content-Encoding` of requests: what is packed by gzip is unpacked while it arrives, a few kilobytes at a time, so the
//! bounds of each call hold for what is unpacked, and nothing is unpacked beyond them.

use std::sync::{Arc, Mutex, PoisonError};

use async_compression::tokio::bufread::GzipDecoder;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::{StreamExt, TryStreamExt};
use tokio_util::io::{ReaderStream, StreamReader};

use super::digest::{Digests, Hashers};
use super::problem::{Code, Problem};

/// How much is unpacked at a time.
const CHUNK: usize = 16 << 10;

/// Digests of a body as it was sent, before it was unpacked.
#[derive(Debug, Clone, Default)]
pub struct PackedDigests(Arc<Mutex<Hashers>>);

impl PackedDigests {
    fn update(&self, chunk: &[u8]) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).update(chunk);
    }

    /// The digests, when all has arrived.
    pub fn finish(self) -> Digests {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone().finish()
    }
}

/// Unpacks what is packed by gzip, and refuses what is packed otherwise.
pub async fn unpacked(request: Request, next: Next) -> Response {
    let mut codings = Vec::new();
    for value in request.headers().get_all(header::CONTENT_ENCODING) {
        let Ok(value) = value.to_str() else { return refused("it is no text").into_response() };
        codings.extend(value.split(',').map(|coding| coding.trim().to_ascii_lowercase()));
    }
    codings.retain(|coding| !coding.is_empty() && coding != "identity");
    match codings.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        [] => next.run(request).await,
        // they are the same (RFC 9110, section 8.4.1.3)
        ["gzip" | "x-gzip"] => next.run(decoded(with_digests(request))).await,
        _ => refused(&format!("it is {}", shown(&codings.join(", ")))).into_response(),
    }
}

/// The request with its body unpacked: no faster than somebody takes it.
fn decoded(request: Request) -> Request {
    let (mut parts, body) = request.into_parts();
    parts.headers.remove(header::CONTENT_ENCODING);
    parts.headers.remove(header::CONTENT_LENGTH);
    let packed = StreamReader::new(body.into_data_stream().map_err(std::io::Error::other));
    let mut decoder = GzipDecoder::new(packed);
    // a file may be packed in parts, and what follows that is none is an error, not the end
    decoder.multiple_members(true);
    Request::from_parts(parts, Body::from_stream(ReaderStream::with_capacity(decoder, CHUNK)))
}

/// What is sent is hashed before it is unpacked, where somebody wants to know.
fn with_digests(request: Request) -> Request {
    if !request.headers().contains_key("content-digest") {
        return request;
    }
    let digests = PackedDigests::default();
    let (mut parts, body) = request.into_parts();
    parts.extensions.insert(digests.clone());
    let hashed = body.into_data_stream().inspect(move |chunk| {
        if let Ok(chunk) = chunk {
            digests.update(chunk);
        }
    });
    Request::from_parts(parts, Body::from_stream(hashed))
}

fn shown(codings: &str) -> String {
    codings.chars().take(64).collect()
}

fn refused(found: &str) -> Problem {
    let detail = format!("the Content-Encoding is not read here: {found}");
    let accepted = HeaderValue::from_static("gzip, identity");
    Problem::new(Code::UnsupportedMediaType, detail, "send the body as it is, or packed once by gzip")
        .header(header::ACCEPT_ENCODING, accepted)
}
