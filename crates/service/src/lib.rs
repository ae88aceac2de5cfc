//! The service behind its HTTP edge: what is kept, what can be done with it, and work that takes long.
//!
//! - [`storage`]: the database and the files, each behind a trait
//! - [`app`]: use cases: models are added and deleted, the gallery is searchable and evaluated
//! - [`jobs`]: the durable queue and its runner
//! - [`config`], [`machine`], [`panics`]: settings, memory and threads, what a panic said
//! - [`traces`]: the seam to what follows requests and jobs across programs
//!
//! Rooms point one way, `jobs -> app -> storage`; `tests/architecture/` of the workspace holds them.

pub mod app;
pub mod config;
pub mod jobs;
pub mod machine;
pub mod panics;
pub mod storage;
pub mod traces;
