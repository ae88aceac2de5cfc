//! `visage-bench paper`: Monte Carlo trials of the paper's experiments on Stanford's range scans.
//!
//! A trial takes one set, disturbs its poses by one level of noise and registers it with every method. Finished trials are
//! kept in a journal, so that an interrupted run goes on where it was.

mod curves;
mod dataset;
mod journal;
mod markdown;
mod reported;
mod starts;
mod statistics;
mod trial;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, ensure};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use self::dataset::Dataset;
pub use self::dataset::conf_of;
use self::journal::{Journal, Settings};
use self::trial::{TrialKey, TrialRecord};

/// The paper's levels of noise: half-widths of the uniform disturbance of rotations, radians.
pub const NOISE: [f64; 3] = [0.02, 0.04, 0.06];
/// The paper's sets.
const SETS: [&str; 3] = ["bunny", "dragon", "happy"];

/// What to run and where the results go.
#[derive(Debug, Args)]
pub struct PaperArgs {
    /// The folder that holds stanford/bunny, stanford/dragon and stanford/happy: range scans (PLY) with their .conf
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Trials for each set and level of noise
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    trials: u32,
    /// Run the paper's methods on all points instead of every 8th
    #[arg(long)]
    full: bool,
    /// Which sets
    #[arg(long, value_delimiter = ',', default_values = SETS, value_parser = SETS)]
    sets: Vec<String>,
    /// The folder for paper.md, the plots and the journal of finished trials
    #[arg(long, value_name = "DIR", default_value = "paper-bench")]
    out: PathBuf,
    /// Trials that run at a time, each on one thread [default: one per core]
    #[arg(long)]
    threads: Option<usize>,
}

/// Runs the trials that the journal doesn't hold yet, and writes the results of all.
pub fn run(args: PaperArgs) -> anyhow::Result<()> {
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    ensure!(threads > 0, "--threads must be at least 1");
    std::fs::create_dir_all(&args.out).with_context(|| format!("making {}", args.out.display()))?;
    let mut journal = Journal::open(&args.out.join("trials.jsonl"), Settings::of(args.full))?;
    let datasets = args
        .sets
        .iter()
        .map(|name| Dataset::read(name, &args.data.join("stanford").join(name), args.full))
        .collect::<anyhow::Result<Vec<Dataset>>>()?;
    let wanted = keys(&datasets, args.trials);
    let missing: Vec<TrialKey> = wanted.iter().filter(|key| !journal.holds(key)).cloned().collect();
    println!("{} trials, {} of them already in the journal", wanted.len(), wanted.len() - missing.len());
    run_trials(&datasets, &missing, threads, &mut journal)?;

    let records: Vec<&TrialRecord> = wanted.iter().filter_map(|key| journal.record(key)).collect();
    for dataset in &datasets {
        let curves = curves::draw(dataset, &records);
        write(&args.out.join(format!("{}.svg", dataset.name)), &curves)?;
    }
    let text = markdown::write(&datasets, &records, &args);
    write(&args.out.join("paper.md"), &text)?;
    println!("{text}\nresults in {}", args.out.display());
    Ok(())
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("writing {}", path.display()))
}

/// All trials wanted: the first trials of every set and level first, so that an interrupted run has some of each.
fn keys(datasets: &[Dataset], trials: u32) -> Vec<TrialKey> {
    let mut keys = Vec::new();
    for trial in 0..trials {
        for dataset in datasets {
            keys.extend((0..NOISE.len()).map(|noise| TrialKey { set: dataset.name.clone(), noise, trial }));
        }
    }
    keys
}

/// Each worker takes the next trial and runs it on a pool of its own with one thread, so that CPU time is the trial's.
fn run_trials(datasets: &[Dataset], missing: &[TrialKey], threads: usize, journal: &mut Journal) -> anyhow::Result<()> {
    let style = ProgressStyle::with_template("[{wide_bar}] {pos}/{len} trials, {elapsed}, {eta} to go")?;
    let bar = ProgressBar::new(missing.len() as u64).with_style(style.progress_chars("=> "));
    let next = AtomicUsize::new(0);
    let journal = Mutex::new(journal);
    let work = || -> anyhow::Result<()> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("starting a worker")?;
        while let Some(key) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
            let dataset = datasets.iter().find(|dataset| dataset.name == key.set).context("a set that was read")?;
            let record = pool.install(|| trial::run(dataset, key))?;
            journal.lock().map_err(|_| anyhow::anyhow!("another worker failed"))?.append(record)?;
            bar.inc(1);
        }
        Ok(())
    };
    let ends: Vec<anyhow::Result<()>> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.min(missing.len())).map(|_| scope.spawn(work)).collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, anyhow::Result<()>>| {
            worker.join().unwrap_or_else(|_| Err(anyhow::anyhow!("a worker panicked")))
        };
        workers.into_iter().map(join).collect()
    });
    bar.finish_and_clear();
    ends.into_iter().collect()
}
