//! A database on a PostgreSQL server.
//!
//! The statements stand in `sql`; here is what is PostgreSQL's own: `writing` is about transactions and locks, `alone` about the
//! servers that use a database, `others` and `searchers` about what they learn of each other, `meaning` about errors, `words` about how words are found in names.

mod alone;
mod dialect;
mod meaning;
mod migrations;
mod move_in;
#[cfg(test)]
mod nodes_tests;
mod others;
mod searchers;
#[path = "../sql/mod.rs"]
#[allow(clippy::duplicate_mod, reason = "one text for each database, see there")]
mod sql;
#[cfg(test)]
mod testing;
mod upkeep;
mod words;
mod writing;

pub use alone::Claim;
pub(in crate::storage) use meaning::meaning;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgPool, PgPoolOptions};

use self::alone::{Held, Locks};
use super::unseen::Changes;
use crate::config::DatabaseUrl;
use crate::storage::{Database, DatabaseError, Reserve};
use visage_domain::{Owner, SeatId};

/// Connections that read at the same time.
const READERS: u32 = 8;
/// Connections that write, or wait for the write lock.
const WRITERS: u32 = 4;
/// Connections that listen, or hold what one process does at a time.
const WAITING: u32 = 24;
/// How long a call waits for a connection: for one to come free, or for a server that is not there.
const CONNECTION_PATIENCE: Duration = Duration::from_secs(5);
/// Settings of our sessions. Locks are waited for as long as on SQLite; a process that hangs in a transaction loses it; a
/// connection whose other end is gone is found out, on either side; plans are made for the parameters at hand, since a filter that
/// is not given is a NULL among them.
const SESSION: [(&str, &str); 6] = [
    ("lock_timeout", "5s"),
    ("idle_in_transaction_session_timeout", "60s"),
    ("tcp_keepalives_idle", "10"),
    ("tcp_keepalives_interval", "5"),
    ("tcp_keepalives_count", "3"),
    ("plan_cache_mode", "force_custom_plan"),
];

/// The database. Cheap to clone.
#[derive(Debug, Clone)]
pub struct PostgresDatabase {
    writer: PgPool,
    readers: PgPool,
    waiting: PgPool,
    reserve: Arc<dyn Reserve>,
    changes: Changes,
    owner: Owner,
    is_ours: Arc<AtomicBool>,
    /// Whether other servers may use it.
    is_shared: bool,
    held: Option<Arc<Held>>,
}

impl Database for PostgresDatabase {}

impl PostgresDatabase {
    /// Opens a database for a server, and brings it to this program's version. Waits so long for servers that are about to end.
    /// `reserve` tells whether there is space on the disk for files.
    pub async fn open_for(
        url: &DatabaseUrl,
        claim: Claim,
        reserve: Arc<dyn Reserve>,
        patience: Duration,
    ) -> Result<PostgresDatabase, DatabaseError> {
        let options = options(url)?;
        let database = Self::connect(options.clone(), reserve);
        let locks = Locks::take(&options, claim, patience, || database.is_to_be_migrated()).await?;
        database.migrate().await?;
        let held = locks.hold(Arc::clone(&database.is_ours)).await?;
        let owner = Owner::on(claim.seat);
        Ok(PostgresDatabase { held: Some(Arc::new(held)), is_shared: claim.is_shared, owner, ..database })
    }

    /// Opens a database that a server of the same version may be using, and leaves it as it is.
    pub async fn open_beside(url: &DatabaseUrl, reserve: Arc<dyn Reserve>) -> Result<PostgresDatabase, DatabaseError> {
        let database = Self::connect(options(url)?, reserve);
        if database.version().await? != newest() {
            return Err(DatabaseError::OtherVersion);
        }
        Ok(database)
    }

    fn connect(options: PgConnectOptions, reserve: Arc<dyn Reserve>) -> PostgresDatabase {
        let pool = |most| PgPoolOptions::new().max_connections(most).acquire_timeout(CONNECTION_PATIENCE);
        let writer = pool(WRITERS).connect_lazy_with(options.clone());
        let readers = pool(READERS).connect_lazy_with(options.clone());
        let waiting = pool(WAITING).connect_lazy_with(options);
        let owner = Owner::on(SeatId::new());
        PostgresDatabase {
            writer,
            readers,
            waiting,
            reserve,
            changes: Changes::default(),
            owner,
            is_ours: Arc::new(AtomicBool::new(true)),
            is_shared: false,
            held: None,
        }
    }

    /// The same database, used from a seat that may have been another process's before. Without, it is a new one.
    #[must_use]
    pub fn on_seat(self, seat: SeatId) -> PostgresDatabase {
        PostgresDatabase { owner: Owner::on(seat), ..self }
    }

    async fn version(&self) -> Result<Option<i64>, DatabaseError> {
        Ok(sqlx::query_scalar("SELECT max(version) FROM _sqlx_migrations").fetch_one(&self.readers).await?)
    }

    /// Whether it is new, or of an earlier version. What is of something else, or of a later one, is refused when that is looked at.
    async fn is_to_be_migrated(&self) -> Result<bool, DatabaseError> {
        let is_new: bool =
            sqlx::query_scalar("SELECT to_regclass('_sqlx_migrations') IS NULL").fetch_one(&self.readers).await?;
        Ok(is_new || self.version().await? < newest())
    }

    /// Brings it to this program's version. A database of something else is left as it is.
    async fn migrate(&self) -> Result<(), DatabaseError> {
        let encoding: String = sqlx::query_scalar("SHOW server_encoding").fetch_one(&self.readers).await?;
        let tables: Vec<String> = sqlx::query_scalar(
            "SELECT table_name::text FROM information_schema.tables WHERE table_schema = current_schema()",
        )
        .fetch_all(&self.readers)
        .await?;
        let is_foreign = !tables.is_empty() && !tables.iter().any(|table| table == "_sqlx_migrations");
        if is_foreign || encoding != "UTF8" {
            return Err(DatabaseError::Foreign);
        }
        migrations::migrator().run(&self.writer).await.map_err(|error| DatabaseError::Migration(Box::new(error)))
    }
}

/// This program's version.
fn newest() -> Option<i64> {
    migrations::migrator().iter().next_back().map(|migration| migration.version)
}

fn options(url: &DatabaseUrl) -> Result<PgConnectOptions, DatabaseError> {
    // what sqlx says of a bad address may show parts of it
    let parsed = url.is_postgres().then(|| url.secret().parse::<PgConnectOptions>().ok()).flatten();
    let options = parsed.ok_or_else(|| {
        DatabaseError::Unreachable(
            format!("{url} is no address of a database: postgres://user@host/name is one").into(),
        )
    })?;
    Ok(options.application_name("visage").options(SESSION))
}
