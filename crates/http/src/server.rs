//! A server's life: open the data folder, pick up what a crash left, serve, stop within a deadline.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::sync::{Notify, watch};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::connections::{self, Connections};
use super::hosts::Hosts;
use super::outgoing::{HttpCourier, HttpPeers};
use super::router::{self, RouterError};
use super::state::AppState;
use super::tls::{Tls, TlsError};
use visage_domain::Parts;
use visage_service::app::context::ServiceContext;
use visage_service::app::engine::{Engine, PipelineEngine};
use visage_service::app::retention::{self, Dropped};
use visage_service::app::search::membership;
use visage_service::app::uploads;
use visage_service::app::webhooks;
use visage_service::config::{Address, Role, ServerConfig};
use visage_service::jobs::runner::Runner;
use visage_service::storage::Database;
use visage_service::storage::data_folder::{DataFolder, OpenError, Places};
use visage_service::storage::database::{Alone, News};
use visage_service::storage::inventory::Storage;
use visage_service::traces::{NoTraces, Traces};

/// How often answers kept for repeated requests are cleaned up.
const CLEAN_UP: Duration = Duration::from_secs(3600);
/// A gallery that can't be loaded is tried again after this.
const LOAD_AGAIN: Duration = Duration::from_secs(10);

/// Why a server did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The address can't be listened on.
    #[error("can't listen on {addr}: {source}; choose another --addr")]
    Listen {
        /// The address.
        addr: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// The data folder can't be used.
    #[error(transparent)]
    Data(#[from] OpenError),
    /// Everybody who reaches the service could do everything.
    #[error(
        "others than programs of this machine reach {addr}{names}, and there is no key: make one with \
         `visage key create --data {data} --name admin --scope admin`, listen on 127.0.0.1 without --host, or let everybody \
         do everything with --open"
    )]
    Exposed {
        /// The address.
        addr: SocketAddr,
        /// The names by which it may be called.
        names: String,
        /// The data folder.
        data: String,
    },
    /// What this server leaves to others nobody would do.
    #[error(
        "a server that is alone with its data folder has all roles: others can do their part with --database and --objects, a \
         database server and a bucket that all use"
    )]
    Roles,
    /// Others can't ask this server.
    #[error(
        "a server that searches for others has to say where they reach it: {addr} is every address of this machine; start it with \
         --node-address http://HOST:PORT"
    )]
    NodeAddress {
        /// The address.
        addr: SocketAddr,
    },
    /// The certificate or its key can't be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The routes can't be made.
    #[error(transparent)]
    Router(#[from] RouterError),
}

/// Starts servers.
#[derive(Debug, Clone, Copy)]
pub struct Server;

impl Server {
    /// Starts a server with the real algorithms.
    pub async fn start(config: ServerConfig) -> Result<ServerHandle, StartError> {
        Self::start_with(config, Arc::new(PipelineEngine)).await
    }

    /// The same, with requests and jobs that are followed across programs.
    pub async fn start_traced(config: ServerConfig, traces: Arc<dyn Traces>) -> Result<ServerHandle, StartError> {
        Self::start_all(config, Arc::new(PipelineEngine), traces).await
    }

    /// Starts a server with other algorithms: for tests of the service, and for failure injection.
    pub async fn start_with(config: ServerConfig, engine: Arc<dyn Engine>) -> Result<ServerHandle, StartError> {
        Self::start_all(config, engine, Arc::new(NoTraces)).await
    }

    async fn start_all(
        config: ServerConfig,
        engine: Arc<dyn Engine>,
        traces: Arc<dyn Traces>,
    ) -> Result<ServerHandle, StartError> {
        let mut config = config;
        config.edge.connections = connections::most(config.edge.connections);
        let config = Arc::new(config);
        if !config.roles.are_all() && !config.is_shared() {
            return Err(StartError::Roles);
        }
        let tls = config.tls.as_ref().map(Tls::new).transpose()?;
        let mut context = open(&config, engine).await?;
        context.traces = traces;
        context.peers = Arc::new(HttpPeers::of_system());
        check_exposure(&config, context.database.as_ref()).await?;
        let listener =
            TcpListener::bind(config.addr).await.map_err(|source| StartError::Listen { addr: config.addr, source })?;
        let addr = listener.local_addr().map_err(|source| StartError::Listen { addr: config.addr, source })?;
        let reached = if config.is_shared() { node_address(&config, addr)? } else { None };
        let stop = CancellationToken::new();
        let crash = CancellationToken::new();
        let (count, connections) = watch::channel(Connections::default());
        let hosts = Hosts::new(addr, &config.hosts);
        let state = AppState::new(context.clone(), hosts, connections.clone(), stop.clone());
        let router = router::router(state)?;
        let serving = connections::serve(listener, router, config.edge, stop.clone(), count, tls);
        let serving = tokio::spawn(serving);
        let runner = Runner::start(&context, &stop, &crash);
        let beside = vec![
            tokio::spawn(news(context.clone(), stop.clone())),
            tokio::spawn(chores(context.clone(), reached, stop.clone())),
            tokio::spawn(messages(context.clone(), stop.clone())),
        ];
        let roles: Vec<&str> = config.roles.list().map(Role::name).collect();
        tracing::info!(%addr, data = %config.data_dir.display(), threads = config.threads, roles = roles.join(","), "serving");
        Ok(ServerHandle { addr, connections, context, stop, crash, serving, runner, beside })
    }
}

