//! `visage key`: keys of a service, made, listed and revoked in its data folder, whether it runs or not.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::{Args, Subcommand};
use jiff::{SignedDuration, Timestamp};

use super::database::DatabaseArgs;
use crate::app::access;
use crate::domain::{KeyId, KeyRecord, PageRequest, Scope};
use crate::storage::Database;
use crate::storage::data_folder::open_database;

/// What to do with keys.
#[derive(Debug, Args)]
pub(super) struct KeyArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Make a key and print it; it is told this once. As soon as there was one, every request needs one
    Create(CreateArgs),
    /// List all keys, newest first
    List(FolderArgs),
    /// Revoke a key: a running server refuses it from then on
    Revoke(RevokeArgs),
}

#[derive(Debug, Args)]
struct FolderArgs {
    /// The data folder of the service; a server may be using it
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    database: DatabaseArgs,
}

#[derive(Debug, Args)]
struct CreateArgs {
    #[command(flatten)]
    folder: FolderArgs,
    /// What it is for: a person or a program
    #[arg(long, value_parser = one_line)]
    name: String,
    /// What it allows: metrics, read, write or admin, each with those before it
    #[arg(long, default_value = "read")]
    scope: Scope,
    /// Days after which it is not taken any more [default: never]
    #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(i64).range(1..=36_500))]
    expires_in: Option<i64>,
}

#[derive(Debug, Args)]
struct RevokeArgs {
    #[command(flatten)]
    folder: FolderArgs,
    /// The id of the key, as `visage key list` shows it
    id: String,
}

fn one_line(text: &str) -> Result<String, String> {
    let text = text.trim();
    match text.is_empty() || text.chars().count() > 200 || text.chars().any(char::is_control) {
        true => Err("must have 1 to 200 characters in one line".to_owned()),
        false => Ok(text.to_owned()),
    }
}

/// Does it.
pub(super) fn run(args: KeyArgs) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("starting the runtime")?;
    runtime.block_on(async {
        let folder = match &args.action {
            Action::Create(args) => &args.folder,
            Action::List(folder) => folder,
            Action::Revoke(args) => &args.folder,
        };
        let database = open_database(&folder.data, folder.database.database.as_ref()).await?;
        let done = act(database.as_ref(), &args.action).await;
        database.close().await;
        done
    })
}

async fn act(database: &dyn Database, action: &Action) -> anyhow::Result<()> {
    match action {
        Action::Create(args) => create(database, args).await,
        Action::List(_) => list(database).await,
        Action::Revoke(args) => {
            let Some(id) = KeyId::parse(&args.id) else {
                bail!("{:?} is no id of a key: see `visage key list`", args.id)
            };
            Ok(database.revoke_key(id).await?)
        }
    }
}

async fn create(database: &dyn Database, args: &CreateArgs) -> anyhow::Result<()> {
    let is_first = !database.has_keys().await?;
    let expires_at = args.expires_in.map(|days| Timestamp::now() + SignedDuration::from_hours(24 * days));
    let (key, token) = access::create_key(database, args.name.clone(), args.scope, expires_at).await?;
    // the token alone on standard output, for whoever keeps it in a file
    println!("{token}");
    eprintln!("key {} ({}, {}) is made; it is shown this once", key.id, key.name, key.scope);
    if is_first {
        eprintln!("from now on every request needs a key");
    }
    Ok(())
}

async fn list(database: &dyn Database) -> anyhow::Result<()> {
    let mut page = PageRequest { before: None, limit: 100 };
    loop {
        let keys = database.keys(&page).await?;
        page.before = keys.next_cursor(|key| key.id.to_string());
        keys.items.iter().for_each(print);
        if page.before.is_none() {
            return Ok(());
        }
    }
}

fn print(key: &KeyRecord) {
    let state = match (key.revoked_at, key.expires_at) {
        (Some(time), _) => format!("revoked {time:.0}"),
        (None, Some(time)) if time <= Timestamp::now() => format!("expired {time:.0}"),
        (None, Some(time)) => format!("until {time:.0}"),
        (None, None) => "valid".to_owned(),
    };
    println!("{}  {:<7}  {:<32}  {}", key.id, key.scope.name(), state, key.name);
}
