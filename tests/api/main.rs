//! The service over real connections, with algorithms that do what a test tells them; `binary` starts the program itself.

mod access;
mod additions;
mod archives;
mod backup;
mod bin;
mod binary;
#[cfg(feature = "s3")]
mod bucket;
mod client_commands;
mod common;
mod conditions;
mod contract;
mod describing;
mod documents;
mod encoding;
mod exchange;
mod fetching;
mod gallery;
mod hints;
mod hosts;
mod jobs;
mod long;
mod metrics;
mod models;
#[cfg(all(feature = "postgres", feature = "s3"))]
mod nodes;
mod page;
mod pictures;
mod pieces;
mod placing;
#[cfg(feature = "postgres")]
mod postgres;
mod pressure;
mod proxies;
mod queries;
mod recovery;
mod renditions;
mod scan_sets;
#[cfg(all(feature = "postgres", feature = "s3"))]
mod searchers;
mod slow;
mod standards;
mod storage;
mod surfaces;
#[cfg(feature = "otel")]
mod traces;
mod webhooks;
