//! Questions to other servers of the same database: sent whole, answered whole, within stated bounds.

use std::time::Duration;

use async_trait::async_trait;
use axum::http::{HeaderValue, Method, StatusCode, header};
use bytes::Bytes;
use http_body_util::{BodyExt, Full, Limited};
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio_util::task::AbortOnDropHandle;

use super::{Dialer, head};
use crate::searching::PATH;
use visage_domain::NodeSecret;
use visage_service::app::search::PATIENCE;
use visage_service::app::search::peers::Peers;
use visage_service::app::webhooks::Unreached;
use visage_service::config::Address;

/// How long a connection is waited for: servers of one service are near each other.
const CONNECT: Duration = Duration::from_secs(1);
/// The most of an answer: a thousand matches have a third of a megabyte.
const MOST_BYTES: usize = 2 << 20;

/// Asks other servers over HTTP, a connection for each question.
#[derive(Debug)]
pub struct HttpPeers(Dialer);

impl HttpPeers {
    /// With the authorities that the system trusts.
    pub fn of_system() -> HttpPeers {
        HttpPeers(Dialer::of_system())
    }

    async fn asked(&self, server: &Address, secret: &NodeSecret, question: Vec<u8>) -> Result<Vec<u8>, Unreached> {
        let failed = |error: &dyn std::fmt::Display| Unreached::Failed(format!("no answer: {error}"));
        let shown = HeaderValue::try_from(format!("Bearer {}", secret.0)).map_err(|error| failed(&error))?;
        let target = format!("{}{PATH}", server.target.trim_end_matches('/'));
        let request = head(Method::POST, &server.host, &target)
            .header(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))
            .header(header::AUTHORIZATION, shown)
            .body(Full::new(Bytes::from(question)))
            .map_err(|error| failed(&error))?;
        // who uses the database may say where it is
        let stream = TokioIo::new(self.0.connected(server, |_| true, CONNECT).await?);
        let (mut sender, connection) = http1::handshake(stream).await.map_err(|error| failed(&error))?;
        let _connection = AbortOnDropHandle::new(tokio::spawn(connection));
        let answer = sender.send_request(request).await.map_err(|error| failed(&error))?;
        if answer.status() != StatusCode::OK {
            return Err(Unreached::Failed(format!("it answered {}", answer.status())));
        }
        let body = Limited::new(answer.into_body(), MOST_BYTES).collect().await.map_err(|error| failed(&error))?;
        Ok(body.to_bytes().into())
    }
}

#[async_trait]
impl Peers for HttpPeers {
    async fn ask(&self, server: &Address, secret: &NodeSecret, question: Vec<u8>) -> Result<Vec<u8>, Unreached> {
        let asked = self.asked(server, secret, question);
        tokio::time::timeout(PATIENCE, asked).await.unwrap_or(Err(Unreached::TimedOut))
    }
}
