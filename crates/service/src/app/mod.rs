//! What the service can do, whoever asks for it: no HTTP, no SQL, no paths.
//!
//! - [`arrival`]: what a client sends becomes scans
//! - [`scan_sets`], [`models`], [`standards`]: they come with their files, change, and go
//! - [`uploads`]: files that come piece by piece
//! - [`renditions`]: what is stored in other formats; [`pictures`]: models and scans as people see them
//! - [`orders`]: jobs are ordered, stopped, tried again
//! - [`access`]: who asks: keys and sessions
//! - [`retention`]: what is old is deleted
//! - [`webhooks`]: who wants to know is told
//! - [`queries`]: the gallery is asked; [`search`]: by several servers, each of which has a part of it
//! - [`placing`]: where a probe lies on what was found; [`deviation`]: how far models of one frame are from each other;
//!   [`duplicates`]: models that are there twice; [`model_file`]: what is measured on
//! - [`evaluations`]: how well the gallery's answers agree with its labels
//! - [`exchange`]: a gallery as one file, for programs of other versions
//! - [`live_gallery`]: the stored signatures, searchable in memory
//! - [`engine`]: the seam to the algorithms (tests put slow or failing ones in)
//! - [`looks`]: many who wait for one job look at it together; [`shared_reads`]: so do others who read one thing at a time
//! - [`monitor`]: what runs now, for cancel and for those who wait; [`tracker`]: its progress, with a clock
//! - [`figures`]: what this process has done, counted
//! - [`context`]: what all of these share

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod access;
pub mod arrival;
pub mod context;
pub mod deviation;
pub mod duplicates;
pub mod engine;
pub mod evaluations;
pub mod exchange;
pub mod figures;
pub mod live_gallery;
pub mod looks;
pub mod model_file;
pub mod models;
pub mod monitor;
pub mod orders;
pub mod pictures;
pub mod placing;
pub mod queries;
pub mod recycle_bin;
pub mod renditions;
pub mod retention;
pub mod scan_sets;
pub mod search;
pub mod shared_reads;
pub mod standards;
pub mod tracker;
pub mod uploads;
pub mod webhooks;
