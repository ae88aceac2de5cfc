//! `visage export` and `visage import`: the gallery as one file, for a program of another version.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use tokio::runtime::Runtime;

use super::database::DatabaseArgs;
use super::objects::ObjectsArgs;
use crate::app::engine::PipelineEngine;
use crate::app::exchange::{self, Exported, Imported};
use crate::config::{Limits, ServerConfig};
use crate::storage::data_folder::{DataFolder, Places};

/// How much is read or written at a time.
const CHUNK: usize = 1 << 20;

/// What is written, and where to.
#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// The file that is made, or - for standard output; there must be none
    file: PathBuf,
    /// The data folder; no server may be using it (of one that runs, export what `visage backup` made)
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    database: DatabaseArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
}

/// What is read, and where to.
#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// What `visage export` has written, by this program, or one of another version; - for standard input
    file: PathBuf,
    /// The data folder that it goes into, beside what is there; made if there is none. No server may be using it
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    database: DatabaseArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
}

/// Writes all models and standards of a folder into a file.
pub(super) fn export(args: ExportArgs) -> anyhow::Result<()> {
    anyhow::ensure!(args.data.is_dir(), "{} is no folder", args.data.display());
    let (runtime, data) = opened(&args.data, &args.database, &args.objects)?;
    let written = if is_standard(&args.file) {
        exchange::export(&data.storage, runtime.handle(), io::stdout().lock()).map_err(anyhow::Error::from)
    } else {
        export_to(&args.file, &data, &runtime)
    };
    runtime.block_on(data.storage.database.close());
    let Exported { models, standards, bytes } = written?;
    eprintln!("{models} models and {standards} standards written, {} MB", bytes / 1_000_000);
    Ok(())
}

/// Under a name of its own until it is whole.
fn export_to(file: &Path, data: &DataFolder, runtime: &Runtime) -> anyhow::Result<Exported> {
    if file.exists() {
        bail!("{} is there already: choose another name", file.display());
    }
    let mut part = file.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let doing = || format!("writing {}", part.display());
    let result = create_private(&part).with_context(doing).and_then(|made| {
        let mut to = BufWriter::with_capacity(CHUNK, made);
        let written = exchange::export(&data.storage, runtime.handle(), &mut to)?;
        to.into_inner().map_err(io::IntoInnerError::into_error).and_then(|made| made.sync_all()).with_context(doing)?;
        std::fs::rename(&part, file).with_context(doing)?;
        Ok(written)
    });
    if result.is_err() {
        let _ = std::fs::remove_file(&part);
    }
    result
}

/// Faces are in it: nobody else may read it.
fn create_private(file: &Path) -> io::Result<File> {
    let mut options = File::options();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(file)
}

/// Reads all models and standards of a file into a folder.
pub(super) fn import(args: ImportArgs) -> anyhow::Result<()> {
    let from: Box<dyn Read> = if is_standard(&args.file) {
        Box::new(io::stdin().lock())
    } else {
        Box::new(File::open(&args.file).with_context(|| format!("reading {}", args.file.display()))?)
    };
    let (runtime, data) = opened(&args.data, &args.database, &args.objects)?;
    let from = BufReader::with_capacity(CHUNK, from);
    let limits = Limits::default().read_limits();
    let read = exchange::import(&data.storage, runtime.handle(), &PipelineEngine, &limits, from);
    runtime.block_on(data.storage.database.close());
    let read = read.context("what came before is stored, and passed over when it is imported again")?;
    let Imported { models, to_be_described, standards, known, passed_over } = &read;
    println!("{models} models and {standards} standards are new, {known} were there already");
    if *to_be_described > 0 {
        println!(
            "{to_be_described} models have signatures of another version: a server makes them anew when it starts"
        );
    }
    for what in passed_over {
        println!("  not taken: {what}");
    }
    if passed_over.is_empty() { Ok(()) } else { bail!("{} models or standards were not taken", passed_over.len()) }
}

fn is_standard(file: &Path) -> bool {
    file.as_os_str() == "-"
}

/// The folder, taken into use as by a server.
fn opened(folder: &Path, database: &DatabaseArgs, objects: &ObjectsArgs) -> anyhow::Result<(Runtime, DataFolder)> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .context("starting the runtime")?;
    let attempts = ServerConfig::new(([127, 0, 0, 1], 0).into(), folder).queue.max_attempts;
    let objects = objects.settings();
    let places = Places { objects: objects.as_ref(), database: database.database.as_ref() };
    let data = runtime.block_on(async {
        let data = DataFolder::open_with(folder, Duration::ZERO, places).await?;
        data.pick_up(attempts).await?;
        anyhow::Ok(data)
    })?;
    Ok((runtime, data))
}
