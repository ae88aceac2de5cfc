//! What the operator may set: where the service listens, where it keeps things, and how much it takes on.

mod address;
mod base_path;
mod bucket;
mod database;
mod fetch_source;
mod host_name;
mod network;
mod origin;
mod roles;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use visage_formats::ReadLimits;

pub use self::address::{Address, NoAddress};
pub use self::base_path::{BasePath, NoBasePath};
pub use self::bucket::{BucketSettings, BucketUrl, NoBucketUrl};
pub use self::database::DatabaseUrl;
pub use self::fetch_source::{FetchSource, NoFetchSource};
pub use self::host_name::{Host, HostName, NoHostName};
pub use self::network::{Network, NoNetwork, is_public};
pub use self::origin::{NoOrigin, Origin};
pub use self::roles::{Role, Roles};

/// Everything a server needs to know before it starts.
#[derive(Debug, Clone)]
pub struct ServerConfig {
    /// Where to listen; port 0 takes a free one.
    pub addr: SocketAddr,
    /// The folder of the database and of all files. Created when absent; one server at a time.
    pub data_dir: PathBuf,
    /// Where the database is if not in that folder.
    pub database: Option<DatabaseUrl>,
    /// Where scans and files of models and standards are kept if not in that folder.
    pub objects: Option<BucketSettings>,
    /// The most worker threads one job may use.
    pub threads: usize,
    /// Jobs that run at the same time.
    pub concurrent_jobs: usize,
    /// The memory that all running jobs together may take; `None` if it is not limited.
    pub job_memory_bytes: Option<u64>,
    /// Bounds on what clients may ask for.
    pub limits: Limits,
    /// What it does of all that there is to do.
    pub roles: Roles,
    /// Where other servers of the same database reach this one, if it searches; where it listens if not given.
    pub node_address: Option<Address>,
    /// Names by which clients may call the service, besides loopback ones and the address it listens on.
    pub hosts: Vec<HostName>,
    /// The path below which the service is served.
    pub base_path: BasePath,
    /// Proxies whose word on who has sent a request, and how, counts.
    pub trusted_proxies: Vec<Network>,
    /// Origins of other pages that may ask, with a key.
    pub cors_origins: Vec<Origin>,
    /// Certificate and key, if connections are taken by TLS.
    pub tls: Option<TlsPem>,
    /// Whether everybody who reaches the service may do everything, with a key or without.
    pub open: bool,
    /// How much each key may ask for.
    pub quotas: Quotas,
    /// What is deleted when it is old.
    pub retention: Retention,
    /// Where messages to webhooks may go, and when they are sent again.
    pub webhooks: WebhookSettings,
    /// Where scans may be fetched from; nowhere if it is empty.
    pub fetch_from: Vec<FetchSource>,
    /// Bounds on connections.
    pub edge: EdgeLimits,
    /// Clocks of the job queue.
    pub queue: QueueTiming,
    /// How long a start waits for the lock of the data folder, which a killed process may hold for a moment.
    pub lock_patience: Duration,
    /// How long requests and jobs in flight may take to end after a stop was asked for.
    pub shutdown_deadline: Duration,
}

impl ServerConfig {
    /// The defaults for a server on `addr` that keeps its data in `data_dir`.
    pub fn new(addr: SocketAddr, data_dir: impl Into<PathBuf>) -> Self {
        ServerConfig {
            addr,
            data_dir: data_dir.into(),
            database: None,
            objects: None,
            threads: available_threads(),
            concurrent_jobs: 1,
            job_memory_bytes: crate::machine::memory_bytes().map(|bytes| bytes / 4 * 3),
            limits: Limits::default(),
            roles: Roles::default(),
            node_address: None,
            hosts: Vec::new(),
            base_path: BasePath::default(),
            trusted_proxies: Vec::new(),
            cors_origins: Vec::new(),
            tls: None,
            open: false,
            quotas: Quotas::default(),
            retention: Retention::default(),
            webhooks: WebhookSettings::default(),
            fetch_from: Vec::new(),
            edge: EdgeLimits::default(),
            queue: QueueTiming::default(),
            lock_patience: Duration::from_secs(5),
            shutdown_deadline: Duration::from_secs(10),
        }
    }
}

impl ServerConfig {
    /// Whether several servers may share the work.
    pub fn is_shared(&self) -> bool {
        self.database.is_some() && self.objects.is_some()
    }

    /// Whether others than programs of this machine reach the service: by its address, by a name that a proxy answers to, or
    /// by a proxy whatever name it uses.
    pub fn is_exposed(&self) -> bool {
        let is_named = self.hosts.iter().any(|name| !name.host.is_loopback());
        !self.addr.ip().to_canonical().is_loopback() || is_named || !self.trusted_proxies.is_empty()
    }
}

/// The number of threads the machine offers to this process (1 if it does not say).
pub fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Bounds on requests. They are stated in `GET /v1/info` and enforced with 413, 422 or 429.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Bytes of one request body (all files of a multipart upload together).
    pub upload_bytes: u64,
    /// Bytes of one scan or model file.
    pub file_bytes: u64,
    /// Bytes of a JSON body or of a text field of a form.
    pub text_bytes: usize,
    /// Bytes of a pose file.
    pub pose_file_bytes: usize,
    /// Scans in one scan set.
    pub scans_per_set: usize,
    /// Points in one scan or model.
    pub points_per_scan: u64,
    /// Jobs that may wait.
    pub queued_jobs: usize,
    /// Uploads that are read and checked at the same time (each holds one file in memory).
    pub concurrent_checks: usize,
    /// Files that are written in another format at the same time (each is in memory meanwhile).
    pub concurrent_conversions: usize,
    /// Uploaded models and probes that are described at the same time (each is in memory meanwhile). With two or more,
    /// large ones leave one place to small ones.
    pub concurrent_describing: usize,
    /// Bytes of JSON bodies, pose files and text fields that are in memory while they arrive, over all requests.
    pub buffered_bytes: usize,
    /// How long a file that comes piece by piece is waited for after its last piece.
    pub upload_life: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            upload_bytes: 4 << 30,
            file_bytes: 512 << 20,
            text_bytes: 256 << 10,
            pose_file_bytes: 4 << 20,
            scans_per_set: 500,
            points_per_scan: 20_000_000,
            queued_jobs: 100,
            concurrent_checks: 2,
            concurrent_conversions: 1,
            concurrent_describing: 2,
            buffered_bytes: 64 << 20,
            upload_life: Duration::from_secs(24 * 3600),
        }
    }
}