/// A service that others reach is not served without keys, unless the operator wants that.
async fn check_exposure(config: &ServerConfig, database: &dyn Database) -> Result<(), StartError> {
    if config.open {
        tracing::warn!(addr = %config.addr, "OPEN: whoever reaches this service may read, change and delete everything");
        return Ok(());
    }
    if !config.is_exposed() || database.has_keys().await.map_err(OpenError::from)? {
        return Ok(());
    }
    database.close().await;
    let names = config.hosts.iter().map(|name| format!(", or {name}"));
    let proxies = config.trusted_proxies.iter().map(|network| format!(", or its proxy {network}"));
    let names = names.chain(proxies).collect();
    Err(StartError::Exposed { addr: config.addr, names, data: config.data_dir.display().to_string() })
}

/// Opens the data folder and picks up what a crash left.
async fn open(config: &Arc<ServerConfig>, engine: Arc<dyn Engine>) -> Result<ServiceContext, StartError> {
    let places = Places { objects: config.objects.as_ref(), database: config.database.as_ref() };
    let data = DataFolder::open_with(&config.data_dir, config.lock_patience, places).await?;
    let left = data.pick_up(config.queue.max_attempts).await?;
    if left.jobs + left.files as u64 > 0 {
        tracing::warn!(jobs = left.jobs, files = left.files, "picked up what the last server left");
    }
    Ok(ServiceContext::new(data.storage, engine, config.clone()))
}

/// Where other servers reach this one; `None` if it is not asked by others.
fn node_address(config: &ServerConfig, addr: SocketAddr) -> Result<Option<Address>, StartError> {
    let is_told = config.node_address.is_some() || !addr.ip().is_unspecified();
    match config.roles.search {
        true if is_told => {
            let scheme = if config.tls.is_some() { "https" } else { "http" };
            Ok(config.node_address.clone().or_else(|| format!("{scheme}://{addr}").parse().ok()))
        }
        // it has the whole index for itself
        true if config.roles.api => Ok(None),
        true => Err(StartError::NodeAddress { addr }),
        false => Ok(None),
    }
}

/// Loads the gallery, or this server's part of it, then keeps it whole and cleans up now and then.
async fn chores(context: ServiceContext, reached: Option<Address>, stop: CancellationToken) {
    let storage = context.storage();
    let roles = context.config.roles;
    let index = async {
        if roles.search {
            load(&context, &storage).await;
        }
        if roles.api {
            queue_evaluation(&context).await;
        }
        let keep_whole = async {
            if roles.search {
                keep_whole(&context, &storage).await;
            }
        };
        tokio::join!(keep_whole, upkeep(&context, &storage));
    };
    let parts = async {
        let Some(address) = &reached else { return };
        if roles.api {
            membership::announce(&context, address).await;
        } else {
            tokio::join!(membership::announce(&context, address), membership::hold(&context, address));
        }
    };
    let work = async { tokio::join!(index, parts) };
    tokio::select! {
        _ = work => {}
        () = stop.cancelled() => {}
    }
    if let Some(address) = &reached {
        membership::leave(&context, address).await;
    }
}

async fn queue_evaluation(context: &ServiceContext) {
    match context.database.queue_evaluation().await {
        Ok(Some(job)) => {
            tracing::info!(job.id = %job, "stored models are to be looked at again");
            context.monitor.announce_work();
        }
        Ok(None) => {}
        Err(error) => tracing::warn!("looking for what is out of date: {error}"),
    }
}

/// Loads the gallery, however many attempts that takes: until then queries are refused.
async fn load(context: &ServiceContext, storage: &Storage) {
    // of parts that are shared with others those that fall to this server are made whole afterwards
    let parts = if context.config.roles.api { Parts::ALL } else { Parts::NONE };
    loop {
        match context.gallery.load_parts(storage, parts).await {
            Ok(models) => return tracing::info!(models, "the gallery is loaded"),
            Err(error) => tracing::error!("the gallery can't be loaded, queries are refused until it is: {error}"),
        }
        tokio::time::sleep(LOAD_AGAIN).await;
    }
}

/// Files of the index are used from the first moment on: whether they are sound takes reading all of them. What can't be made anew
/// is loaded again.
async fn keep_whole(context: &ServiceContext, storage: &Storage) {
    let gallery = &context.gallery;
    loop {
        if let Err(error) = gallery.examine(storage).await {
            tracing::error!("a part of the gallery can't be made anew: {error}");
        }
        gallery.lost().await;
        load(context, storage).await;
    }
}

