//! The seam to the network: other servers of the same database.

use async_trait::async_trait;

use crate::app::webhooks::Unreached;
use crate::config::Address;
use visage_domain::NodeSecret;

/// Asks other servers.
#[async_trait]
pub trait Peers: Send + Sync + std::fmt::Debug {
    /// Sends a question ([`super::message`]) to a server and gives back what it answered, if that was an answer. Ends within a stated time.
    async fn ask(&self, server: &Address, secret: &NodeSecret, question: Vec<u8>) -> Result<Vec<u8>, Unreached>;
}

/// For a service that is alone.
#[derive(Debug, Clone, Copy)]
pub struct NoPeers;

#[async_trait]
impl Peers for NoPeers {
    async fn ask(&self, _server: &Address, _secret: &NodeSecret, _question: Vec<u8>) -> Result<Vec<u8>, Unreached> {
        Err(Unreached::Failed("this service asks no others".to_owned()))
    }
}
