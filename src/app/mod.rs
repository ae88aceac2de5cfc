//! What the service can do, whoever asks for it: no HTTP, no SQL, no paths.
//!
//! - [`live_gallery`]: the stored signatures, searchable in memory

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod live_gallery;