impl Limits {
    /// What the readers of files accept. A closed mesh has about two faces a vertex, hence the factor.
    pub fn read_limits(&self) -> ReadLimits {
        ReadLimits {
            max_points: self.points_per_scan,
            max_faces: self.points_per_scan.saturating_mul(2),
            max_bytes: self.file_bytes,
        }
    }
}

/// A certificate and its key, as PEM.
#[derive(Clone)]
pub struct TlsPem {
    /// The certificate, and those that lead from it to its authority.
    pub certificate: Vec<u8>,
    /// Its private key.
    pub key: Vec<u8>,
}

/// Without the key.
impl std::fmt::Debug for TlsPem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("TlsPem")
    }
}

/// How much each key may ask for; of those who need none, jobs and bytes count as those of one, requests and uploads by
/// address. `None` is no bound. Beyond it: 429.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quotas {
    /// Requests in a minute; so many may come at once.
    pub requests_per_minute: Option<u32>,
    /// Uploads at the same time.
    pub uploads: Option<usize>,
    /// Jobs that wait or run.
    pub queued_jobs: Option<u64>,
    /// Bytes of what is kept of the scans and models that it has sent or had made.
    pub stored_bytes: Option<u64>,
}

/// How many days things are kept; `None` is for ever.
#[derive(Debug, Clone, Copy)]
pub struct Retention {
    /// Models, since they were made.
    pub models: Option<u32>,
    /// Scan sets with their jobs and models, since they were made.
    pub scan_sets: Option<u32>,
    /// The audit log.
    pub audit: Option<u32>,
    /// What was deleted, in the recycle bin; 0 if there is none and deleted is gone for good.
    pub bin: u32,
}

impl Default for Retention {
    fn default() -> Self {
        Retention { models: None, scan_sets: None, audit: Some(365), bin: 0 }
    }
}

/// Where messages to webhooks may go, and when they are sent again.
#[derive(Debug, Clone)]
pub struct WebhookSettings {
    /// Networks that are reached though they are not public, and without TLS.
    pub networks: Vec<Network>,
    /// How long an attempt may take in all.
    pub patience: Duration,
    /// How long after each failed attempt the next one follows, and up to a fifth more; after the last one the message
    /// is dead.
    pub pauses: Vec<Duration>,
}

impl Default for WebhookSettings {
    fn default() -> Self {
        // some 28 hours: a receiver that is down for a day loses nothing
        let pauses = [5, 30, 2 * 60, 10 * 60, 3600, 3 * 3600, 8 * 3600, 16 * 3600];
        WebhookSettings {
            networks: Vec::new(),
            patience: Duration::from_secs(15),
            pauses: pauses.map(Duration::from_secs).to_vec(),
        }
    }
}

/// Bounds on connections: how many, and how long a client may keep one without using it. Stated in `GET /v1/info`.
#[derive(Debug, Clone, Copy)]
pub struct EdgeLimits {
    /// Connections at the same time; others wait. Never more than the descriptors of the process allow.
    pub connections: usize,
    /// How long the head of a request may take, and how long a connection may lie idle.
    pub head_time: Duration,
    /// How long the server waits for a body in all, plus the time that what has arrived takes at `body_rate`.
    pub body_time: Duration,
    /// The least rate of a body, bytes a second.
    pub body_rate: u64,
    /// How long nothing may arrive of a body that was quick before.
    pub body_stall: Duration,
    /// How long a client may take nothing of an answer.
    pub answer_stall: Duration,
}

impl Default for EdgeLimits {
    fn default() -> Self {
        EdgeLimits {
            connections: 256,
            head_time: Duration::from_secs(10),
            body_time: Duration::from_secs(10),
            body_rate: 4096,
            body_stall: Duration::from_secs(60),
            answer_stall: Duration::from_secs(60),
        }
    }
}

/// Clocks of the job queue.
#[derive(Debug, Clone, Copy)]
pub struct QueueTiming {
    /// A running job whose lease is older than this may be taken over.
    pub lease: Duration,
    /// How often a worker extends its lease, writes its progress and reads the cancel flag.
    pub heartbeat: Duration,
    /// How often an idle worker looks for work that nobody announced.
    pub poll: Duration,
    /// How often a job is started before it counts as failed.
    pub max_attempts: u32,
    /// A job that reports nothing for so long is stopped, and has failed.
    pub stall: Duration,
    /// A job that has not stopped so long after it was asked to is left behind: it has ended, and its worker takes another.
    pub deaf: Duration,
}

impl Default for QueueTiming {
    fn default() -> Self {
        QueueTiming {
            lease: Duration::from_secs(30),
            heartbeat: Duration::from_millis(300),
            poll: Duration::from_secs(5),
            max_attempts: 3,
            stall: Duration::from_secs(3600),
            deaf: Duration::from_secs(60),
        }
    }
}
