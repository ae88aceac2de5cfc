//! `visage migrate`: the database of a data folder goes to a server.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use crate::config::DatabaseUrl;
use crate::storage::data_folder::migrate;

/// From where, and where to.
#[derive(Debug, Args)]
pub(super) struct MigrateArgs {
    /// The data folder whose database is moved, such as sqlite:/srv/visage; no server may be using it
    #[arg(long, value_name = "sqlite:DIR", value_parser = folder)]
    from: PathBuf,
    /// The address of a new, empty database, such as postgres://visage@db.example/visage; the password by PGPASSWORD or a file
    /// ~/.pgpass
    #[arg(long, value_name = "URL")]
    to: DatabaseUrl,
}

fn folder(text: &str) -> Result<PathBuf, String> {
    match text.strip_prefix("sqlite:") {
        Some(path) if !path.is_empty() => Ok(PathBuf::from(path)),
        _ => Err("must be sqlite: and a data folder, such as sqlite:/srv/visage".to_owned()),
    }
}

/// Moves it.
pub(super) fn run(args: &MigrateArgs) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    let moved = runtime.context("starting the runtime")?.block_on(migrate::migrate(&args.from, &args.to))?;
    for (table, rows) in moved.iter().filter(|(_, rows)| *rows > 0) {
        println!("{rows:>10}  {table}");
    }
    println!("the database is {} from now on: give --database; the one in the folder is set aside", args.to);
    Ok(())
}
