//! `visage healthcheck`: for containers without curl.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

use anyhow::{Context, ensure};
use clap::Args;

const PATIENCE: Duration = Duration::from_secs(3);

/// Which service is asked.
#[derive(Debug, Args)]
pub(super) struct HealthcheckArgs {
    /// The address the service listens on
    #[arg(long, env = "VISAGE_ADDR", default_value = "127.0.0.1:8080")]
    addr: SocketAddr,
}

/// Succeeds if the service answers that it is well.
pub(super) fn run(args: HealthcheckArgs) -> anyhow::Result<()> {
    let url = format!("http://{}/healthz", reachable(args.addr));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("starting the runtime")?;
    runtime.block_on(async {
        let client = reqwest::Client::builder().timeout(PATIENCE).no_proxy().build()?;
        let status = client.get(&url).send().await.with_context(|| format!("asking {url}"))?.status();
        ensure!(status.is_success(), "{url} answers {status}");
        Ok(())
    })
}

/// A service that listens on every address is asked on the loopback one.
fn reachable(mut addr: SocketAddr) -> SocketAddr {
    if addr.ip().is_unspecified() {
        addr.set_ip(match addr.ip() {
            IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
        });
    }
    addr
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everywhere_is_asked_at_home() {
        let addr = |text: &str| text.parse::<SocketAddr>().expect("an address");
        assert_eq!(reachable(addr("0.0.0.0:80")), addr("127.0.0.1:80"));
        assert_eq!(reachable(addr("[::]:80")), addr("[::1]:80"));
        assert_eq!(reachable(addr("10.1.2.3:80")), addr("10.1.2.3:80"));
    }
}
