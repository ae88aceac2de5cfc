//! The only HTTP client of the service: it sends messages to webhooks, and serves `visage healthcheck`.
//!
//! Names are looked up here, and only addresses that may be asked are connected to, so that a name which leads elsewhere
//! a moment later (DNS rebinding) leads nowhere. No redirect is followed, no proxy of the environment is used, of an
//! answer nothing is read but its head.

#[cfg_attr(not(feature = "tls"), path = "no_tls.rs")]
mod tls;

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use async_trait::async_trait;
use axum::http::{HeaderValue, Method, Request, header};
use bytes::Bytes;
use http_body_util::Full;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;

use tls::TlsClient;
use visage_service::app::webhooks::{Address, Courier, Letter, Undelivered};
use visage_service::config::{Host, HostName, WebhookSettings};

/// The most of an answer's head that is read.
const HEAD_BYTES: usize = 16 << 10;
/// Addresses of a host that are tried, each for its share of the time.
const MOST_ADDRESSES: usize = 3;
/// How long a service is waited for that is asked whether it is well.
const PATIENCE: Duration = Duration::from_secs(3);

/// Whether this build can ask by TLS.
pub const HAS_TLS: bool = cfg!(feature = "tls");

/// Carries messages to webhooks.
#[derive(Debug)]
pub struct HttpCourier {
    settings: WebhookSettings,
    tls: Option<TlsClient>,
}

impl HttpCourier {
    /// With the authorities that the system trusts.
    pub fn new(settings: WebhookSettings) -> HttpCourier {
        let tls = TlsClient::of_system().inspect_err(|error| {
            if HAS_TLS {
                tracing::warn!("no webhook is reached by https: {error}");
            }
        });
        HttpCourier { settings, tls: tls.ok() }
    }

    async fn connected(&self, address: &Address) -> Result<TcpStream, Undelivered> {
        let found: Vec<SocketAddr> = match &address.host.host {
            Host::Address(ip) => vec![(*ip, address.port()).into()],
            Host::Name(name) => match tokio::net::lookup_host((name.as_str(), address.port())).await {
                Ok(found) => found.collect(),
                Err(_) => return Err(Undelivered::Unknown(name.clone())),
            },
        };
        let mut allowed: Vec<SocketAddr> = found;
        allowed.retain(|found| address.may_reach(found.ip(), &self.settings.networks));
        allowed.truncate(MOST_ADDRESSES);
        let mut failed = Undelivered::Forbidden(address.host.to_string());
        for found in &allowed {
            let time = self.settings.patience / allowed.len() as u32;
            match tokio::time::timeout(time, TcpStream::connect(found)).await {
                Ok(Ok(stream)) => return Ok(stream),
                Ok(Err(error)) => failed = Undelivered::Failed(format!("{} can't be reached: {error}", address.host)),
                Err(_) => failed = Undelivered::TimedOut,
            }
        }
        Err(failed)
    }

    async fn sent(&self, letter: &Letter) -> Result<u16, Undelivered> {
        let Letter { address, headers, body } = letter;
        let tls = match (&self.tls, address.is_secure) {
            (None, true) => return Err(Undelivered::NoTls),
            (tls, is_secure) => tls.as_ref().filter(|_| is_secure),
        };
        let mut request = head(Method::POST, &address.host, &address.target)
            .header(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        for (name, value) in headers {
            request = request.header(*name, value);
        }
        let body = Full::new(Bytes::from(body.clone()));
        let request = request.body(body).map_err(|error| Undelivered::Failed(error.to_string()))?;
        let stream = self.connected(address).await?;
        match tls {
            Some(tls) => {
                let secured = tls.connect(&address.host.host, stream).await;
                let refused = |error| Undelivered::Failed(format!("{}: no TLS: {error}", address.host));
                status_of(secured.map_err(refused)?, request).await
            }
            None => status_of(stream, request).await,
        }
    }
}

#[async_trait]
impl Courier for HttpCourier {
    async fn deliver(&self, letter: &Letter) -> Result<u16, Undelivered> {
        tokio::time::timeout(self.settings.patience, self.sent(letter)).await.unwrap_or(Err(Undelivered::TimedOut))
    }
}

/// Why a service does not say that it is well.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// The certificate by which it is known can't be read, or there is no TLS in this build.
    #[error("--tls-cert: {0}")]
    Certificate(String),
    /// There was no answer.
    #[error("{0}")]
    Failed(String),
}

/// Asks a service whether it is well; answers with the status. By TLS if its certificate (PEM) is given: it has to show
/// that very one, whatever name is in it.
pub async fn probe(addr: SocketAddr, target: &str, certificate: Option<&[u8]>) -> Result<u16, ProbeError> {
    let tls = certificate.map(TlsClient::pinned).transpose().map_err(ProbeError::Certificate)?;
    let host = HostName { host: Host::Address(addr.ip().to_canonical()), port: Some(addr.port()) };
    let asked = async {
        let request = head(Method::GET, &host, target).body(Full::new(Bytes::new()));
        let request = request.map_err(|error| ProbeError::Failed(error.to_string()))?;
        let failed = |error: std::io::Error| ProbeError::Failed(error.to_string());
        let stream = TcpStream::connect(addr).await.map_err(failed)?;
        let answer = match &tls {
            Some(tls) => status_of(tls.connect(&host.host, stream).await.map_err(failed)?, request).await,
            None => status_of(stream, request).await,
        };
        answer.map_err(|error| ProbeError::Failed(error.to_string()))
    };
    let in_time = tokio::time::timeout(PATIENCE, asked).await;
    in_time.unwrap_or_else(|_| Err(ProbeError::Failed(Undelivered::TimedOut.to_string())))
}

fn head(method: Method, host: &HostName, target: &str) -> axum::http::request::Builder {
    Request::builder()
        .method(method)
        .uri(target)
        .header(header::HOST, host.to_string())
        .header(header::USER_AGENT, concat!("visage/", env!("CARGO_PKG_VERSION")))
        .header(header::CONNECTION, HeaderValue::from_static("close"))
}

/// Sends a request and answers with the status.
async fn status_of(
    stream: impl AsyncRead + AsyncWrite + Send + 'static,
    request: Request<Full<Bytes>>,
) -> Result<u16, Undelivered> {
    let failed = |error: hyper::Error| Undelivered::Failed(format!("no answer: {error}"));
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

/// Whether a message may ever get there, as far as the address itself tells.
pub fn check(address: &Address, settings: &WebhookSettings) -> Result<(), Undelivered> {
    let may = match address.host.host {
        Host::Address(ip) => address.may_reach(ip, &settings.networks),
        // where a name leads is seen when a message is sent
        Host::Name(_) => address.is_secure || !settings.networks.is_empty(),
    };
    match may {
        false => Err(Undelivered::Forbidden(address.host.to_string())),
        true if address.is_secure && !HAS_TLS => Err(Undelivered::NoTls),
        true => Ok(()),
    }
}

/// The address of a service that listens here: on every address it is asked on the loopback one.
pub fn reachable(mut addr: SocketAddr) -> SocketAddr {
    use std::net::{Ipv4Addr, Ipv6Addr};
    if addr.ip().is_unspecified() {
        addr.set_ip(match addr.ip() {
            IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
        });
    }
    addr
}

#[cfg(test)]
mod tests;
