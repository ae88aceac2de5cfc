//! What runs now: live progress, stop flags, and a bell for everybody who waits for a change.

use std::collections::{BTreeSet, HashMap};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use tokio::sync::{Notify, watch};

use super::figures::Figures;
use super::tracker::Tracker;
use visage_domain::{JobId, JobKind, JobRecord, JobStatus, WorkerId};

/// Jobs of which it is kept by which request they were ordered.
const MOST_ORDERED: usize = 10_000;

/// Why a running job is to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// Somebody asked for it.
    Canceled,
    /// The server goes down: the job will be run again.
    Shutdown,
    /// The lease was lost: the job is somebody else's.
    LeaseLost,
    /// It has shown no sign of life for too long.
    Stuck,
}

/// Tells a job's algorithms to stop, and its worker why.
#[derive(Debug, Default)]
pub struct StopFlag {
    raised: Arc<AtomicBool>,
    reason: OnceLock<StopReason>,
}

impl StopFlag {
    /// Asks for a stop; the first reason counts.
    pub fn raise(&self, reason: StopReason) {
        self.reason.get_or_init(|| reason);
        self.raised.store(true, Ordering::Relaxed);
    }

    /// The flag as the algorithms know it.
    pub fn flag(&self) -> Arc<AtomicBool> {
        self.raised.clone()
    }

    /// Why the job is to stop, if it is.
    pub fn reason(&self) -> Option<StopReason> {
        self.reason.get().copied()
    }
}

/// A running job.
#[derive(Debug, Clone)]
struct Running {
    tracker: Arc<Tracker>,
    stop: Arc<StopFlag>,
    points: u64,
}

/// The jobs that run in this process, and the bells.
#[derive(Debug)]
pub struct JobMonitor {
    running: Mutex<HashMap<JobId, Running>>,
    left_behind: Mutex<Vec<u64>>,
    workers: Mutex<BTreeSet<WorkerId>>,
    /// By which request a job was ordered, as its `traceparent`, until it begins.
    ordered: Mutex<HashMap<JobId, String>>,
    changes: watch::Sender<u64>,
    status_changes: watch::Sender<u64>,
    work: Notify,
    /// What was done so far.
    pub figures: Figures,
    /// One worker claims at a time: what the next may claim depends on what the one before has.
    pub(crate) claiming: tokio::sync::Mutex<()>,
}

impl Default for JobMonitor {
    fn default() -> Self {
        JobMonitor {
            running: Mutex::default(),
            left_behind: Mutex::default(),
            workers: Mutex::default(),
            ordered: Mutex::default(),
            changes: watch::Sender::new(0),
            status_changes: watch::Sender::new(0),
            work: Notify::new(),
            figures: Figures::default(),
            claiming: tokio::sync::Mutex::default(),
        }
    }
}

impl JobMonitor {
    /// Tells the workers that a job waits, and everybody else that something changed.
    pub fn announce_work(&self) {
        self.work.notify_one();
        self.announce_change();
    }

    /// Tells everybody who waits that some job, or a message to a webhook, has changed.
    pub fn announce_change(&self) {
        self.status_changes.send_modify(|count| *count = count.wrapping_add(1));
        self.announce_progress();
    }

    /// Tells those who follow a job that it has come further.
    pub fn announce_progress(&self) {
        self.changes.send_modify(|count| *count = count.wrapping_add(1));
    }

    /// Rings as [`JobMonitor::changes`] does, but not when a job has only come further: hundreds may wait for ends, and each job comes
    /// further hundreds of times.
    pub fn status_changes(&self) -> watch::Receiver<u64> {
        self.status_changes.subscribe()
    }

    /// Rings whenever some job, or a message to a webhook, has changed.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Says by which request a job was ordered. Of more than wait at a time in any queue nothing is kept.
    pub(crate) fn ordered(&self, id: JobId, traceparent: String) {
        let mut ordered = self.ordered.lock().unwrap_or_else(PoisonError::into_inner);
        if ordered.len() < MOST_ORDERED {
            ordered.insert(id, traceparent);
        }
    }

    /// By which request a job was ordered in this process, said once.
    pub(crate) fn taken_up(&self, id: JobId) -> Option<String> {
        self.ordered.lock().unwrap_or_else(PoisonError::into_inner).remove(&id)
    }

    /// Waits for a job to be announced.
    pub(crate) async fn work_announced(&self) {
        self.work.notified().await;
    }

    /// Says that a worker lives for as long as the answer does.
    pub(crate) fn hire(self: &Arc<Self>, id: WorkerId) -> Hired {
        self.workers().insert(id);
        Hired { monitor: self.clone(), id }
    }

    /// The workers that live.
    pub(crate) fn living(&self) -> Vec<WorkerId> {
        self.workers().iter().copied().collect()
    }

    /// Points of the scans of all jobs that run, and of those whose threads were left behind: both are in memory.
    pub(crate) fn running_points(&self) -> u64 {
        self.lock().values().map(|running| running.points).chain(self.left().iter().copied()).sum()
    }

