//! What this process has done since it began, for whoever watches it.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use crate::machine;
use visage_domain::{JobRecord, JobStatus};

/// What this process takes of its machine; `None` where the system does not say.
#[derive(Debug, Clone, Copy)]
pub struct Footprint {
    /// Memory now.
    pub memory_bytes: Option<u64>,
    /// The most memory so far.
    pub peak_memory_bytes: Option<u64>,
    /// Seconds that processors have worked for it.
    pub cpu_seconds: Option<f64>,
}

impl Footprint {
    /// As it is now.
    pub fn now() -> Footprint {
        Footprint {
            memory_bytes: machine::resident_memory_bytes(),
            peak_memory_bytes: machine::peak_memory_bytes(),
            cpu_seconds: machine::cpu_seconds(),
        }
    }
}

/// Counts that only grow.
#[derive(Debug, Default)]
pub struct Figures(Mutex<Done>);

/// What was done so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Done {
    /// Runs of jobs by kind and how they ended: a status, or `given_back` for one that will be run again.
    pub jobs: BTreeMap<(String, &'static str), u64>,
    /// Stages: how many runs came to each, and the seconds that it took in all.
    pub stages: BTreeMap<String, (u64, f64)>,
    /// Attempts to deliver messages to webhooks, by what came of them: `delivered`, `failed` (it is sent again), `dead`.
    pub messages: BTreeMap<&'static str, u64>,
}

impl Figures {
    /// Counts a run of a job that has just ended.
    pub(crate) fn job_ended(&self, job: &JobRecord) {
        let end = match job.status {
            JobStatus::Queued | JobStatus::Running => "given_back",
            ended => ended.name(),
        };
        let mut done = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *done.jobs.entry((job.kind.name().to_owned(), end)).or_default() += 1;
        for (stage, seconds) in &job.stage_seconds {
            let (runs, all) = done.stages.entry(stage.clone()).or_default();
            *runs += 1;
            *all += seconds;
        }
    }

    /// Counts an attempt to deliver a message.
    pub(crate) fn message_sent(&self, end: &'static str) {
        let mut done = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *done.messages.entry(end).or_default() += 1;
    }

    /// What was done so far.
    pub fn done(&self) -> Done {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
