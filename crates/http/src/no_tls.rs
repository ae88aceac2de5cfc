//! A build without TLS: there is nothing that takes connections by it.

use std::convert::Infallible;

use tokio::net::TcpStream;

use visage_service::config::TlsPem;

/// Why there is no TLS.
#[derive(Debug, thiserror::Error)]
#[error("this program was built without TLS: build it with `--features tls`, or put a proxy before it")]
pub struct TlsError;

/// What there is not.
#[derive(Clone)]
pub struct Tls(Infallible);

impl Tls {
    /// There is none.
    pub fn new(_: &TlsPem) -> Result<Tls, TlsError> {
        Err(TlsError)
    }

    /// Never called.
    pub async fn accept(&self, _: TcpStream) -> std::io::Result<TcpStream> {
        match self.0 {}
    }
}
