//! The seam to the network: whoever carries messages to their receivers.

use async_trait::async_trait;

use crate::config::Address;

/// A message on its way.
#[derive(Debug, Clone)]
pub struct Letter {
    /// Where it goes.
    pub address: Address,
    /// Names and values of its headers.
    pub headers: [(&'static str, String); 3],
    /// What it says, as JSON.
    pub body: String,
}

/// Why somebody who was asked gave no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unreached {
    /// All addresses of the host are where nothing may be sent to.
    #[error(
        "{0} leads to no address that may be asked: only public ones by https are, and networks that the operator allows \
         (--webhook-network)"
    )]
    Forbidden(String),
    /// The host has no address.
    #[error("{0} has no address")]
    Unknown(String),
    /// There was no answer in time.
    #[error("there was no answer in time")]
    TimedOut,
    /// This build has no TLS.
    #[error("this build of visage asks nobody by https: build it with --features tls")]
    NoTls,
    /// The connection failed.
    #[error("{0}")]
    Failed(String),
}

/// Carries messages.
#[async_trait]
pub trait Courier: Send + Sync {
    /// Sends a message and answers with the status that came back. It ends within a stated time, follows no redirect,
    /// and reads nothing of the answer but its head.
    async fn deliver(&self, letter: &Letter) -> Result<u16, Unreached>;
}
