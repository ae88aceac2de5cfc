//! Jobs as the workers see them.

use std::time::Duration;

use super::{JobError, JobRecord, NewModel, WorkerId};

/// A worker that looks for a job.
#[derive(Debug, Clone)]
pub struct Claimant {
    /// Its id.
    pub worker: WorkerId,
    /// The workers that live in this process, itself among them. Their jobs are theirs however long they have been
    /// silent: a pause of the machine ends leases, not workers.
    pub living: Vec<WorkerId>,
    /// How long the job is its own without a heartbeat.
    pub lease: Duration,
    /// How often a job is started.
    pub max_attempts: u32,
    /// How much memory there is for jobs, if that is limited.
    pub room: Option<Room>,
}

/// Memory for jobs, in points of scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// What is left beside the jobs that run.
    pub free_points: u64,
    /// What there is in all: a job that needs more is claimed all the same, to be refused.
    pub all_points: u64,
}

/// A job in the hands of a worker.
#[derive(Debug, Clone)]
pub struct JobClaim {
    /// The job as it was when it was claimed.
    pub job: JobRecord,
    /// Whose it is.
    pub worker: WorkerId,
    /// Points of its scans.
    pub points: u64,
}

/// How a worker ends its job.
#[derive(Debug, Clone)]
pub enum Finish {
    /// With a model, or without one for an evaluation.
    Succeeded(Option<Box<NewModel>>),
    /// With an error.
    Failed(JobError),
    /// On request.
    Canceled,
}
