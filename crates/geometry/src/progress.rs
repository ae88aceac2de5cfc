//! All that the algorithms know of jobs: a sink they report to and a flag that tells them to stop.
//!
//! The algorithms have no clock: whoever owns the sink notes when a stage began.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A step of a job, in the order in which a job passes through them.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    strum::VariantArray,
    strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Stage {
    /// Reading the scans and checking them.
    Loading,
    /// Trees, spacing, normals and thinned levels of each scan.
    Preparing,
    /// Finding the poses.
    Registering,
    /// Scoring the result: residuals, free space, verdict.
    Judging,
    /// Merging the views into one cloud.
    Merging,
    /// Making a surface of the cloud, with as many triangles as are wanted.
    Surfacing,
    /// Saliency, facial triangles and the signature.
    Describing,
    /// Writing the files of the model.
    Storing,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: &[Stage] = <Stage as strum::VariantArray>::VARIANTS;

    /// The name used in the API, in logs and in reports.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// The share of a whole job (0 to 1) that is done when this stage begins. A rough split by cost:
    /// it only has to make a progress bar move evenly.
    pub fn base(self) -> f64 {
        match self {
            Stage::Loading => 0.0,
            Stage::Preparing => 0.05,
            Stage::Registering => 0.15,
            Stage::Judging => 0.75,
            Stage::Merging => 0.80,
            Stage::Surfacing => 0.83,
            Stage::Describing => 0.90,
            Stage::Storing => 0.96,
        }
    }

    /// The share of a whole job that is done when this stage ends.
    pub fn end(self) -> f64 {
        Stage::ALL.iter().find(|next| **next > self).map_or(1.0, |next| next.base())
    }
}

/// Receives what the algorithms report. Called from worker threads, so it must be quick and must not block.
pub trait ProgressSink: Send + Sync {
    /// `stage` is under way and `fraction` (0 to 1) of that stage is done.
    fn report(&self, stage: Stage, fraction: f64);

    /// The work waits for something else and is alive, though it comes no further.
    fn waits(&self) {}
}

/// The caller asked for a stop; the work was given up where it stood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("canceled on request")]
pub struct Canceled;

/// Handed into every long-running algorithm: where to report, and when to stop. Cheap to clone.
#[derive(Clone)]
pub struct Progress {
    sink: Option<Arc<dyn ProgressSink>>,
    cancel: Arc<AtomicBool>,
}

impl Progress {
    /// Reports to `sink`; stops soon after `cancel` becomes true.
    pub fn new(sink: Arc<dyn ProgressSink>, cancel: Arc<AtomicBool>) -> Self {
        Progress { sink: Some(sink), cancel }
    }

    /// Reports to nobody and is never canceled.
    pub fn silent() -> Self {
        Progress { sink: None, cancel: Arc::new(AtomicBool::new(false)) }
    }

    /// Stops with this one, but reports to nobody: for a part whose stages are not those of the whole.
    pub fn muted(&self) -> Self {
        Progress { sink: None, cancel: self.cancel.clone() }
    }

    /// The same, but whatever is reported is of `stage`, from `from` on to `to` of it: for parts that don't know of what they are a
    /// part.
    pub fn within(&self, stage: Stage, from: f64, to: f64) -> Self {
        let part = |sink: &Arc<dyn ProgressSink>| -> Arc<dyn ProgressSink> {
            Arc::new(Part { sink: sink.clone(), stage, from, to })
        };
        Progress { sink: self.sink.as_ref().map(part), cancel: self.cancel.clone() }
    }

    /// Tells the sink that `fraction` (0 to 1) of `stage` is done.
    pub fn report(&self, stage: Stage, fraction: f64) {
        if let Some(sink) = &self.sink {
            sink.report(stage, fraction.clamp(0.0, 1.0));
        }
    }

    /// `Err(Canceled)` once the caller has asked for a stop. Long loops call this every few milliseconds.
    pub fn check(&self) -> Result<(), Canceled> {
        if self.cancel.load(Ordering::Relaxed) { Err(Canceled) } else { Ok(()) }
    }

    /// The same, for work that waits for something else: it also says that it is alive.
    pub fn waits(&self) -> Result<(), Canceled> {
        if let Some(sink) = &self.sink {
            sink.waits();
        }
        self.check()
    }
}

/// A part of a stage.
struct Part {
    sink: Arc<dyn ProgressSink>,
    stage: Stage,
    from: f64,
    to: f64,
}

impl ProgressSink for Part {
    fn report(&self, _: Stage, fraction: f64) {
        self.sink.report(self.stage, self.from + fraction * (self.to - self.from));
    }

    fn waits(&self) {
        self.sink.waits();
    }
}

impl std::fmt::Debug for Progress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Progress").field("canceled", &self.check().is_err()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_cover_a_job_without_gaps() {
        assert_eq!(Stage::ALL[0].base(), 0.0);
        for pair in Stage::ALL.windows(2) {
            assert!(pair[0].base() < pair[1].base());
            assert_eq!(pair[0].end(), pair[1].base());
        }
        assert_eq!(Stage::Storing.end(), 1.0);
    }

    #[test]
    fn a_part_reports_as_what_it_is_a_part_of() {
        struct Last(std::sync::Mutex<Option<(Stage, f64)>>);
        impl ProgressSink for Last {
            fn report(&self, stage: Stage, fraction: f64) {
                *self.0.lock().expect("sound") = Some((stage, fraction));
            }
        }
        let last = Arc::new(Last(std::sync::Mutex::new(None)));
        let whole = Progress::new(last.clone(), Arc::new(AtomicBool::new(true)));
        let part = whole.within(Stage::Surfacing, 0.5, 0.75);
        part.report(Stage::Merging, 0.5);
        assert_eq!(*last.0.lock().expect("sound"), Some((Stage::Surfacing, 0.625)));
        assert_eq!(part.check(), Err(Canceled));
    }

    #[test]
    fn a_raised_flag_is_seen() {
        let cancel = Arc::new(AtomicBool::new(false));
        let progress = Progress { sink: None, cancel: cancel.clone() };
        assert_eq!(progress.check(), Ok(()));
        cancel.store(true, Ordering::Relaxed);
        assert_eq!(progress.check(), Err(Canceled));
    }
}
