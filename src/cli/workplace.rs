//! What a command that computes needs: threads, a progress bar, and a clock for the stages.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};

use crate::app::tracker::Tracker;
use crate::progress::{Progress, Stage};

/// Threads, and somebody who watches.
pub(super) struct Workplace {
    /// How many threads there are.
    pub threads: usize,
    /// The threads.
    pub pool: rayon::ThreadPool,
    /// How far the work is, and what it took.
    pub tracker: Arc<Tracker>,
    /// What algorithms report to.
    pub progress: Progress,
    bar: ProgressBar,
}

impl Workplace {
    /// With so many threads, one a core if nothing is said.
    pub fn new(threads: Option<usize>) -> anyhow::Result<Self> {
        let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("starting the worker threads")?;
        let bar = progress_bar();
        let tracker = Arc::new_cyclic(|tracker: &std::sync::Weak<Tracker>| {
            let (tracker, bar) = (tracker.clone(), bar.clone());
            Tracker::new(move || {
                if let Some(tracker) = tracker.upgrade() {
                    show(&bar, &tracker);
                }
            })
        });
        let progress = Progress::new(tracker.clone(), Arc::new(AtomicBool::new(false)));
        Ok(Workplace { threads, pool, tracker, progress, bar })
    }

    /// Takes the bar away.
    pub fn done(&self) {
        self.bar.finish_and_clear();
    }
}

fn progress_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:>12} [{wide_bar}] {percent:>3}% {elapsed}")
        .map_or_else(|_| ProgressStyle::default_bar(), |style| style.progress_chars("=> "));
    let bar = ProgressBar::new(1000).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn show(bar: &ProgressBar, tracker: &Tracker) {
    let snapshot = tracker.snapshot();
    bar.set_position((snapshot.progress * 1000.0) as u64);
    bar.set_message(snapshot.stage.map_or("", Stage::name));
}
