//! `visage serve`: the service, until it is told to stop.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;

use super::database::DatabaseArgs;
use super::objects::ObjectsArgs;
use crate::config::{
    Address, BasePath, EdgeLimits, FetchSource, HostName, Limits, Network, Origin, Quotas, Retention, Role, Roles,
    ServerConfig, TlsPem, WebhookSettings, available_threads,
};
use crate::http::Server;
use crate::telemetry::{self, LogFormat};
use crate::traces::Traces;

/// Where and how the service runs.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// A file of settings (TOML): each line an argument without its dashes, such as jobs = 2; arguments and the
    /// environment go before it
    #[arg(long, env = "VISAGE_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Where to listen; port 0 takes a free one
    #[arg(long, env = "VISAGE_ADDR", default_value = "127.0.0.1:8080")]
    addr: SocketAddr,
    /// A name by which clients may call the service, such as visage.example behind a proxy; can be repeated. Loopback
    /// names and the address it listens on are known without
    #[arg(long = "host", env = "VISAGE_HOST", value_name = "NAME", value_delimiter = ',')]
    hosts: Vec<HostName>,
    /// The path below which a proxy serves it, such as /visage
    #[arg(long, env = "VISAGE_BASE_PATH", value_name = "PATH", default_value_t)]
    base_path: BasePath,
    /// A proxy (an address, or a network such as 10.0.0.0/8) whose `Forwarded` or `X-Forwarded-*` tell who has sent a
    /// request, and by which scheme and name; can be repeated
    #[arg(long = "trusted-proxy", env = "VISAGE_TRUSTED_PROXY", value_name = "NETWORK", value_delimiter = ',')]
    trusted_proxies: Vec<Network>,
    /// An origin (scheme and host, such as `https://app.example`) whose pages may ask too, with a key; can be repeated
    #[arg(long = "cors-origin", env = "VISAGE_CORS_ORIGIN", value_name = "ORIGIN", value_delimiter = ',')]
    cors_origins: Vec<Origin>,
    /// The certificate by which connections are taken by TLS, with those that lead to its authority (PEM); read at
    /// the start
    #[arg(long, env = "VISAGE_TLS_CERT", value_name = "FILE")]
    tls_cert: Option<PathBuf>,
    /// The private key of the certificate (PEM, without a password)
    #[arg(long, env = "VISAGE_TLS_KEY", value_name = "FILE")]
    tls_key: Option<PathBuf>,
    /// Let everybody who reaches the service do everything, though others than programs of this machine may
    #[arg(long, env = "VISAGE_OPEN")]
    open: bool,
    /// The folder of all files and of the database, unless --objects and --database say where else
    #[arg(long, env = "VISAGE_DATA_DIR", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    database: DatabaseArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
    /// What this server does: api answers requests, worker runs jobs, search has the index: all of it beside api, else a part of it, which
    /// servers with api alone ask. Of several servers on one database and one bucket each may have its part
    #[arg(long, env = "VISAGE_ROLES", value_name = "ROLE", value_delimiter = ',', default_values_t = Role::ALL.iter().copied())]
    roles: Vec<Role>,
    /// Where other servers on the same database reach this one, such as `http://10.0.0.5:8080`, if it searches for them [default: --addr]
    #[arg(long, env = "VISAGE_NODE_ADDRESS", value_name = "URL")]
    node_address: Option<Address>,
    /// The most worker threads one job may use [default: all of the machine]
    #[arg(long, env = "VISAGE_THREADS", value_parser = at_least_one)]
    threads: Option<usize>,
    /// Jobs that run at the same time
    #[arg(long, env = "VISAGE_JOBS", default_value = "1", value_parser = at_least_one)]
    jobs: usize,
    /// Megabytes (10^6) of memory that all running jobs together may take [default: three quarters of the machine's]
    #[arg(long, env = "VISAGE_JOB_MEMORY_MB")]
    job_memory_mb: Option<u64>,
    /// Jobs that may wait
    #[arg(long, env = "VISAGE_MAX_QUEUED_JOBS", default_value_t = Limits::default().queued_jobs)]
    max_queued_jobs: usize,
    /// Megabytes (10^6) of one request body
    #[arg(long, env = "VISAGE_MAX_UPLOAD_MB", default_value_t = Limits::default().upload_bytes / 1_000_000)]
    max_upload_mb: u64,
    /// Megabytes (10^6) of one scan or model file
    #[arg(long, env = "VISAGE_MAX_FILE_MB", default_value_t = Limits::default().file_bytes / 1_000_000)]
    max_file_mb: u64,
    /// Scans in one scan set
    #[arg(long, env = "VISAGE_MAX_SCANS", default_value_t = Limits::default().scans_per_set)]
    max_scans: usize,
    /// Points in one scan or model
    #[arg(long, env = "VISAGE_MAX_POINTS", default_value_t = Limits::default().points_per_scan)]
    max_points: u64,
    /// Requests that a key may send in a minute; of those who need none, each address [default: any number]
    #[arg(long, env = "VISAGE_KEY_REQUESTS_PER_MINUTE", value_parser = clap::value_parser!(u32).range(1..))]
    key_requests_per_minute: Option<u32>,
    /// Uploads of a key at the same time [default: any number]
    #[arg(long, env = "VISAGE_KEY_UPLOADS", value_parser = at_least_one)]
    key_uploads: Option<usize>,
    /// Jobs of a key that may wait or run [default: any number]
    #[arg(long, env = "VISAGE_KEY_QUEUED_JOBS", value_parser = clap::value_parser!(u64).range(1..))]
    key_queued_jobs: Option<u64>,
    /// Megabytes (10^6) that are kept of what a key has sent and had made [default: any number]
    #[arg(long, env = "VISAGE_KEY_STORED_MB", value_parser = clap::value_parser!(u64).range(1..))]
    key_stored_mb: Option<u64>,
    /// Days after which models are deleted [default: never]
    #[arg(long, env = "VISAGE_KEEP_MODELS", value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..))]
    keep_models: Option<u32>,
    /// Days after which scan sets are deleted, with their jobs and models [default: never]
    #[arg(long, env = "VISAGE_KEEP_SCAN_SETS", value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..))]
    keep_scan_sets: Option<u32>,
    /// Days after which entries of the audit log are deleted
    #[arg(long, env = "VISAGE_KEEP_AUDIT", value_name = "DAYS", default_value_t = 365,
          value_parser = clap::value_parser!(u32).range(1..))]
    keep_audit: u32,
    /// Days for which deleted models, jobs and scan sets can be put back; 0 if deleted is gone for good
    #[arg(long, env = "VISAGE_BIN_DAYS", value_name = "DAYS", default_value_t = 0)]
    bin_days: u32,
    /// A network that messages to webhooks may reach though it is not public, also without TLS, such as 10.0.0.0/8; can be
    /// repeated
    #[arg(long = "webhook-network", env = "VISAGE_WEBHOOK_NETWORK", value_name = "NETWORK", value_delimiter = ',')]
    webhook_networks: Vec<Network>,
    /// Where scans may be fetched from: an address, and all that is below it, such as `https://data.example/scans/`; can be repeated
    /// [default: nowhere]
    #[arg(long = "fetch-from", env = "VISAGE_FETCH_FROM", value_name = "URL", value_delimiter = ',')]
    fetch_from: Vec<FetchSource>,
    /// Connections at the same time; others wait
    #[arg(long, env = "VISAGE_MAX_CONNECTIONS", default_value_t = EdgeLimits::default().connections,
          value_parser = at_least_one)]
    max_connections: usize,
    /// Seconds that the head of a request may take, and that a connection may lie idle
    #[arg(long, env = "VISAGE_HEAD_SECONDS", default_value_t = EdgeLimits::default().head_time.as_secs(),
          value_parser = clap::value_parser!(u64).range(1..))]
    head_seconds: u64,
    /// Seconds that a body is waited for in all, besides the time that it takes at --min-upload-rate
    #[arg(long, env = "VISAGE_BODY_SECONDS", default_value_t = EdgeLimits::default().body_time.as_secs(),
          value_parser = clap::value_parser!(u64).range(1..))]
    body_seconds: u64,
    /// Bytes a second that a body has to come at
    #[arg(long, env = "VISAGE_MIN_UPLOAD_RATE", default_value_t = EdgeLimits::default().body_rate,
          value_parser = clap::value_parser!(u64).range(1..))]
    min_upload_rate: u64,
    /// Seconds that requests and jobs in flight get at shutdown
    #[arg(long, env = "VISAGE_SHUTDOWN_SECONDS", default_value = "10")]
    shutdown_seconds: u64,
    /// How log lines are written
    #[arg(long, env = "VISAGE_LOG_FORMAT", value_enum, default_value_t)]
    log_format: LogFormat,
    /// Which log lines are written, such as "info" or "warn,visage=debug"
    #[arg(long, env = "VISAGE_LOG", default_value = telemetry::DEFAULT_FILTER)]
    log: String,
}

fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|&number| number >= 1).ok_or_else(|| "must be a whole number of at least 1".to_owned())
}

impl ServeArgs {
    fn tls(&self) -> anyhow::Result<Option<TlsPem>> {
        let read = |path: &PathBuf| std::fs::read(path).with_context(|| format!("reading {}", path.display()));
        match (&self.tls_cert, &self.tls_key) {
            (None, None) => Ok(None),
            (Some(certificate), Some(key)) => Ok(Some(TlsPem { certificate: read(certificate)?, key: read(key)? })),
            (Some(_), None) => bail!("--tls-cert needs --tls-key, the key of the certificate"),
            (None, Some(_)) => bail!("--tls-key needs --tls-cert, the certificate of the key"),
        }
    }

    fn config(&self) -> anyhow::Result<ServerConfig> {
        let defaults = ServerConfig::new(self.addr, &self.data);
        let job_memory_bytes = self.job_memory_mb.map(|mb| mb.saturating_mul(1_000_000));
        Ok(ServerConfig {
            database: self.database.database.clone(),
            objects: self.objects.settings(),
            job_memory_bytes: job_memory_bytes.or(defaults.job_memory_bytes),
            threads: self.threads.unwrap_or_else(available_threads),
            concurrent_jobs: self.jobs,
            limits: Limits {
                upload_bytes: self.max_upload_mb.saturating_mul(1_000_000),
                file_bytes: self.max_file_mb.saturating_mul(1_000_000),
                scans_per_set: self.max_scans,
                points_per_scan: self.max_points,
                queued_jobs: self.max_queued_jobs,
                ..Limits::default()
            },
            roles: Roles::of(&self.roles),
            node_address: self.node_address.clone(),
            hosts: self.hosts.clone(),
            base_path: self.base_path.clone(),
            trusted_proxies: self.trusted_proxies.clone(),
            cors_origins: self.cors_origins.clone(),
            tls: self.tls()?,
            open: self.open,
            quotas: Quotas {
                requests_per_minute: self.key_requests_per_minute,
                uploads: self.key_uploads,
                queued_jobs: self.key_queued_jobs,
                stored_bytes: self.key_stored_mb.map(|mb| mb.saturating_mul(1_000_000)),
            },
            retention: Retention {
                models: self.keep_models,
                scan_sets: self.keep_scan_sets,
                audit: Some(self.keep_audit),
                bin: self.bin_days,
            },
            webhooks: WebhookSettings { networks: self.webhook_networks.clone(), ..WebhookSettings::default() },
            fetch_from: self.fetch_from.clone(),
            edge: EdgeLimits {
                connections: self.max_connections,
                head_time: Duration::from_secs(self.head_seconds),
                body_time: Duration::from_secs(self.body_seconds),
                body_rate: self.min_upload_rate,
                ..EdgeLimits::default()
            },
            shutdown_deadline: Duration::from_secs(self.shutdown_seconds),
            ..defaults
        })
    }
}

