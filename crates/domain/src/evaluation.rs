//! What is to be looked at again, and verdicts.

use super::{ModelId, StandardId};
use visage_shape::standards::Found;

/// A model that has something to be made anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outdated {
    /// Which model.
    pub model_id: ModelId,
    /// Whether its signature is of another version.
    pub signature: bool,
    /// The standards it has no verdict against.
    pub standards: Vec<StandardId>,
}

/// How much there is to be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Backlog {
    /// Signatures of another version: their models are not found until they are made anew.
    pub stale_signatures: u64,
    /// Pairs of a model and a standard without a verdict.
    pub missing_verdicts: u64,
    /// Standards made by users.
    pub standards: u64,
}

/// What a model is by a standard.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredVerdict {
    /// The standard.
    pub standard_id: StandardId,
    /// The model.
    pub model_id: ModelId,
    /// What is left of the fit, mm on the standard.
    pub residual_mm: f64,
    /// Where the class was found, if anywhere.
    pub found: Option<Found>,
    /// Why the model could not be looked at.
    pub reason: Option<String>,
}
