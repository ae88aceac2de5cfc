//! What the service can do, whoever asks for it: no HTTP, no SQL, no paths.
//!
//! - [`models`]: finished models are added and deleted
//! - [`evaluations`]: how well the gallery's answers agree with its labels
//! - [`live_gallery`]: the stored signatures, searchable in memory

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod evaluations;
pub mod live_gallery;
pub mod models;
