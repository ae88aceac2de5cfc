//! `visage-bench gallery`: what the index over a million models takes, how fast it answers, and whether it answers
//! right.

mod check;
mod load;
mod mapped;
pub mod population;

use std::time::Instant;

use anyhow::Context;
use clap::Args;
use nix::sys::resource::{UsageWho, getrusage};
use rayon::prelude::*;

use load::Question;
use population::Population;
use visage::gallery::gallery::FULL_SEGMENT;
use visage::gallery::{Gallery, IndexedModel, ModelId};

/// How large the gallery is and what it is asked.
#[derive(Debug, Args)]
pub struct GalleryArgs {
    /// Code-made models
    #[arg(long, default_value_t = 1_000_000)]
    models: u64,
    /// Queries of each kind
    #[arg(long, default_value_t = 500)]
    queries: usize,
    /// Queries a second; they come in whether or not earlier ones are answered
    #[arg(long, default_value_t = 50.0)]
    rate: f64,
    /// Models wanted by each query
    #[arg(long, default_value_t = 100)]
    limit: usize,
    /// Queries of each kind whose answers are compared with those of brute force
    #[arg(long, default_value_t = 3)]
    checked: usize,
    /// Asks everything a second time, of the same segments mapped from files, and compares the answers
    #[arg(long)]
    mapped: bool,
}

/// Builds the index, asks it, checks it, and prints a table.
pub fn run(args: GalleryArgs) -> anyhow::Result<()> {
    let population = Population::described()?;
    eprintln!("the shapes that models are made from are described");
    let before = resident_mib();
    let (gallery, built) = build(&population, args.models);
    let after = resident_mib();
    println!("| | |\n| --- | ---: |\n| models | {} |", gallery.len());
    println!("| build, CPU s | {:.1} |\n| build, wall s | {:.1} |", built.cpu_seconds, built.wall_seconds);
    println!("| index, MiB | {:.0} |\n| peak of the process, MiB | {:.0} |", after - before, peak_mib());
    let mapped = args.mapped.then(|| mapped::of(&gallery)).transpose()?;
    println!(
        "\n| query | queries | p50 ms | p99 ms | most ms | CPU ms a query |\n| --- | ---: | ---: | ---: | ---: | ---: |"
    );
    for kind in Question::KINDS {
        let questions: Vec<Question> = (0..args.queries)
            .into_par_iter()
            .map(|k| Question::new(kind, &population, args.models, k as u64))
            .collect();
        println!("{}", load::answered(&gallery, kind, &questions, args.limit, args.rate));
        if let Some((mapped, _folder)) = &mapped {
            println!("{} mapped", load::answered(mapped, kind, &questions, args.limit, args.rate));
            mapped::compare(&gallery, mapped, &questions, args.limit)?;
        }
    }
    if args.checked > 0 {
        let compared = check::compare(&gallery, &population, args.models, args.checked, args.limit)?;
        println!("\n{compared} answers of {} models each are those of brute force.", args.limit);
    }
    Ok(())
}

/// What building took.
struct Built {
    cpu_seconds: f64,
    wall_seconds: f64,
}

/// Builds segment by segment; making the signatures is not counted.
fn build(population: &Population, models: u64) -> (Gallery, Built) {
    let mut gallery = Gallery::default();
    let mut built = Built { cpu_seconds: 0.0, wall_seconds: 0.0 };
    let numbers: Vec<u64> = (0..models).collect();
    for chunk in numbers.chunks(FULL_SEGMENT) {
        let signatures: Vec<_> = chunk.par_iter().map(|&k| (ModelId::from(k), population.model(k))).collect();
        let (cpu, wall) = (cpu_seconds(), Instant::now());
        let entries: Vec<IndexedModel> = signatures.into_par_iter().map(|(id, s)| IndexedModel::new(id, s)).collect();
        gallery.append(&entries);
        drop(entries);
        built.cpu_seconds += cpu_seconds() - cpu;
        built.wall_seconds += wall.elapsed().as_secs_f64();
        eprintln!("{} of {models} models after {:.1} CPU seconds", gallery.len(), built.cpu_seconds);
    }
    (gallery, built)
}

/// CPU seconds of this process.
pub(super) fn cpu_seconds() -> f64 {
    let Ok(usage) = getrusage(UsageWho::RUSAGE_SELF) else { return f64::NAN };
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + 1e-6 * time.tv_usec() as f64;
    seconds(usage.user_time()) + seconds(usage.system_time())
}

pub(super) fn peak_mib() -> f64 {
    visage::machine::peak_memory_bytes().map_or(f64::NAN, |bytes| bytes as f64 / f64::from(1 << 20))
}

/// Memory of this process now.
pub(super) fn resident_mib() -> f64 {
    let pages = || -> anyhow::Result<f64> {
        let text = std::fs::read_to_string("/proc/self/statm")?;
        Ok(text.split_whitespace().nth(1).context("no second field")?.parse()?)
    };
    pages().map_or(f64::NAN, |pages| pages * 4096.0 / f64::from(1 << 20))
}
