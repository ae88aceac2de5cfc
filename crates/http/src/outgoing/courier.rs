//! Messages to webhooks; of an answer nothing is read but its head.

use async_trait::async_trait;
use axum::http::{HeaderValue, Method, Request, header};
use bytes::Bytes;
use http_body_util::Full;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};

use super::{Dialer, head};
use visage_service::app::webhooks::{Courier, Letter, Unreached};
use visage_service::config::WebhookSettings;

/// The most of an answer's head that is read.
const HEAD_BYTES: usize = 16 << 10;

/// Carries messages to webhooks.
#[derive(Debug)]
pub struct HttpCourier {
    settings: WebhookSettings,
    dialer: Dialer,
}

impl HttpCourier {
    /// With the authorities that the system trusts.
    pub fn new(settings: WebhookSettings) -> HttpCourier {
        HttpCourier { settings, dialer: Dialer::of_system() }
    }

    async fn sent(&self, letter: &Letter) -> Result<u16, Unreached> {
        let Letter { address, headers, body } = letter;
        let mut request = head(Method::POST, &address.host, &address.target)
            .header(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        for (name, value) in headers {
            request = request.header(*name, value);
        }
        let body = Full::new(Bytes::from(body.clone()));
        let request = request.body(body).map_err(|error| Unreached::Failed(error.to_string()))?;
        let may_be_asked = |found| address.may_reach(found, &self.settings.networks);
        let stream = self.dialer.connected(address, may_be_asked, self.settings.patience).await?;
        status_of(stream, request).await
    }
}

#[async_trait]
impl Courier for HttpCourier {
    async fn deliver(&self, letter: &Letter) -> Result<u16, Unreached> {
        tokio::time::timeout(self.settings.patience, self.sent(letter)).await.unwrap_or(Err(Unreached::TimedOut))
    }
}

/// Sends a request and answers with the status.
pub(super) async fn status_of(
    stream: impl AsyncRead + AsyncWrite + Send + 'static,
    request: Request<Full<Bytes>>,
) -> Result<u16, Unreached> {
    let failed = |error: hyper::Error| Unreached::Failed(format!("no answer: {error}"));
    let stream = TokioIo::new(Box::pin(stream));
    let (mut sender, connection) =
        http1::Builder::new().max_buf_size(HEAD_BYTES).handshake(stream).await.map_err(failed)?;
    let mut answer = std::pin::pin!(sender.send_request(request));
    let answer = tokio::select! {
        biased;
        answer = answer.as_mut() => answer,
        // a connection that ends may have brought the answer just before
        _ = connection => answer.await,
    };
    Ok(answer.map_err(failed)?.status().as_u16())
}
