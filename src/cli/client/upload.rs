//! `visage upload`: scans to a service, and their registration there.

use std::io::SeekFrom;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use clap::Args;
use futures_util::TryStreamExt;
use indicatif::{ProgressBar, ProgressStyle};
use reqwest::header::CONTENT_LENGTH;
use reqwest::multipart::{Form, Part};
use reqwest::{Body, Method, Url};
use serde_json::{Value, json};
use tokio::io::AsyncSeekExt;
use tokio_util::io::ReaderStream;

use super::super::register::options::Given;
use super::http::{Client, Created, is_passing};
use super::parcel::Parcel;
use super::pieces;
use super::rows::plain;
use super::{Connection, block_on, jobs, print_json};
use crate::domain::options::Options;
use crate::geometry::Unit;

/// How often a scan is sent before its connection counts as lost for good.
pub(super) const ATTEMPTS: u32 = 5;

/// What is sent, and what becomes of it.
#[derive(Debug, Args)]
pub(in super::super) struct UploadArgs {
    /// Folders, files or one archive with the scans
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// A name for people [default: that of the first path]
    #[arg(long)]
    name: Option<String>,
    /// Unit of the scans: mm, cm, m, in or unknown [default: what their files declare, else unknown]
    #[arg(long, conflicts_with = "into")]
    unit: Option<Unit>,
    /// The initial poses: a pose file of any kind
    #[arg(long, value_name = "FILE")]
    poses: Option<PathBuf>,
    /// Add to a stored scan set; scans that it has already are not sent again
    #[arg(long, value_name = "SCAN_SET")]
    into: Option<String>,
    /// Only store the scans
    #[arg(long)]
    no_register: bool,
    /// Wait for the end of the registration; fails if it does
    #[arg(long, conflicts_with = "no_register")]
    wait: bool,
    /// A class label for the model, such as face
    #[arg(long)]
    label: Option<String>,
    /// What you say of the scans where machines can't tell, JSON (see docs/API.md)
    #[arg(long, value_name = "FILE")]
    hints: Option<PathBuf>,
    #[command(flatten)]
    options: Given<Options>,
    #[command(flatten)]
    connection: Connection,
}

/// Sends the scans and orders their registration.
pub(in super::super) fn run(args: UploadArgs) -> anyhow::Result<()> {
    let hints: Option<Value> = args.hints.as_deref().map(read_json).transpose()?;
    let parcel = Parcel::of(&args.paths)?;
    let client = args.connection.client()?;
    block_on(async {
        let set = store(&client, &args, &parcel).await?;
        if args.no_register {
            let set: Value = client.get(client.url(&["v1", "scan-sets", &set])).await?;
            return say_set(&set, args.connection.json);
        }
        eprintln!("scan set {set}");
        let mut order = json!({"scan_set_id": set, "options": args.options.0, "hints": hints, "label": args.label});
        if let Value::Object(order) = &mut order {
            order.retain(|_, value| !value.is_null());
        }
        let job: Created = client.post(client.url(&["v1", "jobs"]), &order).await?;
        match args.wait {
            true => jobs::follow(&client, &job.id, args.connection.json).await,
            false => jobs::show(&client, &job.id, args.connection.json).await,
        }
    })
}

/// Stores the scans; gives the id of their set.
async fn store(client: &Client, args: &UploadArgs, parcel: &Parcel) -> anyhow::Result<String> {
    let unit = args.unit.unwrap_or_default();
    let first = args.paths.first().and_then(|path| path.file_stem()).map(|stem| stem.to_string_lossy().into_owned());
    let name = args.name.clone().or(first).unwrap_or_else(|| "scans".to_owned());
    let bar = byte_bar()?;
    let set = match parcel {
        Parcel::Archive { name: file, path, .. } => {
            ensure!(args.into.is_none(), "these files go as one archive, which is a set of its own: leave --into out");
            let send = async || -> anyhow::Result<String> {
                let (body, bytes) = (stream(path, 0, &bar).await?, size(path)?);
                let scans = Part::stream_with_length(body, bytes).file_name(file.clone());
                let mut form = Form::new().text("name", name.clone()).part("scans", scans);
                if unit != Unit::Unknown {
                    form = form.text("unit", unit.name());
                }
                if let Some(poses) = &args.poses {
                    form = form.part("poses", Part::bytes(read(poses)?).file_name("poses"));
                }
                let set: Created = client.post_form(client.url(&["v1", "scan-sets", "upload"]), form).await?;
                Ok(set.id)
            };
            send_again(send, &bar).await?
        }
        Parcel::OneByOne { scans, passed_over } => {
            for name in passed_over {
                eprintln!("note: {} is passed over: it is no scan by its name", plain(name));
            }
            let (set, stored) = match &args.into {
                Some(id) => (id.clone(), client.get(client.url(&["v1", "scan-sets", id])).await?),
                None => {
                    let body = json!({"name": name, "unit": unit.name()});
                    let set: Created = client.post(client.url(&["v1", "scan-sets"]), &body).await?;
                    (set.id, Value::Null)
                }
            };
            let is_stored = |name: &str, checksum: &str| {
                let scans = stored["scans"].as_array().into_iter().flatten();
                scans.into_iter().any(|scan| scan["name"] == name && scan["checksum"] == checksum)
            };
            for (name, path) in scans {
                if args.into.is_some() && is_stored(name, &checksum(path)?) {
                    continue;
                }
                bar.set_prefix(plain(name));
                send_scan(client, &set, name, path, &bar).await.with_context(|| {
                    format!("sending {name}; what was sent before is kept: go on with --into {set}")
                })?;
            }
            if let Some(poses) = &args.poses {
                let url = client.url(&["v1", "scan-sets", &set, "pose-file"]);
                client.send(client.request(Method::PUT, url).body(read(poses)?)).await.context("sending the poses")?;
            }
            set
        }
    };
    bar.finish_and_clear();
    Ok(set)
}

