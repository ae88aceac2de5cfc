//! `visage-bench start`: how long the gallery takes to be loaded, as at the start of a server: from signatures, and from the files made of them.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use rayon::prelude::*;

use super::gallery::population::Population;
use visage::app::live_gallery::LiveGallery;
use visage::domain::{ModelId, NewModel, StoredSignature};
use visage::gallery::TopK;
use visage::geometry::Unit;
use visage::storage::data_folder::DataFolder;
use visage::storage::inventory::Storage;

/// How many models are stored.
#[derive(Debug, Args)]
pub struct StartArgs {
    /// Code-made models
    #[arg(long, default_value_t = 100_000)]
    models: u64,
    /// A data folder; filled if it is new, else started from as it is [default: a temporary one]
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Models stored in one transaction.
const AT_ONCE: usize = 10_000;

/// Fills a data folder, loads the gallery from it twice, from signatures and from the files made of them, and prints what that took.
pub fn run(args: StartArgs) -> anyhow::Result<()> {
    let population = Population::described()?;
    let temporary = tempfile::tempdir().context("making a temporary folder")?;
    let folder = args.out.unwrap_or_else(|| temporary.path().to_owned());
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("starting the runtime")?;
    println!(
        "| start from | models | ready, wall s | CPU s | first answer, ms | resident, MiB | peak, MiB |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    );
    runtime.block_on(async {
        let data = DataFolder::open(&folder, Duration::ZERO).await?;
        let there = data.storage.database.census().await?.models;
        if there == 0 {
            let numbers: Vec<u64> = (0..args.models).collect();
            for chunk in numbers.chunks(AT_ONCE) {
                let models: Vec<NewModel> = chunk.par_iter().map(|&number| model(&population, number)).collect();
                data.storage.database.create_models(&models).await?;
            }
            start("signatures", &data.storage, &population, args.models).await?;
        }
        // in a folder that was made before, this is the first thing that the process does with it
        start("files", &data.storage, &population, args.models).await?;
        let records = data.storage.database.segments().await?;
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let database = std::fs::metadata(folder.join("visage.sqlite"))?.len();
        let files: u64 = records.iter().map(|record| record.bytes).sum();
        println!("\ndatabase {:.0} MiB, {} files of {:.0} MiB", mib(database), records.len(), mib(files));
        data.storage.database.close().await;
        Ok(())
    })
}

/// Loads the gallery, asks it once, and prints a row.
async fn start(from: &str, storage: &Storage, population: &Population, models: u64) -> anyhow::Result<()> {
    let probe = population.model(models + 1);
    let gallery = LiveGallery::default();
    let (cpu, wall) = (super::gallery::cpu_seconds(), Instant::now());
    let loaded = gallery.load(storage).await?;
    let (cpu, ready) = (super::gallery::cpu_seconds() - cpu, wall.elapsed().as_secs_f64());
    let asked = Instant::now();
    let found = gallery.ask(|gallery| gallery.by_probe(&probe, None, &TopK::best(20)))?;
    anyhow::ensure!(!found.is_empty(), "nothing was found");
    let (answer, resident) = (1e3 * asked.elapsed().as_secs_f64(), super::gallery::resident_mib());
    let peak = super::gallery::peak_mib();
    println!("| {from} | {loaded} | {ready:.2} | {cpu:.2} | {answer:.0} | {resident:.0} | {peak:.0} |");
    Ok(())
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
