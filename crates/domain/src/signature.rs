//! Signatures as they are stored.

use visage_shape::faces::{Signature, SignatureSummary};

/// A signature as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredSignature {
    /// The version of the operator that made it.
    pub version: u32,
    /// What the API shows of it.
    pub summary: SignatureSummary,
    /// `Signature::to_bytes`.
    pub content: Vec<u8>,
}

impl From<&Signature> for StoredSignature {
    fn from(signature: &Signature) -> Self {
        StoredSignature { version: Signature::VERSION, summary: signature.summary(), content: signature.to_bytes() }
    }
}

/// The bytes of a signature, held against their checksum.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StoredContent {
    /// They are what was stored.
    Whole(Vec<u8>),
    /// They are not.
    Damaged,
}
