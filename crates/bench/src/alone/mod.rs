//! `visage-bench alone`: registration of Stanford's sets from their scans alone, in many orders, and of single pairs of
//! them that were made worse.

mod damage;
mod orders;
mod pairs;
mod set;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use self::damage::Damage;

/// The sets.
const SETS: [&str; 3] = ["bunny", "dragon", "happy"];

/// What to run.
#[derive(Debug, Args)]
pub struct AloneArgs {
    /// The folder that holds stanford/bunny, stanford/dragon and stanford/happy: range scans (PLY) with their .conf
    #[arg(long, value_name = "DIR", global = true, default_value = ".")]
    data: PathBuf,
    /// Which sets
    #[arg(long, value_delimiter = ',', default_values = SETS, value_parser = SETS, global = true)]
    sets: Vec<String>,
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Whole sets, shuffled and turned at random, against the run from the poses that come with them
    Orders {
        /// How many orders of each set
        #[arg(long, default_value_t = 20)]
        orders: u64,
    },
    /// All pairs of scans, each registered by itself, by class of overlap
    Pairs {
        /// What is done to the scans first
        #[arg(long, value_enum, value_delimiter = ',', default_values_t = Damage::ALL)]
        damage: Vec<Damage>,
        /// Also write the scans and their true poses here, one folder a set and damage, for other programs
        #[arg(long, value_name = "DIR")]
        write: Option<PathBuf>,
    },
}

/// Runs what the arguments say and prints a table.
pub fn run(args: AloneArgs) -> anyhow::Result<()> {
    match args.what {
        What::Orders { orders } => orders::run(&args.data, &args.sets, orders),
        What::Pairs { damage, write } => pairs::run(&args.data, &args.sets, &damage, write.as_deref()),
    }
}
