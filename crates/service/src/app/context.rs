//! What the use cases and the workers share.

use std::sync::Arc;

use tokio::sync::{OnceCell, Semaphore};

use super::engine::Engine;
use super::live_gallery::LiveGallery;
use super::looks::Looks;
use super::monitor::JobMonitor;
use super::search::Elsewhere;
use super::search::peers::{NoPeers, Peers};
use crate::config::ServerConfig;
use crate::storage::inventory::Storage;
use crate::storage::{Database, DatabaseError, ObjectStore};
use crate::traces::{NoTraces, Traces};
use visage_domain::NodeSecret;

/// All that the service works with. Cheap to clone.
#[derive(Clone)]
pub struct ServiceContext {
    /// What is kept besides files: the queue and all else.
    pub database: Arc<dyn Database>,
    /// The files.
    pub objects: Arc<dyn ObjectStore>,
    /// The index that new models go into.
    pub gallery: LiveGallery,
    /// The algorithms.
    pub engine: Arc<dyn Engine>,
    /// What runs now.
    pub monitor: Arc<JobMonitor>,
    /// Threads, limits and clocks.
    pub config: Arc<ServerConfig>,
    /// Where spans of requests and jobs go on.
    pub traces: Arc<dyn Traces>,
    /// Other servers of the same database.
    pub peers: Arc<dyn Peers>,
    /// What they show each other, once it was read.
    pub(super) secret: Arc<OnceCell<Option<NodeSecret>>>,
    /// Looks at jobs that are under way.
    pub(super) looks: Arc<Looks>,
    /// One evaluation of the gallery at a time.
    pub(super) evaluating: Arc<Semaphore>,
}

impl ServiceContext {
    /// A service that has just started: its gallery is yet to be loaded.
    pub fn new(storage: Storage, engine: Arc<dyn Engine>, config: Arc<ServerConfig>) -> ServiceContext {
        ServiceContext {
            database: storage.database,
            objects: storage.objects,
            gallery: LiveGallery::default(),
            engine,
            monitor: Arc::default(),
            config,
            traces: Arc::new(NoTraces),
            peers: Arc::new(NoPeers),
            secret: Arc::default(),
            looks: Arc::default(),
            evaluating: Arc::new(Semaphore::new(1)),
        }
    }

    /// Waits until the index holds everything that was committed before, by this process or another: call it before a query.
    pub async fn settled(&self) -> Result<(), DatabaseError> {
        self.database.settled().await;
        self.gallery.follow(self.database.as_ref()).await.map(drop)
    }

    /// What only servers of the same database know; `None` if there can't be others.
    pub async fn node_secret(&self) -> Result<Option<NodeSecret>, DatabaseError> {
        self.secret.get_or_try_init(|| self.database.node_secret()).await.cloned()
    }

    /// Whether the index is here, or will be when it is loaded: all of it, or this server's part.
    pub fn has_index(&self) -> Result<(), Elsewhere> {
        if self.config.roles.search { Ok(()) } else { Err(Elsewhere) }
    }

    /// The database and the files.
    pub fn storage(&self) -> Storage {
        Storage { database: self.database.clone(), objects: self.objects.clone() }
    }
}

impl std::fmt::Debug for ServiceContext {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServiceContext")
            .field("objects", &self.objects)
            .field("config", &self.config)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use crate::app::engine::PipelineEngine;
    use crate::storage::conformance::memory::MemoryPlace;
    use crate::storage::conformance::{DatabasePlace, ObjectPlace};
    use crate::storage::sqlite::testing::SqlitePlace;
    use visage_domain::SeatId;

    /// A service with a database of its own and its files in memory; the database goes with the place.
    pub async fn context() -> (ServiceContext, SqlitePlace) {
        let (place, objects) = (SqlitePlace::new().await, MemoryPlace::new().open());
        let storage = Storage { database: place.open(SeatId::new()).await, objects };
        let config = ServerConfig::new(([127, 0, 0, 1], 0).into(), "");
        let context = ServiceContext::new(storage, Arc::new(PipelineEngine), Arc::new(config));
        context.gallery.load(&context.storage()).await.expect("loaded");
        (context, place)
    }

    /// A file that has arrived.
    pub async fn file(context: &ServiceContext, content: &[u8]) -> crate::storage::StagedFile {
        let mut writer = context.objects.receive().await.expect("staging");
        writer.write(content).await.expect("written");
        writer.finish().await.expect("arrived")
    }
}
