//! `visage models`: what the gallery keeps.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, Subcommand};
use reqwest::multipart::{Form, Part};
use serde_json::Value;

use super::http::Client;
use super::rows::{plain, table};
use super::{Connection, bin, block_on, print_json};
use crate::formats::{Format, written::Written};
use crate::geometry::Unit;

/// What is done with models.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(in super::super) struct ModelsArgs {
    #[command(flatten)]
    connection: Connection,
    #[command(subcommand)]
    what: Option<What>,
    #[command(flatten)]
    listed: Listed,
}

/// Which models are listed.
#[derive(Debug, Args)]
struct Listed {
    /// At most so many
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100))]
    limit: u32,
    /// Only those with these words, or parts of words, in their name or label
    #[arg(long, value_name = "WORDS")]
    text: Option<String>,
    /// Only those of this class
    #[arg(long)]
    label: Option<String>,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The newest models (what is done if nothing is said)
    List(Listed),
    /// One model with its files
    Show { id: String },
    /// Put a finished mesh or cloud into the gallery
    Add {
        file: PathBuf,
        /// Its unit: mm, cm, m, in or unknown
        #[arg(long)]
        unit: Option<Unit>,
        /// Its class, such as face
        #[arg(long)]
        label: Option<String>,
        /// A name for people [default: that of the file]
        #[arg(long)]
        name: Option<String>,
    },
    /// Fetch a model into a file, in the format that its ending names
    Download {
        id: String,
        out: PathBuf,
        /// Which of its contents [default: mesh if the ending is that of a mesh and the model has one, else cloud]
        #[arg(long, value_parser = ["cloud", "mesh", "poses", "scans"])]
        content: Option<String>,
    },
    /// Delete a model with all that is kept of it
    Delete {
        id: String,
        /// Keep nothing of it in the recycle bin
        #[arg(long)]
        permanently: bool,
    },
}

/// Asks, and prints what is answered.
pub(in super::super) fn run(args: ModelsArgs) -> anyhow::Result<()> {
    let client = args.connection.client()?;
    let json = args.connection.json;
    block_on(async {
        match args.what.unwrap_or(What::List(args.listed)) {
            What::List(listed) => list(&client, &listed, json).await,
            What::Show { id } => show(&client.get(client.url(&["v1", "models", &id])).await?, json),
            What::Add { file, unit, label, name } => show(&added(&client, &file, unit, label, name).await?, json),
            What::Download { id, out, content } => download(&client, &id, out, content).await,
            What::Delete { id, permanently } => client.delete(bin::deletion(&client, "models", &id, permanently)).await,
        }
    })
}

async fn list(client: &Client, listed: &Listed, json: bool) -> anyhow::Result<()> {
    let mut url = client.url(&["v1", "models"]);
    url.query_pairs_mut().append_pair("limit", &listed.limit.to_string());
    for (name, value) in [("text", &listed.text), ("label", &listed.label)] {
        if let Some(value) = value {
            url.query_pairs_mut().append_pair(name, value);
        }
    }
    let answer: Value = client.get(url).await?;
    if json {
        return print_json(&answer);
    }
    let rows: Vec<_> = answer["items"].as_array().into_iter().flatten().map(row).collect();
    print!("{}", table(HEADS, &rows));
    Ok(())
}

const HEADS: [&str; 7] = ["model", "name", "label", "points", "unit", "quality", "stored"];

fn row(model: &Value) -> [String; 7] {
    ["id", "name", "label", "points", "unit", "quality", "created_at"].map(|field| cell(&model[field]))
}

/// A value as people read it; `-` if there is none.
pub(super) fn cell(value: &Value) -> String {
    match value {
        Value::Null => "-".to_owned(),
        Value::String(text) => plain(text),
        other => other.to_string(),
    }
}

fn show(model: &Value, json: bool) -> anyhow::Result<()> {
    if json {
        return print_json(model);
    }
    print!("{}", table(HEADS, &[row(model)]));
    let files: Vec<_> = model["assets"].as_array().into_iter().flatten().collect();
    let files: Vec<_> =
        files.iter().map(|file| ["name", "bytes", "media_type"].map(|field| cell(&file[field]))).collect();
    print!("\n{}", table(["file", "bytes", "type"], &files));
    Ok(())
}

/// Puts a file into the gallery; answers with the model.
pub(in super::super) async fn added(
    client: &Client,
    file: &Path,
    unit: Option<Unit>,
    label: Option<String>,
    name: Option<String>,
) -> anyhow::Result<Value> {
    let content = std::fs::read(file).with_context(|| format!("reading {}", file.display()))?;
    let file_name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut form = Form::new().part("model", Part::bytes(content).file_name(file_name));
    for (field, value) in [("unit", unit.map(|unit| unit.name().to_owned())), ("label", label), ("name", name)] {
        if let Some(value) = value {
            form = form.text(field, value);
        }
    }
    client.post_form(client.url(&["v1", "models"]), form).await
}

async fn download(client: &Client, id: &str, out: PathBuf, content: Option<String>) -> anyhow::Result<()> {
    let ending = crate::formats::extension(&out.to_string_lossy());
    let content = match content {
        Some(content) => content,
        None => content_of(client, id, &ending).await?.to_owned(),
    };
    let mut url = client.url(&["v1", "models", id, &content]);
    url.query_pairs_mut().append_pair("format", &ending);
    let bytes = client.bytes(url).await?;
    std::fs::write(&out, bytes).with_context(|| format!("writing {}", out.display()))
}

/// What of the model a file with this ending can hold best.
async fn content_of(client: &Client, id: &str, ending: &str) -> anyhow::Result<&'static str> {
    let Some(format) = Format::of_ending(ending) else {
        bail!(
            "files ending in {ending:?} are not written: choose {} for a mesh, {} for a cloud, {} for poses",
            Written::Mesh.endings().join(", "),
            Written::Cloud.endings().join(", "),
            Written::Poses.endings().join(", ")
        );
    };
    if format.writers.poses.is_some() {
        return Ok("poses");
    }
    let model: Value = client.get(client.url(&["v1", "models", id])).await?;
    let mut files = model["assets"].as_array().into_iter().flatten();
    let has_mesh = files.any(|file| file["name"].as_str().is_some_and(|name| name.starts_with("mesh.")));
    Ok(if format.writers.mesh.is_some() && (has_mesh || format.writers.cloud.is_none()) { "mesh" } else { "cloud" })
}
