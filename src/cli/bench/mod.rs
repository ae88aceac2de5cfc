//! `visage bench`: published experiments, repeated.

pub mod paper;

use clap::{Args, Subcommand};

/// Which experiment.
#[derive(Debug, Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    bench: Bench,
}

#[derive(Debug, Subcommand)]
enum Bench {
    /// Tables 1 and 2 of the paper: its method, its two baselines and `joint` on Stanford's scans, from disturbed poses.
    Paper(paper::PaperArgs),
}

/// Runs the experiment that the arguments name.
pub fn run(args: BenchArgs) -> anyhow::Result<()> {
    match args.bench {
        Bench::Paper(args) => paper::run(args),
    }
}
