//! `visage backup` and `visage restore`: a data folder is copied while a server uses it, and put back.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;

use super::objects::ObjectsArgs;
use crate::storage::data_folder::backup::{self, CopyReport};

/// How many of a kind are named.
const NAMED: usize = 10;

/// What is copied, and where to.
#[derive(Debug, Args)]
pub(super) struct BackupArgs {
    /// The folder of the backup; one that was made before is brought up to date
    backup: PathBuf,
    /// The data folder; a server may be using it
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    objects: ObjectsArgs,
    /// Read what the backup has already again, and hold it against its checksums
    #[arg(long)]
    reread: bool,
}

/// What is put back, and where.
#[derive(Debug, Args)]
pub(super) struct RestoreArgs {
    /// The folder of the backup
    backup: PathBuf,
    /// The data folder that is made of it: new, or empty
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
}

/// Brings a backup up to date; fails if something could not be copied.
pub(super) fn back_up(args: BackupArgs) -> anyhow::Result<()> {
    let objects = args.objects.settings();
    let report = runtime()?.block_on(backup::back_up_with(&args.data, &args.backup, args.reread, objects.as_ref()))?;
    println!("{} files copied, {} there already, {} removed", report.new, report.known, report.removed);
    finish(&report, "the backup holds everything else: see what `visage doctor` says of the data folder")
}

/// Puts a backup back; fails if something of it is missing or damaged.
pub(super) fn restore(args: RestoreArgs) -> anyhow::Result<()> {
    let report = runtime()?.block_on(backup::restore(&args.backup, &args.data))?;
    println!("{} files put back", report.new);
    finish(&report, "everything else is put back: a server starts on it, and `visage doctor` names what is missing")
}

fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().context("starting the runtime")
}

fn finish(report: &CopyReport, remedy: &str) -> anyhow::Result<()> {
    list("missing", &report.missing);
    list("damaged", &report.damaged);
    if report.is_whole() { Ok(()) } else { bail!("some files could not be copied: {remedy}") }
}

fn list(what: &str, places: &[String]) {
    for place in places.iter().take(NAMED) {
        println!("  {what}: {place}");
    }
    if places.len() > NAMED {
        println!("  {what}: {} more", places.len() - NAMED);
    }
}