/// Rings the bells of this process for what any process commits, and has the index follow: a query would else have to catch up.
async fn news(context: ServiceContext, stop: CancellationToken) {
    let gallery = Notify::new();
    let ring = |news| match news {
        News::Work => context.monitor.announce_work(),
        News::Progress => context.monitor.announce_progress(),
        News::Gallery => gallery.notify_one(),
    };
    let follow = async {
        loop {
            gallery.notified().await;
            if let Err(error) = context.gallery.follow(context.database.as_ref()).await {
                tracing::warn!("the gallery can't follow the database: {error}");
            }
        }
    };
    tokio::select! {
        () = context.database.listen(&ring) => {}
        () = follow => {}
        () = stop.cancelled() => {}
    }
}

/// Cleans up now and then.
async fn upkeep(context: &ServiceContext, storage: &Storage) {
    loop {
        context.gallery.tidy_up();
        match storage.database.try_alone(Alone::Upkeep).await {
            Ok(Some(_turn)) => clean_up(context, storage).await,
            // another server does
            Ok(None) => {}
            Err(error) => tracing::warn!("cleaning up: {error}"),
        }
        if let Err(error) = storage.forget_copies().await {
            tracing::warn!("removing copies of what was deleted: {error}");
        }
        match uploads::sweep(context, jiff::Timestamp::now()).await {
            Ok(0) => {}
            Ok(files) => tracing::info!(files, "gave up uploads that nobody went on with"),
            Err(error) => tracing::warn!("giving up uploads: {error}"),
        }
        tokio::time::sleep(CLEAN_UP).await;
        if context.config.roles.search
            && let Err(error) = storage.database.keep_index().await
        {
            tracing::warn!("saying that the index is used: {error}");
        }
    }
}

/// What one of several servers does for all.
async fn clean_up(context: &ServiceContext, storage: &Storage) {
    let (database, now) = (storage.database.as_ref(), jiff::Timestamp::now());
    let cleaned = [
        database.forget_old_sessions().await.map(drop),
        database.forget_old_replays().await.map(drop),
        database.forget_gallery_changes().await,
        webhooks::clean_up(database, now).await,
    ];
    for error in cleaned.into_iter().filter_map(Result::err) {
        tracing::warn!("cleaning up: {error}");
    }
    if let Err(error) = storage.tidy_up(now).await {
        tracing::warn!("cleaning up: {error}");
    }
    match retention::drop_old(context, now).await {
        Ok(dropped) if dropped == Dropped::default() => {}
        Ok(Dropped { scan_sets, models, audit, bin }) => {
            tracing::info!(scan_sets, models, audit, bin, "deleted what was old")
        }
        Err(error) => tracing::warn!("deleting what is old: {error}"),
    }
}

/// Sends what webhooks are to be told, until a stop: what is being sent then is sent once more after the next start.
async fn messages(context: ServiceContext, stop: CancellationToken) {
    let courier = Arc::new(HttpCourier::new(context.config.webhooks.clone()));
    tokio::select! {
        () = webhooks::run(&context, courier) => {}
        () = stop.cancelled() => {}
    }
}

/// A running server.
#[derive(Debug)]
pub struct ServerHandle {
    addr: SocketAddr,
    connections: watch::Receiver<Connections>,
    context: ServiceContext,
    stop: CancellationToken,
    crash: CancellationToken,
    serving: JoinHandle<()>,
    runner: Runner,
    /// What goes on beside requests and jobs.
    beside: Vec<JoinHandle<()>>,
}

impl ServerHandle {
    /// Where it listens.
    pub fn addr(&self) -> SocketAddr {
        self.addr
    }

    /// Rings whenever some job, or a message to a webhook, has changed.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.context.monitor.changes()
    }

    /// How many connections there are, and were: to be watched.
    pub fn connections(&self) -> watch::Receiver<Connections> {
        self.connections.clone()
    }

    /// `http://` or `https://` and the address.
    pub fn url(&self) -> String {
        let scheme = if self.context.config.tls.is_some() { "https" } else { "http" };
        format!("{scheme}://{}", self.addr)
    }

    /// Stops: nothing new is accepted, streams end, jobs are given back to the queue. Whoever is not done at the
    /// deadline is left behind. True if everybody was.
    pub async fn shutdown(self) -> bool {
        tracing::info!("shutting down");
        self.stop.cancel();
        let aborts = self.serving.abort_handle();
        let drained = tokio::time::timeout(self.context.config.shutdown_deadline, async {
            self.runner.ended().await;
            for task in self.beside {
                let _ = task.await;
            }
            let _ = self.serving.await;
        })
        .await
        .is_ok();
        if !drained {
            tracing::warn!("the deadline has passed: connections are cut");
            aborts.abort();
        }
        self.context.database.close().await;
        drained
    }

    /// Stops as if the process had been killed: nothing is given back, nothing is written. For tests of recovery.
    pub async fn abort(self) {
        self.crash.cancel();
        self.serving.abort();
        self.beside.iter().for_each(JoinHandle::abort);
        let _ = self.serving.await;
        for task in self.beside {
            let _ = task.await;
        }
        self.stop.cancel();
        self.runner.ended().await;
        // threads of jobs see that nobody wants them any more; then the data folder is free again
        while Arc::strong_count(&self.context.objects) > 1 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        self.context.database.close().await;
    }
}
