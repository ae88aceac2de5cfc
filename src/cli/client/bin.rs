//! `visage bin`: what was deleted and can still be put back.

use clap::{Args, Subcommand};
use reqwest::Url;
use serde_json::Value;

use super::http::Client;
use super::models::cell;
use super::rows::table;
use super::{Connection, block_on, print_json};

/// What is done with the recycle bin.
#[derive(Debug, Args)]
pub(in super::super) struct BinArgs {
    #[command(flatten)]
    connection: Connection,
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Debug, Subcommand)]
enum What {
    /// What was deleted last (what is done if nothing is said)
    List {
        /// At most so many
        #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100))]
        limit: u32,
    },
    /// Put back a model, a job or a scan set, with all that was deleted with it
    Restore { id: String },
    /// Remove one for good
    Delete { id: String },
    /// Remove all of them for good
    Empty,
}

/// Asks, and prints what is answered.
pub(in super::super) fn run(args: BinArgs) -> anyhow::Result<()> {
    let client = args.connection.client()?;
    let json = args.connection.json;
    block_on(async {
        match args.what.unwrap_or(What::List { limit: 20 }) {
            What::List { limit } => {
                let answer = page(&client, limit).await?;
                if json {
                    return print_json(&answer);
                }
                print!("{}", table(HEADS, &items(&answer).map(row).collect::<Vec<_>>()));
                Ok(())
            }
            What::Restore { id } => {
                let entry: Value = client.post(client.url(&["v1", "bin", &id, "restore"]), &()).await?;
                if json {
                    return print_json(&entry);
                }
                print!("{}", table(HEADS, &[row(&entry)]));
                Ok(())
            }
            What::Delete { id } => client.delete(client.url(&["v1", "bin", &id])).await,
            What::Empty => empty(&client).await,
        }
    })
}

/// Where something is deleted: into the recycle bin, if there is one, or `permanently`.
pub(super) fn deletion(client: &Client, resource: &str, id: &str, permanently: bool) -> Url {
    let mut url = client.url(&["v1", resource, id]);
    if permanently {
        url.query_pairs_mut().append_pair("permanently", "true");
    }
    url
}

async fn page(client: &Client, limit: u32) -> anyhow::Result<Value> {
    let mut url = client.url(&["v1", "bin"]);
    url.query_pairs_mut().append_pair("limit", &limit.to_string());
    client.get(url).await
}

async fn empty(client: &Client) -> anyhow::Result<()> {
    loop {
        let answer = page(client, 100).await?;
        let ids: Vec<String> = items(&answer).map(|entry| cell(&entry["id"])).collect();
        if ids.is_empty() {
            return Ok(());
        }
        for id in ids {
            match client.delete(client.url(&["v1", "bin", &id])).await {
                // it went with what it was made of
                Err(error) if error.downcast_ref::<super::http::Refusal>().is_some_and(|it| it.status == 404) => {}
                done => done?,
            }
        }
    }
}

fn items(answer: &Value) -> impl Iterator<Item = &Value> {
    answer["items"].as_array().into_iter().flatten()
}

const HEADS: [&str; 7] = ["id", "kind", "name", "models", "bytes", "deleted", "gone"];

fn row(entry: &Value) -> [String; 7] {
    ["id", "kind", "name", "models", "bytes", "deleted_at", "expires_at"].map(|field| cell(&entry[field]))
}
