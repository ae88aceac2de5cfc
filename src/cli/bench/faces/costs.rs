//! What a signature with its verdict costs, on one thread.

use std::fmt::Write;
use std::time::Duration;

use anyhow::Context;
use nix::sys::resource::{UsageWho, getrusage};

use super::{Judged, described};

/// Models of about this many vertices are looked at by themselves.
const USUAL_VERTICES: std::ops::RangeInclusive<usize> = 15_000..=30_000;

/// CPU seconds and vertices of every model, the dearest first, each described once more on a single thread.
pub fn table(all: &[Judged]) -> anyhow::Result<String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("starting the worker thread")?;
    let mut costs: Vec<(f64, usize, &str)> = pool.install(|| all.iter().map(cost).collect::<anyhow::Result<_>>())?;
    costs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut text = String::from("\n## CPU seconds for signature and verdict, one thread\n\n");
    let _ = writeln!(text, "| models | number | mean | dearest |\n| --- | ---: | ---: | ---: |");
    let usual: Vec<f64> = costs.iter().filter(|c| USUAL_VERTICES.contains(&c.1)).map(|c| c.0).collect();
    let whole: Vec<f64> = costs.iter().map(|c| c.0).collect();
    for (name, seconds) in [("all", whole), ("of 15 000 to 30 000 vertices", usual)] {
        let mean = seconds.iter().sum::<f64>() / seconds.len().max(1) as f64;
        let most = seconds.first().copied().unwrap_or(0.0);
        let _ = writeln!(text, "| {name} | {} | {mean:.3} | {most:.3} |", seconds.len());
    }
    let _ = writeln!(text, "\n| model | vertices | CPU s |\n| --- | ---: | ---: |");
    for (seconds, vertices, file) in costs {
        let _ = writeln!(text, "| {file} | {vertices} | {seconds:.3} |");
    }
    Ok(text)
}

fn cost(model: &Judged) -> anyhow::Result<(f64, usize, &str)> {
    let before = cpu_time()?;
    described(&model.surface)?;
    let seconds = (cpu_time()? - before).as_secs_f64();
    Ok((seconds, model.surface.cloud.len(), &model.row.file))
}

/// CPU time of the calling thread.
fn cpu_time() -> anyhow::Result<Duration> {
    let usage = getrusage(UsageWho::RUSAGE_THREAD).context("asking for the CPU time")?;
    let seconds = |time: nix::sys::time::TimeVal| {
        Duration::from_secs(time.tv_sec().unsigned_abs()) + Duration::from_micros(time.tv_usec().unsigned_abs())
    };
    Ok(seconds(usage.user_time()) + seconds(usage.system_time()))
}
