//! `visage-bench start`: how long the gallery takes to be loaded from the database, as at the start of a server.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use rayon::prelude::*;

use super::gallery::population::Population;
use visage::app::live_gallery::LiveGallery;
use visage::domain::{ModelId, NewModel, StoredSignature};
use visage::geometry::Unit;
use visage::storage::database::{Models, Upkeep};
use visage::storage::sqlite::SqliteDatabase;

/// How many models are stored.
#[derive(Debug, Args)]
pub struct StartArgs {
    /// Code-made models
    #[arg(long, default_value_t = 100_000)]
    models: u64,
    /// A folder for the database; made if it isn't there [default: a temporary one]
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Models stored in one transaction.
const AT_ONCE: usize = 10_000;

/// Fills a database, loads the gallery from it and prints what that took.
pub fn run(args: StartArgs) -> anyhow::Result<()> {
    let population = Population::described()?;
    let temporary = tempfile::tempdir().context("making a temporary folder")?;
    let folder = args.out.unwrap_or_else(|| temporary.path().to_owned());
    std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
    let file = folder.join("visage.sqlite");
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("starting the runtime")?;
    runtime.block_on(async {
        let database = SqliteDatabase::open(&file).await?;
        let numbers: Vec<u64> = (0..args.models).collect();
        for chunk in numbers.chunks(AT_ONCE) {
            let models: Vec<NewModel> = chunk.par_iter().map(|&number| model(&population, number)).collect();
            database.create_models(&models).await?;
        }
        let gallery = LiveGallery::default();
        let (cpu, wall) = (super::gallery::cpu_seconds(), Instant::now());
        let models = gallery.load(&database).await?;
        let (cpu, wall) = (super::gallery::cpu_seconds() - cpu, wall.elapsed().as_secs_f64());
        let mib = std::fs::metadata(&file)?.len() as f64 / f64::from(1 << 20);
        println!("| models | database, MiB | loaded in, wall s | CPU s | CPU us a model |\n| ---: | ---: | ---: | ---: | ---: |");
        println!("| {models} | {mib:.0} | {wall:.1} | {cpu:.1} | {:.0} |", 1e6 * cpu / models.max(1) as f64);
        database.close().await;
        Ok(())
    })
}

fn model(population: &Population, number: u64) -> NewModel {
    let signature = population.model(number);
    NewModel {
        id: ModelId::new(),
        origin: None,
        name: format!("model {number}"),
        label: None,
        unit: Unit::Unknown,
        points: 0,
        quality: None,
        assets: Vec::new(),
        reading: None,
        signature: Some(StoredSignature::from(&signature)),
    }
}
