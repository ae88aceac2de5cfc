//! The HTTP edge: router, resources, problem+json, uploads, and the server itself.
//!
//! - `router`: the table of contents, layers, the contract
//! - `scan_sets`, `jobs` (with `events`), `models` (with `assets`), `queries`, `evaluation`, `standards`, `meta`: one
//!   file or folder a resource; what goes over the wire is in the `*_views` beside them
//! - `problem`, `storage_problem`, `responses`: every error that leaves the service, and how the contract names them
//! - `upload`, `digest`, `names`, `describe`: what comes in is hostile until it has passed here
//! - `verdicts`: how models were judged, as queries and models show it
//! - `extract`, `idempotency`, `state`: parts of requests, repeated requests, what handlers share

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod assets;
mod describe;
mod digest;
mod evaluation;
mod events;
mod extract;
mod idempotency;
mod job_views;
mod jobs;
mod meta;
mod model_views;
mod models;
mod names;
pub mod problem;
mod queries;
mod responses;
mod router;
mod scan_set_views;
mod scan_sets;
mod server;
mod standard_views;
mod standards;
mod state;
mod storage_problem;
mod upload;
mod verdicts;

pub use router::{OpenApiError, openapi_yaml};
pub use server::{Server, ServerHandle, StartError};
