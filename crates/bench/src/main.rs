//! Experiments that show what visage is worth, to be repeated by anyone. Never shipped; nothing depends on it. A new one is a file
//! here, a variant of `Bench`, and its arm in `main`.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod alone;
mod child;
mod cost;
mod faces;
mod gallery;
mod paper;
mod scale;
mod start;
mod surface;
mod who;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Repeats published experiments, and measures accuracy and cost, and writes the results as Markdown.
#[derive(Debug, Parser)]
#[command(name = "visage-bench", version, about)]
struct Arguments {
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
    /// Surfaces of scans: points that were left out, the truth, handles, cost.
    Surface(surface::SurfaceArgs),
}

fn main() -> ExitCode {
    // `visage-bench ... | head` ends quietly when its reader does
    sigpipe::reset();
    let done = match Arguments::parse().bench {
        Bench::Paper(args) => paper::run(args),
        Bench::Alone(args) => alone::run(args),
        Bench::Faces(args) => faces::run(args),
        Bench::Gallery(args) => gallery::run(args),
        Bench::Start(args) => start::run(args),
        Bench::Who(args) => who::run(args),
        Bench::Cost(args) => cost::run(args),
        Bench::Scale(args) => scale::run(args),
        Bench::Surface(args) => surface::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("visage-bench: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Arguments::command().debug_assert();
    }
}
