//! Rough registration.
pub mod alignment;
pub mod consensus;
pub mod descriptor;
pub mod matching;
pub mod sight;
pub mod sketch;
pub mod verification;
