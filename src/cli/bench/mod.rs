//! `visage bench`: experiments that show what visage is worth, to be repeated by anyone.

pub mod alone;
mod child;
pub mod cost;
pub mod faces;
pub mod gallery;
pub mod paper;
pub mod scale;
pub mod start;
pub mod who;

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
    /// Stanford's sets from their scans alone: in many orders; and pairs of scans that were made worse.
    Alone(alone::AloneArgs),
    /// Faces against other things, step by step; landmarks; what disturbances do.
    Faces(faces::FacesArgs),
    /// The index over a million code-made models: memory, time to build, times of queries, answers against brute force.
    Gallery(gallery::GalleryArgs),
    /// How long the gallery takes to be loaded from the database.
    Start(start::StartArgs),
    /// Whether a third of a noisy, turned head tells whose it is, among a thousand code-made ones.
    Who(who::WhoArgs),
    /// Where the CPU time of a registration goes, in passes of neighbour search.
    Cost(cost::CostArgs),
    /// What a registration costs as the views of one code-made object grow in number.
    Scale(scale::ScaleArgs),
}

/// Runs the experiment that the arguments name.
pub fn run(args: BenchArgs) -> anyhow::Result<()> {
    match args.bench {
        Bench::Paper(args) => paper::run(args),
        Bench::Alone(args) => alone::run(args),
        Bench::Faces(args) => faces::run(args),
        Bench::Gallery(args) => gallery::run(args),
        Bench::Start(args) => start::run(args),
        Bench::Who(args) => who::run(args),
        Bench::Cost(args) => cost::run(args),
        Bench::Scale(args) => scale::run(args),
    }
}
