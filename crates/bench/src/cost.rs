//! `visage-bench cost`: where the CPU time of a registration goes, in passes of neighbour search.
//!
//! The unit is the *pass*: every point of one view of each pair with more than half overlap asked for its nearest
//! neighbour in the other view within two spacings. What any full-resolution ICP needs for a single iteration, a whole
//! registration is measured by.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use nix::sys::resource::{UsageWho, getrusage};
use rayon::prelude::*;

use super::child;
use visage::formats::{self, ReadLimits, poses};
use visage::geometry::Motion;
use visage::progress::Progress;
use visage::registration::overlap::overlaps;
use visage::registration::view::{View, common_spacing};

/// What to measure.
#[derive(Debug, Args)]
pub struct CostArgs {
    /// The folder with the scans
    dir: PathBuf,
    /// Initial poses, as for register
    #[arg(long)]
    poses: PathBuf,
    /// Runs of which the cheapest counts
    #[arg(long, default_value_t = 5)]
    runs: usize,
}

/// The stages of a registration that ends with poses and a report.
const STAGES: [&str; 5] = ["loading", "preparing", "registering", "judging", "storing"];
/// Overlap above which a pair takes part in the pass.
const OVERLAP: f64 = 0.5;
/// Distance of neighbours in the pass, in spacings.
const REACH: f64 = 2.0;

/// Runs `visage register` on one thread, where a stage's seconds are CPU seconds but for what it waits for files,
/// measures the pass, and prints a table.
pub fn run(args: CostArgs) -> anyhow::Result<()> {
    ensure!(args.runs > 0, "--runs must be at least 1");
    let temporary = tempfile::tempdir().context("making a temporary folder")?;
    let options = ["--no-cloud", "--no-signature", "--threads", "1"];
    let mut best: Option<child::Run> = None;
    for _ in 0..args.runs {
        let run = child::register(&args.dir, &args.poses, temporary.path(), &options)?;
        if best.as_ref().is_none_or(|best| run.cpu_seconds < best.cpu_seconds) {
            best = Some(run);
        }
    }
    let Some(best) = best else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("starting the worker thread")?;
    let pass = pool.install(|| measure_pass(&args.dir, &temporary.path().join("poses.json"), args.runs))?;
    println!("one pass: {} pairs, {} queries, {:.1} ms", pass.pairs, pass.queries, 1000.0 * pass.seconds);
    println!();
    println!("| stage | ms on one thread | passes |");
    println!("| --- | ---: | ---: |");
    let line = |stage: &str, seconds: f64| {
        println!("| {stage} | {:.0} | {:.1} |", 1000.0 * seconds, seconds / pass.seconds);
    };
    for stage in STAGES {
        line(stage, best.stage_seconds(stage));
    }
    let stages: f64 = STAGES.iter().map(|stage| best.stage_seconds(stage)).sum();
    line("start and end of the process", (best.cpu_seconds - stages).max(0.0));
    line("whole process, CPU", best.cpu_seconds);
    Ok(())
}

struct Pass {
    pairs: usize,
    queries: usize,
    seconds: f64,
}

fn measure_pass(dir: &Path, poses: &Path, runs: usize) -> anyhow::Result<Pass> {
    let bytes = std::fs::read(poses).with_context(|| format!("reading {}", poses.display()))?;
    let posed = poses::read("poses.json", &bytes).context("reading the poses")?.to_map();
    let mut views = Vec::new();
    let mut local_poses: Vec<Motion> = Vec::new();
    for (name, pose) in &posed {
        let path = dir.join(name);
        let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
        let surface = formats::read_surface(name, &bytes, &ReadLimits::default())
            .with_context(|| format!("reading {}", path.display()))?;
        let view = View::new(&surface.cloud).with_context(|| format!("{name} can't be registered"))?;
        local_poses.push(view.local_pose(pose));
        views.push(view);
    }
    let reach = REACH * common_spacing(&views);
    let targets: Vec<_> = views.iter().map(|view| &view.indexed).collect();
    let queries: Vec<_> = views.iter().map(View::points).collect();
    let matrix = overlaps(&targets, &queries, &local_poses, reach, &Progress::silent())?;
    let pairs: Vec<(usize, usize)> = (0..views.len())
        .flat_map(|i| (i + 1..views.len()).map(move |j| (i, j)))
        .filter(|&(i, j)| matrix.mutual(i, j) > OVERLAP)
        .collect();
    let queries = pairs.iter().map(|&(i, _)| views[i].points().len()).sum();
    let mut seconds = f64::INFINITY;
    for _ in 0..runs {
        let before = cpu_seconds()?;
        let found: usize =
            pairs.par_iter().map(|&(i, j)| search(&views[i], &views[j], &local_poses, (i, j), reach)).sum();
        seconds = seconds.min(cpu_seconds()? - before);
        ensure!(found > 0, "no neighbours found: are the poses those of these scans?");
    }
    Ok(Pass { pairs: pairs.len(), queries, seconds })
}

/// Asks for the neighbour of each point of `source` in `target`; how many have one.
fn search(source: &View, target: &View, local_poses: &[Motion], (i, j): (usize, usize), reach: f64) -> usize {
    let motion = local_poses[j].inv_mul(&local_poses[i]).cast::<f32>();
    let reach2 = (reach * reach) as f32;
    let moved = source.points().iter().map(|point| (motion * nalgebra::Point3::from(*point)).coords.into());
    moved.filter(|point| target.indexed.tree.nearest(point, reach2).is_some()).count()
}

/// User seconds of this process.
fn cpu_seconds() -> anyhow::Result<f64> {
    let time = getrusage(UsageWho::RUSAGE_SELF).context("asking for the CPU time")?.user_time();
    Ok(time.tv_sec() as f64 + time.tv_usec() as f64 * 1e-6)
}
