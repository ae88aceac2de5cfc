//! Answers kept for POSTs that carry an `Idempotency-Key`.

/// What tells a repeated request from another one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplayKey {
    /// Method and path: the same key may be used on two resources.
    pub route: &'static str,
    /// The client's key.
    pub key: String,
    /// A hash of what was sent.
    pub body_hash: String,
}

/// The answer to a request that created something.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replay {
    /// Which request it answers.
    pub key: ReplayKey,
    /// The HTTP status.
    pub status: u16,
    /// The `Location` header.
    pub location: String,
    /// The JSON body.
    pub body: String,
    /// The id of what was created.
    pub resource_id: String,
}
