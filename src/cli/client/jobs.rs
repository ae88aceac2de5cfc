//! `visage jobs`: what is waiting, running and done.

use clap::{Args, Subcommand};
use serde_json::Value;

use super::http::Client;
use super::rows::{plain, table};
use super::{Connection, bin, block_on, print_json, watch};

/// What is done with jobs.
#[derive(Debug, Args)]
pub(in super::super) struct JobsArgs {
    #[command(flatten)]
    connection: Connection,
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The newest jobs (what is done if nothing is said)
    List {
        /// At most so many
        #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100))]
        limit: u32,
    },
    /// One job
    Show { id: String },
    /// Wait for the end of a job; fails if the job does
    Wait { id: String },
    /// Stop a job
    Cancel { id: String },
    /// Run a job again that failed or was canceled
    Retry {
        id: String,
        /// Wait for its end
        #[arg(long)]
        wait: bool,
    },
    /// Delete a job and the model it left
    Delete {
        id: String,
        /// Keep nothing of it in the recycle bin
        #[arg(long)]
        permanently: bool,
    },
}

/// Asks, and prints what is answered.
pub(in super::super) fn run(args: JobsArgs) -> anyhow::Result<()> {
    let client = args.connection.client()?;
    let json = args.connection.json;
    block_on(async {
        match args.what.unwrap_or(What::List { limit: 20 }) {
            What::List { limit } => list(&client, limit, json).await,
            What::Show { id } => show(&client, &id, json).await,
            What::Wait { id } => follow(&client, &id, json).await,
            What::Cancel { id } => print(&client.post(client.url(&["v1", "jobs", &id, "cancel"]), &()).await?, json),
            What::Retry { id, wait } => {
                let again: Value = client.post(client.url(&["v1", "jobs", &id, "retry"]), &()).await?;
                match wait {
                    true => follow(&client, &id_of(&again, &id), json).await,
                    false => print(&again, json),
                }
            }
            What::Delete { id, permanently } => client.delete(bin::deletion(&client, "jobs", &id, permanently)).await,
        }
    })
}

/// Says where a job stands.
pub(super) async fn show(client: &Client, id: &str, json: bool) -> anyhow::Result<()> {
    print(&client.get(client.url(&["v1", "jobs", id])).await?, json)
}

/// Waits for the end of a job and says what it left; an error if it did not succeed.
pub(super) async fn follow(client: &Client, id: &str, json: bool) -> anyhow::Result<()> {
    watch::until_finished(client, id, "job").await?;
    let ended: Value = client.get(client.url(&["v1", "jobs", id])).await?;
    print(&ended, json)?;
    serde_json::from_value::<watch::Job>(ended)?.model().map(|_| ())
}

fn id_of(job: &Value, before: &str) -> String {
    job["id"].as_str().unwrap_or(before).to_owned()
}

async fn list(client: &Client, limit: u32, json: bool) -> anyhow::Result<()> {
    let mut url = client.url(&["v1", "jobs"]);
    url.query_pairs_mut().append_pair("limit", &limit.to_string());
    let answer: Value = client.get(url).await?;
    if json {
        return print_json(&answer);
    }
    let jobs: Vec<watch::Job> = serde_json::from_value(answer["items"].clone())?;
    print!("{}", table(HEADS, &jobs.iter().map(row).collect::<Vec<_>>()));
    Ok(())
}

fn print(job: &Value, json: bool) -> anyhow::Result<()> {
    if json {
        return print_json(job);
    }
    let job: watch::Job = serde_json::from_value(job.clone())?;
    print!("{}", table(HEADS, &[row(&job)]));
    if !job.reason().is_empty() {
        println!("{}", plain(&job.reason()));
    }
    Ok(())
}

const HEADS: [&str; 6] = ["job", "kind", "status", "done", "model", "accepted"];

fn row(job: &watch::Job) -> [String; 6] {
    let status = match (&job.stage, job.is_finished()) {
        (Some(stage), false) => format!("{}: {stage}", job.status),
        _ => job.status.clone(),
    };
    let done = format!("{:.0} %", job.progress * 100.0);
    let model = job.model_id.clone().unwrap_or_else(|| "-".into());
    [job.id.clone(), job.kind.clone(), status, done, model, job.created_at.clone()].map(|cell| plain(&cell))
}
