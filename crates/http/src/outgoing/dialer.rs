//! Connections to others, in the clear or by TLS.

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;

use super::HAS_TLS;
use super::tls::TlsClient;
use visage_service::app::webhooks::Unreached;
use visage_service::config::{Address, Host};

/// Addresses of a host that are tried, each for its share of the time.
const MOST_ADDRESSES: usize = 3;

/// A connection of either kind.
pub trait Connection: AsyncRead + AsyncWrite + Send + Unpin {}

impl<C: AsyncRead + AsyncWrite + Send + Unpin> Connection for C {}

/// Connects to others.
#[derive(Debug)]
pub struct Dialer(Option<TlsClient>);

impl Dialer {
    /// With the authorities that the system trusts.
    pub fn of_system() -> Dialer {
        let tls = TlsClient::of_system().inspect_err(|error| {
            if HAS_TLS {
                tracing::warn!("nobody is reached by https: {error}");
            }
        });
        Dialer(tls.ok())
    }

    /// Connects to an address; of those that its host has, only to one that may be asked.
    pub async fn connected(
        &self,
        address: &Address,
        may_be_asked: impl Fn(IpAddr) -> bool,
        patience: Duration,
    ) -> Result<Box<dyn Connection>, Unreached> {
        let tls = match (&self.0, address.is_secure) {
            (None, true) => return Err(Unreached::NoTls),
            (tls, is_secure) => tls.as_ref().filter(|_| is_secure),
        };
        let stream = connected(address, may_be_asked, patience).await?;
        match tls {
            Some(tls) => {
                let refused = |error| Unreached::Failed(format!("{}: no TLS: {error}", address.host));
                Ok(Box::new(tls.connect(&address.host.host, stream).await.map_err(refused)?))
            }
            None => Ok(Box::new(stream)),
        }
    }
}

async fn connected(
    address: &Address,
    may_be_asked: impl Fn(IpAddr) -> bool,
    patience: Duration,
) -> Result<TcpStream, Unreached> {
    let mut found: Vec<SocketAddr> = match &address.host.host {
        Host::Address(ip) => vec![(*ip, address.port()).into()],
        Host::Name(name) => match tokio::net::lookup_host((name.as_str(), address.port())).await {
            Ok(found) => found.collect(),
            Err(_) => return Err(Unreached::Unknown(name.clone())),
        },
    };
    found.retain(|found| may_be_asked(found.ip()));
    found.truncate(MOST_ADDRESSES);
    let mut failed = Unreached::Forbidden(address.host.to_string());
    for addr in &found {
        let time = patience / found.len() as u32;
        match tokio::time::timeout(time, TcpStream::connect(addr)).await {
            Ok(Ok(stream)) => return Ok(stream),
            Ok(Err(error)) => failed = Unreached::Failed(format!("{} can't be reached: {error}", address.host)),
            Err(_) => failed = Unreached::TimedOut,
        }
    }
    Err(failed)
}
