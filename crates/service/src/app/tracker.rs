//! The progress sink of a job: what the algorithms lack, a clock, is here.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use tracing::Span;
use visage_geometry::progress::{ProgressSink, Stage};

/// Progress that is smaller than this is not worth telling anybody.
const STEP: f64 = 0.005;

/// How far a job has come.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Snapshot {
    /// The step under way.
    pub stage: Option<Stage>,
    /// How much of the whole job is done, 0 to 1; never falls.
    pub progress: f64,
    /// Seconds spent in each stage so far.
    pub stage_seconds: BTreeMap<String, f64>,
    /// Processor seconds that the whole process took in each stage so far; empty where the system does not say.
    pub stage_cpu_seconds: BTreeMap<String, f64>,
}

/// Collects what the algorithms report, times the stages, and calls back when there is news.
pub struct Tracker {
    state: Mutex<State>,
    /// Whether the job has one stage, whose fraction is that of the whole job.
    has_one_stage: bool,
    start: Instant,
    on_news: Box<dyn Fn() + Send + Sync>,
}

struct State {
    stage: Option<(Stage, Spent)>,
    progress: f64,
    told: f64,
    reports: u64,
    finished_stages: BTreeMap<Stage, Spent>,
    /// Of the job, and of the stage under way: for those who follow traces.
    job: Span,
    of_stage: Span,
}

/// A time on the clock, and on the processors; or since then.
#[derive(Debug, Clone, Copy, Default)]
struct Spent {
    seconds: f64,
    cpu_seconds: Option<f64>,
}

impl Spent {
    fn now(start: Instant) -> Spent {
        Spent { seconds: start.elapsed().as_secs_f64(), cpu_seconds: crate::machine::cpu_seconds() }
    }

    /// This and what has been spent from `since` until `now`.
    fn plus(self, since: Spent, now: Spent) -> Spent {
        let cpu = now.cpu_seconds.zip(since.cpu_seconds).map(|(now, since)| now - since);
        Spent {
            seconds: self.seconds + now.seconds - since.seconds,
            cpu_seconds: cpu.map(|cpu| self.cpu_seconds.unwrap_or_default() + cpu),
        }
    }
}

impl Tracker {
    /// `on_news` is called from worker threads: it must be quick and must not block.
    pub fn new(on_news: impl Fn() + Send + Sync + 'static) -> Self {
        let state = State {
            stage: None,
            progress: 0.0,
            told: 0.0,
            reports: 0,
            finished_stages: BTreeMap::new(),
            job: Span::none(),
            of_stage: Span::none(),
        };
        Tracker { state: Mutex::new(state), has_one_stage: false, start: Instant::now(), on_news: Box::new(on_news) }
    }

    /// The same for a job of a single stage.
    pub fn of_one_stage(on_news: impl Fn() + Send + Sync + 'static) -> Self {
        Tracker { has_one_stage: true, ..Tracker::new(on_news) }
    }

    /// The span that stages are parts of.
    pub(crate) fn within(&self, job: Span) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).job = job;
    }

    /// How often the algorithms have said something: whether they are alive.
    pub(crate) fn reports(&self) -> u64 {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).reports
    }

    /// How far the job has come; the current stage counts up to now.
    pub fn snapshot(&self) -> Snapshot {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let mut spent = state.finished_stages.clone();
        if let Some((stage, since)) = state.stage {
            let of_stage = spent.entry(stage).or_default();
            *of_stage = of_stage.plus(since, Spent::now(self.start));
        }
        let cpu = |(stage, spent): (&Stage, &Spent)| Some((stage.name().to_owned(), rounded(spent.cpu_seconds?)));
        Snapshot {
            stage: state.stage.map(|(stage, _)| stage),
            progress: state.progress,
            stage_cpu_seconds: spent.iter().filter_map(cpu).collect(),
            stage_seconds: spent.iter().map(|(stage, s)| (stage.name().to_owned(), rounded(s.seconds))).collect(),
        }
    }
}

impl ProgressSink for Tracker {
    fn waits(&self) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).reports += 1;
    }

    fn report(&self, stage: Stage, fraction: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.reports += 1;
        let entered = state.stage.is_none_or(|(current, _)| current != stage);
        if entered {
            let now = Spent::now(self.start);
            state.of_stage = tracing::info_span!(parent: &state.job, "stage", stage = stage.name());
            if let Some((last, since)) = state.stage.replace((stage, now)) {
                let of_stage = state.finished_stages.entry(last).or_default();
                *of_stage = of_stage.plus(since, now);
            }
        }
        let (base, end) = if self.has_one_stage { (0.0, 1.0) } else { (stage.base(), stage.end()) };
        let overall = base + fraction.clamp(0.0, 1.0) * (end - base);
        state.progress = state.progress.max(overall);
        let news = entered || state.progress - state.told >= STEP;
        if news {
            state.told = state.progress;
        }
        drop(state);
        if news {
            (self.on_news)();
        }
    }
}

impl std::fmt::Debug for Tracker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tracker").field("snapshot", &self.snapshot()).finish_non_exhaustive()
    }
}

/// To the millisecond: more digits would be noise.
fn rounded(seconds: f64) -> f64 {
    (seconds * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    #[test]
    fn progress_never_falls_and_stages_are_timed() {
        let tracker = Tracker::new(|| {});
        tracker.report(Stage::Loading, 1.0);
        std::thread::sleep(Duration::from_millis(20));
        tracker.report(Stage::Registering, 0.5);
        let half = tracker.snapshot();
        assert_eq!(half.stage, Some(Stage::Registering));
        assert!((half.progress - 0.45).abs() < 1e-12);
        assert!(half.stage_seconds["loading"] >= 0.02);
        // sleeping takes no processor, but is not the whole process's
        assert_eq!(half.stage_cpu_seconds.len(), half.stage_seconds.len());
        tracker.report(Stage::Registering, 0.2);
        assert_eq!(tracker.snapshot().progress, half.progress);
    }

    #[test]
    fn a_job_of_one_stage_is_done_when_that_is() {
        let tracker = Tracker::of_one_stage(|| {});
        tracker.report(Stage::Describing, 0.25);
        assert_eq!(tracker.snapshot().progress, 0.25);
        tracker.report(Stage::Describing, 1.0);
        assert_eq!(tracker.snapshot().progress, 1.0);
    }

    #[test]
    fn only_news_is_told() {
        let calls = Arc::new(AtomicUsize::new(0));
        let counter = calls.clone();
        let tracker = Tracker::new(move || {
            counter.fetch_add(1, Ordering::Relaxed);
        });
        for i in 0..10_000 {
            tracker.report(Stage::Registering, f64::from(i) / 10_000.0);
        }
        let calls = calls.load(Ordering::Relaxed);
        assert!((50..=200).contains(&calls), "{calls} calls for 60 % of a job in steps of 0.5 %");
    }
}
