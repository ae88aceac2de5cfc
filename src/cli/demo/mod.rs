//! `visage demo`: the whole path on scans made by code, through the real service, with a known truth.

mod calls;
mod exhibits;
mod verdict;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use clap::Args;

use self::exhibits::Exhibit;
use self::verdict::{Finding, PoseFinding};
use super::client::http::Client;
use super::client::watch;
use crate::config::ServerConfig;
use crate::domain::asset::Asset;
use crate::http::Server;
use crate::telemetry::{self, LogFormat};

/// The file with an object's disturbed poses.
const ROUGH_POSES: &str = "rough.json";

/// How the demo runs.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Leave the server running at the end, to look at the results
    #[arg(long)]
    keep: bool,
    /// Where the demo's server listens; port 0 takes a free one
    #[arg(long, default_value = "127.0.0.1:0")]
    addr: SocketAddr,
    /// Also write scans, disturbed poses, and what came of them to this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs the demo; an error if a pose or an answer is wrong.
pub fn run(args: DemoArgs) -> anyhow::Result<()> {
    telemetry::init(LogFormat::default(), "warn")?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("starting the runtime")?;
    let shown = runtime.block_on(show(&args));
    runtime.shutdown_timeout(Duration::from_secs(1));
    shown
}

async fn show(args: &DemoArgs) -> anyhow::Result<()> {
    println!("Making three objects by code and scanning each from 8 sides ...");
    let exhibits = tokio::task::spawn_blocking(exhibits::make).await?;
    for exhibit in &exhibits {
        println!("  {}", exhibit.introduction());
    }
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    let config = ServerConfig::new(args.addr, folder.path());
    // what it holds is made by code: whoever reaches it may look
    let server = Server::start(ServerConfig { open: config.is_exposed(), ..config }).await?;
    println!("\nThe service listens on {} and keeps its data in {}.", server.url(), folder.path().display());
    let client = Client::new(&server.url(), None)?;
    let result = tell(&client, &exhibits, args).await;
    if args.keep && result.is_ok() {
        println!("\nThe server stays up until Ctrl-C.");
        tokio::signal::ctrl_c().await.context("waiting for Ctrl-C")?;
    }
    server.shutdown().await;
    let findings = result?;
    let wrong: Vec<String> = findings.iter().flat_map(Finding::complaints).collect();
    ensure!(wrong.is_empty(), "the demo did not come out as it should: {}", wrong.join("; "));
    Ok(())
}

/// Uploads, registers, asks, and says what came of it.
async fn tell(client: &Client, exhibits: &[Exhibit], args: &DemoArgs) -> anyhow::Result<Vec<Finding>> {
    println!("\nUploading the scans with disturbed poses and registering them:");
    let mut queued = Vec::new();
    for exhibit in exhibits {
        let set = calls::create_scan_set(client, exhibit.name, &exhibit.files(), &exhibit.initial_poses()).await?;
        queued.push(calls::create_job(client, &set, exhibit.label()).await?);
    }
    let mut findings = Vec::new();
    for (exhibit, job) in exhibits.iter().zip(queued) {
        let finished = watch::until_finished(client, &job.id, &format!("{:<6}", exhibit.name)).await?;
        let model_id = finished.model()?.with_context(|| format!("the {} left no model", exhibit.name))?.to_owned();
        let poses = PoseFinding::new(exhibit, &calls::poses(client, &model_id).await?)?;
        println!("  {:<6} {poses}", exhibit.name);
        findings.push(Finding::new(exhibit, model_id, poses));
    }

    println!("\nAsking which of these are faces (POST /v1/queries {{\"standard\": \"face\"}}):");
    let matches = calls::query_standard(client, "face").await?;
    for finding in &mut findings {
        finding.answer(&matches)?;
        println!("  {finding}");
    }
    let all_right = findings.iter().all(|finding| finding.complaints().is_empty());
    println!("\n{}", if all_right { "All poses and all answers are right." } else { "NOT everything is right." });
    if let Some(out) = &args.out {
        save_scans(exhibits, out)?;
        save(client, &findings, out).await?;
    }
    say_how_to_look(client, &findings, args);
    Ok(findings)
}

/// Writes what was uploaded: for each object a folder of its scans with the disturbed poses.
fn save_scans(exhibits: &[Exhibit], out: &Path) -> anyhow::Result<()> {
    for exhibit in exhibits {
        let folder = out.join(exhibit.name);
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        let poses = (ROUGH_POSES.to_owned(), exhibit.initial_poses().into_bytes());
        for (name, content) in exhibit.files().into_iter().chain([poses]) {
            let path = folder.join(name);
            std::fs::write(&path, content).with_context(|| format!("writing {}", path.display()))?;
        }
    }
    Ok(())
}

/// Fetches the files of the models into `out`.
async fn save(client: &Client, findings: &[Finding], out: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
    for finding in findings {
        for asset in [Asset::Cloud, Asset::Poses, Asset::Report] {
            let bytes = calls::asset(client, &finding.model_id, asset).await?;
            let path = out.join(format!("{}_{}", finding.name, asset.name()));
            std::fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))?;
        }
    }
    Ok(())
}

fn say_how_to_look(client: &Client, findings: &[Finding], args: &DemoArgs) {
    if let Some(out) = &args.out {
        let out = out.display();
        println!(
            "\nThe clouds are in {out}: open them with MeshLab, CloudCompare or Blender. To register scans yourself:"
        );
        println!("  visage register {out}/head --poses {out}/head/{ROUGH_POSES} --unit mm --out {out}/registered");
    }
    if args.keep {
        println!("\nLook at the results (clouds open in MeshLab, CloudCompare or Blender):");
        for finding in findings {
            println!(
                "  curl -o {}.ply {}",
                finding.name,
                client.url(&["v1", "models", &finding.model_id, &Asset::Cloud.name()])
            );
        }
        println!("  curl {}", client.url(&["v1", "models"]));
        let body = "'{\"standard\": \"face\"}'";
        println!("  curl {} -H 'content-type: application/json' -d {body}", client.url(&["v1", "queries"]));
    } else if args.out.is_none() {
        println!(
            "\nTo look at the results: `visage demo --out DIR` writes the clouds to DIR, `visage demo --keep` leaves"
        );
        println!("the server up and says what to fetch from it.");
    }
}
