//! `visage open`: models of this disk in the page, on a server that goes when it is done with.

mod browser;
mod found;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, ensure};
use clap::Args;

use self::found::Found;
use super::client::http::Client;
use super::client::models;
use super::serve::stop_signal;
use crate::config::ServerConfig;
use crate::geometry::Unit;
use crate::http::Server;
use crate::telemetry::{self, LogFormat};

/// What is shown, and where.
#[derive(Debug, Args)]
pub struct OpenArgs {
    /// A mesh or cloud, a folder of some, or what `visage register` left; can be repeated
    #[arg(required = true, value_name = "FILE|FOLDER")]
    paths: Vec<PathBuf>,
    /// The port of this machine where the page is served; 0 takes a free one
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// The unit of the models: mm, cm, m, in or unknown [default: that of a result's report, else unknown]
    #[arg(long)]
    unit: Option<Unit>,
    /// Open the page in the browser too
    #[arg(long)]
    browser: bool,
}

/// Serves until Ctrl-C; nothing stays of what was served.
pub fn run(args: OpenArgs) -> anyhow::Result<()> {
    telemetry::init(LogFormat::default(), "warn")?;
    // before a server starts in vain
    let models = found::models(&args.paths, args.unit)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("starting the runtime")?;
    let shown = runtime.block_on(serve(&args, models));
    runtime.shutdown_timeout(Duration::from_secs(1));
    shown
}

async fn serve(args: &OpenArgs, models: Vec<Found>) -> anyhow::Result<()> {
    // listened for before anything is on the disk that has to be removed
    let mut stop = std::pin::pin!(stop_signal()?);
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    let addr = SocketAddr::from((Ipv4Addr::LOCALHOST, args.port));
    let server = Server::start(ServerConfig::new(addr, folder.path())).await?;
    let url = server.url();
    let shown = tokio::select! {
        shown = show(&url, models, args.browser) => Some(shown),
        () = &mut stop => None,
    };
    if let Some(Ok(())) = shown {
        eprintln!("Ctrl-C ends it.");
        stop.await;
    }
    server.shutdown().await;
    shown.unwrap_or(Ok(()))
}

/// Puts the models into the gallery, and says where they are to be seen.
async fn show(url: &str, models: Vec<Found>, browser: bool) -> anyhow::Result<()> {
    let client = Client::new(url, None)?;
    let (mut shown, mut refused) = (Vec::new(), Vec::new());
    let count = models.len();
    for Found { file, name, unit } in models {
        eprintln!("reading {} ...", file.display());
        match models::added(&client, &file, Some(unit), None, Some(name.clone())).await {
            Ok(model) => shown.push((name, model["id"].as_str().context("the model has no id")?.to_owned())),
            // one of many may be no model; the only one is what was meant
            Err(error) if count > 1 => refused.push(format!("{}: {error:#}", file.display())),
            Err(error) => return Err(error.context(format!("opening {}", file.display()))),
        }
    }
    refused.iter().for_each(|refusal| eprintln!("left out: {refusal}"));
    ensure!(!shown.is_empty(), "none of these files is a mesh or a cloud");
    let address = address(url, &shown);
    println!("{address}");
    for (name, id) in shown.iter().filter(|_| shown.len() > 1) {
        eprintln!("  {name}: {url}/#/models/{id}");
    }
    if browser {
        browser::open(&address)?;
    }
    Ok(())
}

/// The page of one model, two beside each other, or the gallery of more.
fn address(url: &str, shown: &[(String, String)]) -> String {
    match shown {
        [(_, id)] => format!("{url}/#/models/{id}"),
        [(_, a), (_, b)] => format!("{url}/#/compare?a={a}&b={b}"),
        _ => format!("{url}/#/gallery"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_model_has_its_page_two_are_compared_and_more_are_a_gallery() {
        let shown: Vec<(String, String)> = ["a", "b", "c"].map(|id| (String::new(), id.to_owned())).into();
        assert_eq!(address("http://h", &shown[..1]), "http://h/#/models/a");
        assert_eq!(address("http://h", &shown[..2]), "http://h/#/compare?a=a&b=b");
        assert_eq!(address("http://h", &shown), "http://h/#/gallery");
    }
}
