//! One trial: one start, every method.

use serde::{Deserialize, Serialize};

use super::dataset::Dataset;
use super::{NOISE, starts};
use visage::geometry::Motion;
use visage::pipeline::Method;
use visage::progress::Progress;
use visage::registration::averaging::{self, Recipe};
use visage::registration::outcome::{MethodOptions, Outcome};
use visage::registration::pairwise::trimmed_icp::IcpEnd;
use visage::registration::view::View;

/// The methods of the tables, in the paper's order, ours last.
pub const METHODS: [Method; 4] = [Method::LrsL1alm, Method::MaIcp, Method::MaAticp, Method::Joint];

/// Which trial it is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct TrialKey {
    /// The set's name.
    pub set: String,
    /// Index into [`NOISE`].
    pub noise: usize,
    /// Its number, from 0.
    pub trial: u32,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialRecord {
    /// Which trial it was.
    #[serde(flatten)]
    pub key: TrialKey,
    /// Obj of the disturbed poses, mm^2.
    pub start_mm2: f64,
    /// The methods' results.
    pub results: Vec<MethodResult>,
}

/// What one method made of a start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodResult {
    /// Which method.
    pub method: Method,
    /// Obj of its poses, mm^2.
    pub obj_mm2: f64,
    /// Seconds of the one thread that registered; reading and scoring excluded.
    pub seconds: f64,
    /// Rounds, or passes.
    pub rounds: usize,
    /// The share of the last round's pairs whose ICP ended below its threshold.
    pub below_threshold: f64,
}

impl TrialRecord {
    /// The result of a method.
    pub fn of(&self, method: Method) -> Option<&MethodResult> {
        self.results.iter().find(|result| result.method == method)
    }
}

/// Runs every method from the trial's start. Has to be called within a pool of one thread.
pub fn run(dataset: &Dataset, key: &TrialKey) -> anyhow::Result<TrialRecord> {
    let start = starts::disturbed(&dataset.truth, NOISE[key.noise], key.trial);
    let results = METHODS
        .into_iter()
        .map(|method| {
            let views = if recipe(method).is_some() { dataset.views_of_the_paper() } else { &dataset.views };
            let initial: Vec<Motion> = views.iter().zip(&start).map(|(view, pose)| view.local_pose(pose)).collect();
            let begin = clock::seconds();
            let found = register(method, views, &initial)?;
            let seconds = clock::seconds() - begin;
            let poses: Vec<Motion> =
                views.iter().zip(&found.local_poses).map(|(view, pose)| view.scan_pose(pose)).collect();
            let below =
                found.pairs.iter().filter(|pair| pair.icp.is_some_and(|icp| icp.end == IcpEnd::Threshold)).count();
            Ok(MethodResult {
                method,
                obj_mm2: dataset.objective_mm2(&poses),
                seconds,
                rounds: found.rounds.len(),
                below_threshold: below as f64 / found.pairs.len().max(1) as f64,
            })
        })
        .collect::<anyhow::Result<_>>()?;
    Ok(TrialRecord { key: key.clone(), start_mm2: dataset.objective_mm2(&start), results })
}

/// The paper's methods run as in its experiments, others as they are offered.
fn recipe(method: Method) -> Option<Recipe> {
    match method {
        Method::LrsL1alm => Some(Recipe::PAPER_LRS_L1ALM),
        Method::MaIcp => Some(Recipe::PAPER_MA_ICP),
        Method::MaAticp => Some(Recipe::PAPER_MA_ATICP),
        _ => None,
    }
}

fn register(method: Method, views: &[View], initial: &[Motion]) -> anyhow::Result<Outcome> {
    let options = MethodOptions::default();
    let progress = Progress::silent();
    Ok(match recipe(method) {
        Some(recipe) => averaging::register(&recipe, views, initial, &options, &progress)?,
        None => method.register(views, initial, &options, &progress)?,
    })
}

/// CPU seconds of this thread where the system counts them, else wall seconds.
pub mod clock {
    /// What is counted.
    pub const NAME: &str = if cfg!(target_os = "linux") { "CPU seconds" } else { "wall seconds" };

    /// Seconds since some moment.
    #[cfg(target_os = "linux")]
    pub fn seconds() -> f64 {
        use nix::sys::resource::{UsageWho, getrusage};
        use nix::sys::time::TimeValLike;
        let micros = getrusage(UsageWho::RUSAGE_THREAD)
            .map_or(0, |usage| usage.user_time().num_microseconds() + usage.system_time().num_microseconds());
        micros as f64 * 1e-6
    }

    /// Seconds since some moment.
    #[cfg(not(target_os = "linux"))]
    pub fn seconds() -> f64 {
        static BEGIN: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
        BEGIN.elapsed().as_secs_f64()
    }
}