    /// Says that the thread of a job with so many points goes on though the job has ended, for as long as the answer lives.
    pub(crate) fn leave_behind(self: &Arc<Self>, points: u64) -> LeftBehind {
        self.left().push(points);
        LeftBehind { monitor: self.clone(), points }
    }

    /// How many threads go on though their jobs have ended.
    pub fn left_behind(&self) -> usize {
        self.left().len()
    }

    /// Shows a job as running for as long as the answer lives.
    pub(crate) fn enter(self: &Arc<Self>, id: JobId, kind: JobKind, points: u64) -> Entry {
        let bell = Arc::downgrade(self);
        let ring = move || {
            if let Some(monitor) = bell.upgrade() {
                monitor.announce_progress();
            }
        };
        let tracker = Arc::new(match kind {
            JobKind::Register | JobKind::Surface => Tracker::new(ring),
            JobKind::Evaluate => Tracker::of_one_stage(ring),
        });
        let running = Running { tracker, stop: Arc::new(StopFlag::default()), points };
        self.lock().insert(id, running.clone());
        Entry { monitor: self.clone(), id, tracker: running.tracker, stop: running.stop }
    }

    /// Stops a job that runs here, without waiting for its next heartbeat.
    pub fn cancel(&self, id: JobId) {
        if let Some(running) = self.lock().get(&id) {
            running.stop.raise(StopReason::Canceled);
        }
        self.announce_change();
    }

    /// Whether a job runs in this process: its end rings the bell after that.
    pub fn runs(&self, id: JobId) -> bool {
        self.lock().contains_key(&id)
    }

    /// Puts the live progress over what the last heartbeat wrote.
    pub fn refresh(&self, job: &mut JobRecord) {
        if job.status != JobStatus::Running {
            return;
        }
        let tracker = self.lock().get(&job.id).map(|running| running.tracker.clone());
        if let Some(tracker) = tracker {
            let now = tracker.snapshot();
            job.stage = now.stage.map(|stage| stage.name().to_owned());
            job.progress = now.progress;
            job.stage_seconds = now.stage_seconds;
        }
    }

    fn workers(&self) -> std::sync::MutexGuard<'_, BTreeSet<WorkerId>> {
        self.workers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn left(&self) -> std::sync::MutexGuard<'_, Vec<u64>> {
        self.left_behind.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<JobId, Running>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A worker that lives.
#[derive(Debug)]
pub(crate) struct Hired {
    monitor: Arc<JobMonitor>,
    id: WorkerId,
}

impl Drop for Hired {
    fn drop(&mut self) {
        self.monitor.workers().remove(&self.id);
        // what it left running is for the others
        self.monitor.announce_work();
    }
}

/// A thread that goes on though its job has ended.
#[derive(Debug)]
pub(crate) struct LeftBehind {
    monitor: Arc<JobMonitor>,
    points: u64,
}

impl Drop for LeftBehind {
    fn drop(&mut self) {
        let mut left = self.monitor.left();
        if let Some(index) = left.iter().position(|points| *points == self.points) {
            left.swap_remove(index);
        }
        drop(left);
        // there may be room now for one that waits
        self.monitor.announce_work();
    }
}

/// A running job's entry in the monitor.
#[derive(Debug)]
pub(crate) struct Entry {
    monitor: Arc<JobMonitor>,
    id: JobId,
    pub(crate) tracker: Arc<Tracker>,
    pub(crate) stop: Arc<StopFlag>,
}

impl Drop for Entry {
    fn drop(&mut self) {
        // whoever still works on it works for nobody
        self.stop.raise(StopReason::LeaseLost);
        self.monitor.lock().remove(&self.id);
        // there may be room now for one that waits
        self.monitor.announce_work();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_domain::{Owner, SeatId};

    #[test]
    fn the_first_reason_counts() {
        let stop = StopFlag::default();
        assert_eq!(stop.reason(), None);
        stop.raise(StopReason::Shutdown);
        stop.raise(StopReason::Canceled);
        assert_eq!(stop.reason(), Some(StopReason::Shutdown));
        assert!(stop.flag().load(Ordering::Relaxed));
    }

    #[tokio::test]
    async fn a_cancel_reaches_the_job_and_rings_the_bell() {
        let monitor = Arc::new(JobMonitor::default());
        let id = JobId::new();
        let entry = monitor.enter(id, JobKind::Register, 30);
        assert_eq!(monitor.running_points(), 30);
        let mut changes = monitor.changes();
        monitor.cancel(id);
        assert_eq!(entry.stop.reason(), Some(StopReason::Canceled));
        changes.changed().await.expect("the monitor lives");
        drop(entry);
        assert!(monitor.lock().is_empty());
    }

    #[tokio::test]
    async fn workers_are_known_as_long_as_they_live() {
        let monitor = Arc::new(JobMonitor::default());
        let owner = Owner::on(SeatId::new());
        let ids = [0, 1].map(|number| owner.worker(number));
        let [a, b] = ids.map(|id| monitor.hire(id));
        assert_eq!(monitor.living(), ids);
        drop(a);
        assert_eq!(monitor.living(), [ids[1]]);
        monitor.work_announced().await;
        drop(b);
    }
}
