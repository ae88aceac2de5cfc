//! Asynchronous work: the durable queue's runner and everything that belongs to one job.
//!
//! - [`admission`]: which scan sets may become a job
//! - [`memory`]: whether a registration fits into it
//! - [`engine`]: the seam to the algorithms (tests put slow or failing ones in)
//! - [`tracker`]: the progress sink with a clock
//! - [`board`]: what runs now, for cancel and for those who wait
//! - [`work`]: one job from scans to stored files, on its own thread and rayon pool
//! - `evaluation`: stored models judged against standards, and old signatures made anew
//! - [`artifacts`]: the files of a model as bytes
//! - [`opening`]: a data folder is taken into use; [`checkup`]: what of it is sound
//! - [`runner`]: claims jobs, keeps their leases, ends them
//!
//! A job's row is the truth (`store`); memory only holds what is newer than the last heartbeat.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod admission;
pub mod artifacts;
pub mod board;
pub mod checkup;
pub mod engine;
mod evaluation;
pub mod memory;
pub mod opening;
pub mod runner;
pub mod tracker;
mod work;