/// Sends a scan: a large one piece by piece, so that a lost connection costs little.
async fn send_scan(client: &Client, set: &str, name: &str, path: &Path, bar: &ProgressBar) -> anyhow::Result<()> {
    if size(path)? > pieces::LARGE {
        return pieces::send(client, set, name, path, bar).await;
    }
    let url = client.url(&["v1", "scan-sets", set, "scans", name]);
    send_again(async || put(client, url.clone(), path, bar).await, bar).await
}

async fn put(client: &Client, url: Url, path: &Path, bar: &ProgressBar) -> anyhow::Result<()> {
    let (body, bytes) = (stream(path, 0, bar).await?, size(path)?);
    let request = client.request(Method::PUT, url).header(CONTENT_LENGTH, bytes).body(body);
    client.send(request).await.map(|_| ())
}

/// Sends something until it arrives, is refused, or was sent so often in vain.
async fn send_again<T>(mut send: impl AsyncFnMut() -> anyhow::Result<T>, bar: &ProgressBar) -> anyhow::Result<T> {
    let mut attempt = 1;
    loop {
        match send().await {
            Err(error) if attempt < ATTEMPTS && is_passing(&error) => {
                bar.set_message(format!("sent again ({error:#})"));
                tokio::time::sleep(Duration::from_secs(1 << (attempt - 1))).await;
                attempt += 1;
            }
            ended => return ended,
        }
    }
}

fn size(path: &Path) -> anyhow::Result<u64> {
    Ok(std::fs::metadata(path).with_context(|| format!("reading {}", path.display()))?.len())
}

/// A file, from some byte on, as the body of a request.
pub(super) async fn stream(path: &Path, from: u64, bar: &ProgressBar) -> anyhow::Result<Body> {
    let reading = || format!("reading {}", path.display());
    let mut file = tokio::fs::File::open(path).await.with_context(reading)?;
    file.seek(SeekFrom::Start(from)).await.with_context(reading)?;
    bar.set_length(size(path)?);
    bar.set_position(from);
    let bar = bar.clone();
    let chunks = ReaderStream::with_capacity(file, 1 << 18).inspect_ok(move |chunk| bar.inc(chunk.len() as u64));
    Ok(Body::wrap_stream(chunks))
}

fn byte_bar() -> anyhow::Result<ProgressBar> {
    let style = ProgressStyle::with_template("{prefix} [{bar:30}] {bytes}/{total_bytes} {bytes_per_sec} {msg}")?;
    Ok(ProgressBar::new(0).with_style(style.progress_chars("=> ")))
}

/// As the service reckons it: BLAKE3, hexadecimal.
fn checksum(path: &Path) -> anyhow::Result<String> {
    let mut hasher = blake3::Hasher::new();
    let file = std::fs::File::open(path).with_context(|| format!("reading {}", path.display()))?;
    hasher.update_reader(file).with_context(|| format!("reading {}", path.display()))?;
    Ok(hasher.finalize().to_hex().to_string())
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("reading {}", path.display()))
}

fn read_json(path: &Path) -> anyhow::Result<Value> {
    serde_json::from_slice(&read(path)?).with_context(|| format!("{} is no JSON", path.display()))
}

/// Says what was stored.
fn say_set(set: &Value, json: bool) -> anyhow::Result<()> {
    if json {
        return print_json(set);
    }
    let scans = set["scans"].as_array().map_or(0, Vec::len);
    println!("scan set {}: {scans} scans", set["id"].as_str().unwrap_or_default());
    for passed in set["passed_over"].as_array().into_iter().flatten() {
        let text = |field: &str| plain(passed[field].as_str().unwrap_or_default());
        println!("{} is passed over: it {}", text("file"), text("why"));
    }
    Ok(())
}
