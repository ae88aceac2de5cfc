//! Files of others: the head of an answer within a stated time, its body as it comes.

use std::time::Duration;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use bytes::Bytes;
use http_body_util::{BodyExt, Full};
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio_util::task::AbortOnDropHandle;

use super::{Dialer, head};
use visage_service::app::webhooks::Unreached;
use visage_service::config::Address;

/// How much of an answer is read at a time; its head has to fit.
const READ_BYTES: usize = 256 << 10;

/// The beginning of an answer, and a body whose connection ends with it.
#[derive(Debug)]
pub struct Download {
    /// What it answered.
    pub status: StatusCode,
    /// What it says of the file.
    pub headers: HeaderMap,
    /// The file, if the status says so.
    pub body: Body,
}

/// Asks for a file; for the beginning of the answer it is waited so long. Any address of the host is connected to: whoever calls has
/// made sure that the host may be asked.
pub async fn download(dialer: &Dialer, address: &Address, patience: Duration) -> Result<Download, Unreached> {
    let failed = |error: hyper::Error| Unreached::Failed(format!("no answer: {error}"));
    let begun = async {
        let request = head(Method::GET, &address.host, &address.target)
            .header(header::ACCEPT, HeaderValue::from_static("*/*"))
            .header(header::ACCEPT_ENCODING, HeaderValue::from_static("identity"))
            .body(Full::new(Bytes::new()))
            .map_err(|error| Unreached::Failed(error.to_string()))?;
        let stream = TokioIo::new(dialer.connected(address, |_| true, patience).await?);
        let (mut sender, connection) =
            http1::Builder::new().max_buf_size(READ_BYTES).handshake(stream).await.map_err(failed)?;
        let connection = AbortOnDropHandle::new(tokio::spawn(connection));
        let answer = sender.send_request(request).await.map_err(failed)?;
        let (parts, body) = answer.into_parts();
        let body = Body::new(body.map_frame(move |frame| {
            let _held_until_the_end = &connection;
            frame
        }));
        Ok(Download { status: parts.status, headers: parts.headers, body })
    };
    tokio::time::timeout(patience, begun).await.unwrap_or(Err(Unreached::TimedOut))
}
