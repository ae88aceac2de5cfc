//! HTTP to the store: hyper, and TLS by rustls with ring, with bounds on how long anything is waited for.

use std::error::Error;
use std::time::Duration;

use async_trait::async_trait;
use futures_util::{StreamExt, stream};
use http_body_util::{BodyExt, StreamBody};
use hyper_rustls::HttpsConnectorBuilder;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::{Connect, HttpConnector as Plain};
use hyper_util::rt::{TokioExecutor, TokioTimer};
use object_store::client::{
    ClientOptions, HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpRequestBody, HttpResponse,
    HttpResponseBody, HttpService,
};

/// For a connection.
const CONNECT: Duration = Duration::from_secs(5);
/// For the head of an answer, the body of the request before it included: a part of 16 MB at 0.3 MB/s.
pub(super) const ANSWER: Duration = Duration::from_secs(60);
/// For the next bytes of an answer.
const NEXT: Duration = Duration::from_secs(30);
/// Connections that nobody uses are closed: stores do so, too.
const IDLE: Duration = Duration::from_secs(20);

/// Makes clients.
#[derive(Debug)]
pub(super) struct Wires {
    /// Whether the store is reached by TLS.
    pub(super) tls: bool,
    /// How long an answer may take.
    pub(super) answer: Duration,
}

impl HttpConnector for Wires {
    fn connect(&self, _: &ClientOptions) -> object_store::Result<HttpClient> {
        let mut plain = Plain::new();
        plain.set_connect_timeout(Some(CONNECT));
        plain.set_nodelay(true);
        plain.enforce_http(!self.tls);
        if !self.tls {
            return Ok(HttpClient::new(Wire(client(plain), self.answer)));
        }
        // whom the system trusts
        let refused = |error: std::io::Error| object_store::Error::Generic { store: "S3", source: Box::new(error) };
        let builder = HttpsConnectorBuilder::new().with_native_roots().map_err(refused)?;
        let client = client(builder.https_or_http().enable_http1().wrap_connector(plain));
        Ok(HttpClient::new(Wire(client, self.answer)))
    }
}

fn client<C: Connect + Clone>(connector: C) -> Client<C, HttpRequestBody> {
    Client::builder(TokioExecutor::new()).pool_timer(TokioTimer::new()).pool_idle_timeout(IDLE).build(connector)
}

#[derive(Debug)]
struct Wire<C>(Client<C, HttpRequestBody>, Duration);

#[async_trait]
impl<C: Connect + Clone + std::fmt::Debug + Send + Sync + 'static> HttpService for Wire<C> {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        let answered = tokio::time::timeout(self.1, self.0.request(request)).await;
        let answer = answered.map_err(|late| HttpError::new(HttpErrorKind::Timeout, late))?;
        let answer = answer.map_err(|error| {
            let kind = if error.is_connect() { HttpErrorKind::Connect } else { HttpErrorKind::Request };
            HttpError::new(kind, Said(causes(&error)))
        })?;
        let (head, body) = answer.into_parts();
        let frames = stream::unfold(body, |mut body| async {
            let frame = match tokio::time::timeout(NEXT, body.frame()).await {
                Ok(frame) => frame?.map_err(|error| HttpError::new(HttpErrorKind::Interrupted, error)),
                Err(late) => Err(HttpError::new(HttpErrorKind::Timeout, late)),
            };
            Some((frame, body))
        });
        // whoever reads it may look once more behind its end
        Ok(HttpResponse::from_parts(head, HttpResponseBody::new(StreamBody::new(frames.fuse()))))
    }
}

/// Why there was no answer.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Said(String);

/// What an error says with all that caused it: "client error (Connect)" alone helps nobody.
fn causes(error: &dyn Error) -> String {
    let mut said = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        said = format!("{said}: {cause}");
        next = cause.source();
    }
    said
}
