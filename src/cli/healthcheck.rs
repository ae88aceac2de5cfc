//! `visage healthcheck`: for containers without curl.

use std::net::SocketAddr;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;

use crate::http;

/// Which service is asked.
#[derive(Debug, Args)]
pub(super) struct HealthcheckArgs {
    /// The address the service listens on
    #[arg(long, env = "VISAGE_ADDR", default_value = "127.0.0.1:8080")]
    addr: SocketAddr,
    /// The certificate of a service that takes connections by TLS: it has to show this one
    #[arg(long, env = "VISAGE_TLS_CERT", value_name = "FILE")]
    tls_cert: Option<PathBuf>,
}

/// Succeeds if the service answers that it is well.
pub(super) fn run(args: HealthcheckArgs) -> anyhow::Result<()> {
    let addr = http::reachable(args.addr);
    let scheme = if args.tls_cert.is_some() { "https" } else { "http" };
    let url = format!("{scheme}://{addr}/healthz");
    let read = |path: &PathBuf| std::fs::read(path).with_context(|| format!("reading {}", path.display()));
    let certificate = args.tls_cert.as_ref().map(read).transpose()?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("starting the runtime")?;
    runtime.block_on(async {
        let asked = http::probe(addr, "/healthz", certificate.as_deref()).await;
        let status = asked.with_context(|| format!("asking {url}"))?;
        ensure!((200..300).contains(&status), "{url} answers {status}");
        Ok(())
    })
}