/// Serves until SIGTERM or SIGINT.
pub fn run(args: &ServeArgs) -> anyhow::Result<()> {
    // it outlives the runtime: what has ended then is still to be sent
    let exporter = telemetry::Exporter::new()?;
    telemetry::init_traced(args.log_format, &args.log, &exporter)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("starting the runtime")?;
    let served = runtime.block_on(serve(args.config()?, exporter.traces()));
    // a job's thread or a check that does not listen must not keep the process
    runtime.shutdown_timeout(Duration::from_secs(1));
    served
}

async fn serve(config: ServerConfig, traces: Arc<dyn Traces>) -> anyhow::Result<()> {
    // listened for before the server starts, so that a signal during the start is not lost
    let stop = stop_signal()?;
    let server = Server::start_traced(config, traces).await?;
    println!("listening on {}", server.url());
    stop.await;
    server.shutdown().await;
    Ok(())
}

/// Waits for SIGTERM or SIGINT.
#[cfg(unix)]
pub(super) fn stop_signal() -> anyhow::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate()).context("listening for SIGTERM")?;
    let mut interrupt = signal(SignalKind::interrupt()).context("listening for SIGINT")?;
    Ok(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
    })
}

/// Waits for Ctrl-C.
#[cfg(not(unix))]
pub(super) fn stop_signal() -> anyhow::Result<impl Future<Output = ()>> {
    Ok(async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    })
}
