//! Servers that search a part of the gallery for others.

use std::fmt;

use super::{Parts, SeatId};

/// A server that searches, as it has said last of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Searcher {
    /// Which server it is, wherever it is.
    pub node: SeatId,
    /// Where others reach it: `http://` or `https://` with a host.
    pub address: String,
    /// What it has, whole.
    pub parts: Parts,
    /// How long ago it has said so, milliseconds by the database's clock.
    pub silent_ms: u64,
}

/// What those show each other who use one database, and nobody else: whoever has it may ask a server for a part of an answer.
#[derive(Clone, PartialEq, Eq)]
pub struct NodeSecret(pub String);

/// Never shown.
impl fmt::Debug for NodeSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("NodeSecret")
    }
}
