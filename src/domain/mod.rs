//! What the service keeps and what its users may choose, as plain values: no files, no database, no requests.
//!
//! - [`asset`]: the files of models and standards, by name, media type and role
//! - [`options`]: what the caller of a job may choose, a line each

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod asset;
pub mod options;
