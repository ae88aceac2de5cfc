//! In place of TLS in a build without it.

use tokio::net::TcpStream;
use visage_service::config::Host;

/// There is none.
#[derive(Debug)]
pub enum TlsClient {}

const WITHOUT: &str = "this build has no TLS: build it with --features tls";

impl TlsClient {
    /// There is none.
    pub fn of_system() -> Result<TlsClient, String> {
        Err(WITHOUT.to_owned())
    }

    /// There is none.
    pub fn pinned(_pem: &[u8]) -> Result<TlsClient, String> {
        Err(WITHOUT.to_owned())
    }

    /// Never called.
    pub async fn connect(&self, _host: &Host, _stream: TcpStream) -> std::io::Result<TcpStream> {
        match *self {}
    }
}
