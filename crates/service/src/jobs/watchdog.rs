//! When a worker gives its job up: one that shows no sign of life is asked to stop, and one that does not stop is left behind.
//!
//! Time is counted in the worker's own heartbeats: while the whole process stands still, neither side is silent.

use std::time::Duration;

use crate::app::monitor::{Entry, StopReason};
use crate::config::QueueTiming;

/// Watches one job.
#[derive(Debug)]
pub(super) struct Watchdog {
    heartbeat: Duration,
    stall: Duration,
    deaf: Duration,
    /// At the last heartbeat; none before the first, when no time has passed yet.
    reports: Option<u64>,
    silent: Duration,
    unheard: Duration,
}

impl Watchdog {
    pub(super) fn new(timing: &QueueTiming) -> Watchdog {
        let none = Duration::ZERO;
        let QueueTiming { heartbeat, stall, deaf, .. } = *timing;
        Watchdog { heartbeat, stall, deaf, reports: None, silent: none, unheard: none }
    }

    /// Called with each heartbeat; whether the job has not stopped for so long that it is left behind.
    pub(super) fn gives_up(&mut self, entry: &Entry) -> bool {
        let reports = Some(entry.tracker.reports());
        self.silent = if reports == self.reports { self.silent + self.heartbeat } else { Duration::ZERO };
        self.reports = reports;
        if self.silent >= self.stall {
            entry.stop.raise(StopReason::Stuck);
        }
        if entry.stop.reason().is_some() {
            self.unheard += self.heartbeat;
        }
        self.unheard > self.deaf
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::app::monitor::JobMonitor;
    use visage_domain::{JobId, JobKind};
    use visage_geometry::progress::{Progress, ProgressSink, Stage};

    fn watched() -> (Watchdog, Entry) {
        let [heartbeat, stall, deaf] = [1, 5, 2].map(Duration::from_secs);
        let timing = QueueTiming { heartbeat, stall, deaf, ..QueueTiming::default() };
        (Watchdog::new(&timing), Arc::new(JobMonitor::default()).enter(JobId::new(), JobKind::Register, 1))
    }

    #[test]
    fn a_job_that_reports_is_never_stopped() {
        let (mut dog, entry) = watched();
        for _ in 0..100 {
            // also where it comes no further
            entry.tracker.report(Stage::Registering, 0.5);
            assert!(!dog.gives_up(&entry));
        }
        assert_eq!(entry.stop.reason(), None);
    }

    #[test]
    fn a_job_that_waits_for_something_else_is_never_stopped() {
        let (mut dog, entry) = watched();
        let progress = Progress::new(entry.tracker.clone(), entry.stop.flag());
        for _ in 0..100 {
            progress.waits().expect("nobody stops it");
            assert!(!dog.gives_up(&entry));
        }
    }

    #[test]
    fn the_first_heartbeat_says_nothing_of_silence() {
        let hour = Duration::from_secs(3600);
        let timing = QueueTiming { heartbeat: hour, stall: hour, ..QueueTiming::default() };
        let (_, entry) = watched();
        let mut dog = Watchdog::new(&timing);
        dog.gives_up(&entry);
        assert_eq!(entry.stop.reason(), None, "it has only begun");
        dog.gives_up(&entry);
        assert_eq!(entry.stop.reason(), Some(StopReason::Stuck));
    }

    #[test]
    fn a_silent_job_is_stopped_and_one_that_does_not_listen_is_left_behind() {
        let (mut dog, entry) = watched();
        entry.tracker.report(Stage::Loading, 0.5);
        let beats: Vec<bool> = (0..9).map(|_| dog.gives_up(&entry)).collect();
        assert_eq!(entry.stop.reason(), Some(StopReason::Stuck));
        // its report is a beat's, five are silent, and from the last of these on three are unheard
        assert_eq!(beats.iter().position(|gives_up| *gives_up), Some(7));
    }

    #[test]
    fn a_canceled_job_that_does_not_listen_is_left_behind_though_it_reports() {
        let (mut dog, entry) = watched();
        entry.stop.raise(StopReason::Canceled);
        let mut beat = || {
            entry.tracker.report(Stage::Registering, 0.5);
            dog.gives_up(&entry)
        };
        assert_eq!([beat(), beat(), beat()], [false, false, true]);
    }
}
