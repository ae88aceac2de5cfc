//! `visage doctor`: whether a data folder is sound, and what to do where it isn't.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use clap::Args;

use super::database::DatabaseArgs;
use super::objects::ObjectsArgs;
use crate::app::live_gallery::files::damaged_files;
use crate::storage::checkup::{self, Findings};
use crate::storage::data_folder::{DataFolder, Places};

/// How many of a kind are named.
const NAMED: usize = 10;

/// Which folder.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// The data folder; no server may be using it
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    database: DatabaseArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
    /// Move files that the database does not know to the trash of the folder
    #[arg(long)]
    set_aside: bool,
}

/// Reads everything and says what it found; fails if anything has to be done.
pub fn run(args: DoctorArgs) -> anyhow::Result<()> {
    ensure!(args.data.is_dir(), "{} is no folder", args.data.display());
    let runtime = tokio::runtime::Runtime::new().context("starting the runtime")?;
    let objects = args.objects.settings();
    let places = Places { objects: objects.as_ref(), database: args.database.database.as_ref() };
    runtime.block_on(async {
        let data = DataFolder::open_with(&args.data, Duration::ZERO, places).await.map_err(|error| match error {
            error if error.is_of_database() => anyhow::Error::new(error).context(
                "put visage.sqlite back from a backup (and remove visage.sqlite-wal and -shm), or save what can be read \
                 with `sqlite3 visage.sqlite .recover`",
            ),
            error => error.into(),
        })?;
        let mut findings = checkup::examine(&data.storage).await?;
        findings.damaged_segments = damaged_files(&data.storage).await?;
        print(&findings);
        if args.set_aside && !findings.unknown.is_empty() {
            let trash = checkup::set_aside(&data.storage, &mut findings).await?;
            println!("set aside in {trash}");
        }
        data.storage.database.close().await;
        if findings.is_sound() { Ok(()) } else { bail!("the data folder is not sound; see above") }
    })
}

fn print(found: &Findings) {
    println!("{} files and {} signatures read", found.files_read, found.signatures_read);
    list("places where the database is damaged: put it back from a backup", &found.database);
    list(
        "files that the database does not know: put back the database that goes with them, or set them aside with --set-aside",
        &found.unknown.iter().map(ToString::to_string).collect::<Vec<_>>(),
    );
    list(
        "files that are missing: put them back from a backup, or delete what they belong to",
        &found.missing.iter().map(ToString::to_string).collect::<Vec<_>>(),
    );
    list("files that are damaged: put them back from a backup, or upload them again", &found.damaged_files);
    list(
        "models whose signature is damaged: the next start has them made anew",
        &found.damaged_signatures.iter().map(ToString::to_string).collect::<Vec<_>>(),
    );
    list(
        "files of the index that are damaged: the next start makes them anew from signatures",
        &found.damaged_segments,
    );
    if found.left_over > 0 {
        println!("{} file(s) of a crash or a deletion: the next start takes care of them", found.left_over);
    }
    if found.is_sound() {
        println!("sound");
    }
}

fn list(what: &str, items: &[String]) {
    if items.is_empty() {
        return;
    }
    println!("{} {what}", items.len());
    for item in items.iter().take(NAMED) {
        println!("  {item}");
    }
    if items.len() > NAMED {
        println!("  ...");
    }
}
