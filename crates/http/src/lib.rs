//! The HTTP edge: router, resources, problem+json, uploads, and the server itself.
//!
//! - `router`: the table of contents, layers, the contract
//! - `scan_sets` (with `scans`, `poses`, `expiry`), `jobs` (with `events`), `models` (with `assets`), `queries`, `evaluation`,
//!   `standards`, `meta`: one file or folder a resource; what goes over the wire is in the `*_views` beside them
//! - `problem`, `storage_problem`, `responses`: every error that leaves the service, and how the contract names them
//! - `connections`: how many, and how long without being used (`tls`, or `no_tls` in a build without); `hosts`: who is meant, and from where a page asks;
//!   `headers`: what browsers are told
//! - `base`: served below a path; `forwarded`: who has sent a request, when proxies stand between
//! - `access`: who may; `keys`, `session`, `audit`: keys, signing in, what was done
//! - `webhooks`: their routes; `outgoing`: the only HTTP client of the service
//! - `schemas`: bounds of values that the contract tells and Rust types don't
//! - `body`, `multipart`, `upload`, `digest`, `names`, `describe`: what comes in is hostile until it has passed here
//! - `verdicts`: how models were judged, as queries and models show it
//! - `extract`, `conditions`, `idempotency`, `cursor`, `state`: parts of requests, repeated requests, where the next page
//!   of a list begins, what handlers share
//! - `access_log`: a line a request; `metrics`: figures for Prometheus
//! - `page`: the page at `/`, built into the program
//!
//! A new resource is a file here with its routes and a line in `router`; what can be done with it is a use case of
//! `visage_service::app`, and what is kept of it a trait of `visage_service::storage::database`.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod access;
mod access_log;
mod assets;
mod audit;
mod base;
mod bin;
mod body;
mod conditions;
mod connections;
#[cfg(test)]
mod contract_tests;
mod cursor;
mod describe;
mod deviation;
mod digest;
mod disposition;
mod duplicates;
mod encoding;
mod evaluation;
mod events;
mod expiry;
mod extract;
mod fetching;
mod forwarded;
mod headers;
mod hint_views;
mod hosts;
mod idempotency;
mod job_views;
mod jobs;
mod keys;
mod meta;
mod metrics;
mod model_views;
mod models;
mod multipart;
mod names;
mod negotiation;
mod option_views;
mod outgoing;
mod page;
mod pictures;
mod poses;
pub mod problem;
mod queries;
mod reading_view;
mod renditions;
mod responses;
mod router;
mod saliency;
mod scan_set_views;
mod scan_sets;
mod scans;
mod schemas;
mod searching;
mod server;
mod session;
mod standard_views;
mod standards;
mod state;
mod storage_problem;
#[cfg_attr(not(feature = "tls"), path = "no_tls.rs")]
mod tls;
mod upload;
mod uploads;
mod verdicts;
mod webhooks;

pub use connections::Connections;
pub use outgoing::{ProbeError, probe, reachable};
pub use router::{OpenApiError, openapi_yaml};
pub use server::{Server, ServerHandle, StartError};
