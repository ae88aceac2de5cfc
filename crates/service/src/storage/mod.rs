//! Where the service keeps things: a database for everything that is small and an object store for files.
//!
//! - [`database`], [`object_store`]: the two traits; all that the rest of the service sees
//! - `segment_store`: files of the index, which are lent as memory
//! - `error`: what a database says when it can't; `reserve`: space for when a disk is full; `unseen`: what the index in
//!   memory has yet to follow
//! - [`sqlite`], [`local_files`]: a database in one file, files in a folder; `s3`: files in a bucket, a feature of the build
//! - [`inventory`]: the files held against the database, and what a process has left that is gone; [`checkup`]: whether
//!   all of it is sound
//! - [`data_folder`]: both backends in one folder, taken into use
//! - `conformance`: what every backend has to keep, as tests that take any of them
//!
//! A new backend is a folder here that implements one of the traits, a test that runs it through `conformance`, and a place where
//! it is opened, as `data_folder` does for both of today.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod checkup;
#[cfg(test)]
pub(crate) mod conformance;
pub mod data_folder;
pub mod database;
mod error;
pub mod inventory;
pub mod local_files;
mod migrations;
pub mod object_store;
#[cfg(feature = "postgres")]
pub mod postgres;
mod reserve;
#[cfg(feature = "s3")]
pub(crate) mod s3;
mod segment_store;
mod sql_error;
pub mod sqlite;
mod unseen;
mod words;

pub use database::Database;
pub use error::DatabaseError;
pub use object_store::{
    AssetReader, ObjectError, ObjectStore, PieceWriter, StagedFile, StagedModel, StagedWriter, Staging, TRASH_DAYS,
};
pub use reserve::{NoReserve, Reserve};
pub use segment_store::SegmentStore;
pub use unseen::{Changes, Deleted, Purged, Unseen};
