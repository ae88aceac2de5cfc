//! Asynchronous work: the durable queue's runner and everything that belongs to one job.
//!
//! - [`admission`]: which scan sets may become a job
//! - [`memory`]: whether a registration fits into it
//! - [`work`]: one job from scans to stored files, on its own thread and rayon pool
//! - `evaluation`: stored models judged against standards, and old signatures made anew
//! - [`artifacts`]: the files of a model as bytes
//! - [`runner`]: claims jobs, keeps their leases, ends them; `watchdog`: when it gives one up
//!
//! A job's row in the database is the truth; memory only holds what is newer than the last heartbeat.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod admission;
pub mod artifacts;
mod evaluation;
pub mod memory;
mod resurface;
pub mod runner;
mod watchdog;
mod work;
