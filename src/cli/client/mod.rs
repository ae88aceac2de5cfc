//! The commands that talk to a running service: `upload`, `jobs`, `models`, `bin`, `query`, `report`.

pub(super) mod bin;
pub(super) mod http;
pub(super) mod jobs;
pub(super) mod models;
mod parcel;
mod pieces;
pub(super) mod query;
pub(super) mod report;
mod rows;
pub(super) mod upload;
pub(super) mod watch;

use std::future::Future;

use anyhow::Context;
use clap::Args;

use self::http::Client;

/// Which service is asked, and how answers are printed.
#[derive(Debug, Args)]
pub(super) struct Connection {
    /// The address of the service
    #[arg(long, global = true, env = "VISAGE_SERVER", value_name = "URL", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// The key that the service knows you by, if it wants one
    #[arg(long, global = true, env = "VISAGE_KEY", hide_env_values = true)]
    key: Option<String>,
    /// Print what the service answers, as JSON
    #[arg(long, global = true)]
    json: bool,
}

impl Connection {
    fn client(&self) -> anyhow::Result<Client> {
        Client::new(&self.server, self.key.as_deref())
    }
}

/// Waits for a command on a runtime of its own.
fn block_on(command: impl Future<Output = anyhow::Result<()>>) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("starting the runtime")?;
    runtime.block_on(command)
}

/// Prints an answer as it came.
fn print_json(answer: &serde_json::Value) -> anyhow::Result<()> {
    println!("{}", serde_json::to_string_pretty(answer)?);
    Ok(())
}
