//! The only HTTP client of the service: it sends messages to webhooks, fetches scans from where the operator allows, asks other servers of the
//! same database, and serves `visage healthcheck`.
//!
//! - `dialer`: connections. Names are looked up here, and only addresses that may be asked are connected to, so that a name which
//!   leads elsewhere a moment later (DNS rebinding) leads nowhere. No proxy of the environment is used
//! - `courier`: messages to webhooks; of an answer nothing is read but its head
//! - `download`: files; `peers`: questions to other servers
//!
//! No redirect is followed.

mod courier;
mod dialer;
mod download;
mod peers;
#[cfg_attr(not(feature = "tls"), path = "no_tls.rs")]
mod tls;

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use axum::http::{HeaderValue, Method, Request, header};
use bytes::Bytes;
use http_body_util::Full;
use tokio::net::TcpStream;

use tls::TlsClient;
use visage_service::app::webhooks::Unreached;
use visage_service::config::{Address, Host, HostName, WebhookSettings};

pub use courier::HttpCourier;
pub use dialer::Dialer;
pub use download::{Download, download};
pub use peers::HttpPeers;

/// How long a service is waited for that is asked whether it is well.
const PATIENCE: Duration = Duration::from_secs(3);

/// Whether this build can ask by TLS.
pub const HAS_TLS: bool = cfg!(feature = "tls");

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
            Some(tls) => courier::status_of(tls.connect(&host.host, stream).await.map_err(failed)?, request).await,
            None => courier::status_of(stream, request).await,
        };
        answer.map_err(|error| ProbeError::Failed(error.to_string()))
    };
    let in_time = tokio::time::timeout(PATIENCE, asked).await;
    in_time.unwrap_or_else(|_| Err(ProbeError::Failed(Unreached::TimedOut.to_string())))
}

fn head(method: Method, host: &HostName, target: &str) -> axum::http::request::Builder {
    Request::builder()
        .method(method)
        .uri(target)
        .header(header::HOST, host.to_string())
        .header(header::USER_AGENT, concat!("visage/", env!("CARGO_PKG_VERSION")))
        .header(header::CONNECTION, HeaderValue::from_static("close"))
}

/// Whether a message may ever get there, as far as the address itself tells.
pub fn check(address: &Address, settings: &WebhookSettings) -> Result<(), Unreached> {
    let may = match address.host.host {
        Host::Address(ip) => address.may_reach(ip, &settings.networks),
        // where a name leads is seen when a message is sent
        Host::Name(_) => address.is_secure || !settings.networks.is_empty(),
    };
    match may {
        false => Err(Unreached::Forbidden(address.host.to_string())),
        true if address.is_secure && !HAS_TLS => Err(Unreached::NoTls),
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
