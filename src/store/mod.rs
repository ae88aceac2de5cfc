//! The only module that knows SQL: scan sets, the job queue, models and repeated requests in one SQLite file.
//!
//! - `scan_sets`: the ordered scans of one object and their pose file
//! - `jobs`: what the API does with jobs; `queue`: what the workers do with them
//! - `models`: models, their files and signatures
//! - `matches`: what queries need of them besides the index
//! - `standards`: classes that users have made, with their examples
//! - `evaluations`: what is missing or out of date, and the verdicts
//! - `replays`: answers kept for repeated POSTs
//! - `live_gallery`: the stored signatures, searchable in memory
//!
//! There is one writing connection and a few read-only ones, on a write-ahead log. Writes of several
//! statements take the write lock at their start (`BEGIN IMMEDIATE`): a transaction that begins by reading
//! and then writes would be refused at once when another one has written meanwhile.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod evaluations;
mod ids;
mod job_kind;
mod jobs;
pub mod live_gallery;
mod matches;
mod models;
mod queue;
mod replays;
mod scan_sets;
mod standards;
mod sweep;

use std::path::Path;
use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

pub use evaluations::{Backlog, Outdated, StoredVerdict};
pub use ids::{FileId, JobId, ModelId, ScanSetId, StandardId};
pub use job_kind::JobKind;
pub use jobs::{CancelAnswer, JobBase, JobError, JobFilter, JobRecord, JobStatus, NewJob};
pub use matches::MatchedModel;
pub use models::{AssetRecord, ModelFilter, ModelRecord, NewModel, StoredSignature};
pub use queue::{Finish, JobClaim};
pub use replays::{Replay, ReplayKey};
pub use scan_sets::{NewScanSet, PoseFile, PutScan, ScanRecord, ScanSetRecord, sort_naturally};
pub use standards::{Examples, NewStandard, StandardRecord};
pub use sweep::KnownFiles;

/// Connections that read at the same time.
const READERS: u32 = 4;
/// How long a statement waits for a lock before it fails.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// Why the store did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database failed.
    #[error("database: {0}")]
    Database(#[from] sqlx::Error),
    /// The database could not be brought to this program's version.
    #[error("migration of the database: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// A stored value is not what this program writes.
    #[error("the database holds {what} that can't be read: {reason}")]
    Damaged {
        /// The kind of value.
        what: &'static str,
        /// Why it can't be read.
        reason: String,
    },
    /// There is no such thing.
    #[error("there is no {kind} {id}")]
    NotFound {
        /// "scan set", "job", "model", "scan".
        kind: &'static str,
        /// What was asked for.
        id: String,
    },
    /// A job that is not finished needs it.
    #[error("{kind} {id} is used by an unfinished job")]
    InUse {
        /// "scan set" or "job".
        kind: &'static str,
        /// Which one.
        id: String,
    },
    /// The queue is full.
    #[error("{limit} jobs are waiting already")]
    QueueFull {
        /// How many may wait.
        limit: usize,
    },
    /// There is one of this name.
    #[error("there is a {kind} named {name:?} already")]
    NameTaken {
        /// "standard".
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// There is no room for another standard.
    #[error("there are {limit} standards already, the most that are kept")]
    TooManyStandards {
        /// How many there may be.
        limit: usize,
    },
    /// The scan set is full.
    #[error("a scan set holds at most {limit} scans")]
    TooManyScans {
        /// How many it may hold.
        limit: usize,
    },
    /// The job has ended in a way that does not allow this.
    #[error("job {id} is {}", status.name())]
    WrongStatus {
        /// Which job.
        id: JobId,
        /// What it is.
        status: JobStatus,
    },
    /// The key was used before, with another body.
    #[error("the idempotency key {key:?} was used before with another body")]
    KeyReused {
        /// The key.
        key: String,
    },
}

impl StoreError {
    /// Whether the database could not open a file of its own: the process is out of descriptors, and they come free
    /// again.
    pub fn is_shortage(&self) -> bool {
        // SQLITE_CANTOPEN; the higher bytes say more
        let cant_open = |code: &str| code.parse::<u32>().is_ok_and(|code| code & 0xff == 14);
        match self {
            StoreError::Database(sqlx::Error::Database(error)) => error.code().is_some_and(|code| cant_open(&code)),
            _ => false,
        }
    }
}

/// The embedded database. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    writer: SqlitePool,
    readers: SqlitePool,
}

impl Store {
    /// Opens the database file, creates it when absent, and brings it to this program's version.
    pub async fn open(file: &Path) -> Result<Store, StoreError> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            // a job is answered with 202 only when it would survive a power cut
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(BUSY_TIMEOUT)
            // what was deleted must not stay readable in the file
            .pragma("secure_delete", "ON");
        migrate(&options).await?;
        let writer = SqlitePoolOptions::new()
            .max_connections(1)
            .idle_timeout(None)
            .max_lifetime(None)
            .connect_with(options.clone())
            .await?;
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_with(options.read_only(true).create_if_missing(false))
            .await?;
        Ok(Store { writer, readers })
    }

    /// Whether the database answers.
    pub async fn ping(&self) -> Result<(), StoreError> {
        sqlx::query("SELECT 1").execute(&self.readers).await?;
        Ok(())
    }

    /// Closes all connections; the write-ahead log is folded into the file.
    pub async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }

    /// Empties the write-ahead log into the file, after a deletion: what was deleted must not stay readable in the log
    /// either. A reader that is in the way for long leaves it to the next deletion, or to the server's end.
    async fn fold_log(&self) {
        if let Err(error) = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(&self.writer).await {
            tracing::warn!("the write-ahead log is not emptied yet: {error}");
        }
    }

    /// A transaction that holds the write lock from its start.
    async fn begin(&self) -> Result<sqlx::Transaction<'static, sqlx::Sqlite>, StoreError> {
        Ok(self.writer.begin_with("BEGIN IMMEDIATE").await?)
    }
}

/// Brings the file to this program's version, on a connection that lets tables be built anew without taking along what
/// refers to them.
async fn migrate(options: &SqliteConnectOptions) -> Result<(), StoreError> {
    let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone().foreign_keys(false)).await?;
    let migrated = sqlx::migrate!("./migrations").run(&pool).await;
    pool.close().await;
    Ok(migrated?)
}

/// Milliseconds since 1970, as the tables keep times.
fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}

/// A stored time.
fn timestamp(ms: i64) -> Result<jiff::Timestamp, StoreError> {
    jiff::Timestamp::from_millisecond(ms).map_err(|error| damaged("a time", error))
}

/// Turns what the standard library or serde says of a stored value into our error.
fn damaged(what: &'static str, reason: impl ToString) -> StoreError {
    StoreError::Damaged { what, reason: reason.to_string() }
}

/// SQLite counts in i64; nothing stored here comes near its end.
fn to_i64(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// A stored count.
fn to_u64(count: i64) -> u64 {
    u64::try_from(count).unwrap_or(0)
}

/// A stored id.
macro_rules! stored_id {
    ($kind:ident, $text:expr) => {
        $crate::store::$kind::parse($text).ok_or_else(|| $crate::store::damaged("an id", $text))
    };
}
use stored_id;

/// One page of a list, newest first.
#[derive(Debug, Clone)]
pub struct Page<T> {
    /// The items.
    pub items: Vec<T>,
    /// Whether there are older ones.
    pub more: bool,
}

impl<T> Page<T> {
    /// From rows of which one more than `limit` was asked for.
    fn cut(mut items: Vec<T>, limit: usize) -> Self {
        let more = items.len() > limit;
        items.truncate(limit);
        Page { items, more }
    }

    /// Where the next page begins, if there is one.
    pub fn next_cursor(&self, id: impl Fn(&T) -> String) -> Option<String> {
        self.items.last().filter(|_| self.more).map(id)
    }
}

/// Which part of a list is wanted.
#[derive(Debug, Clone, Default)]
pub struct PageRequest {
    /// Only items older than this one.
    pub before: Option<String>,
    /// At most so many.
    pub limit: usize,
}

impl PageRequest {
    /// One row more than is shown tells whether there is a next page.
    fn sql_limit(&self) -> i64 {
        to_i64(self.limit as u64 + 1)
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// A store in a folder that goes with the test.
    pub async fn store() -> (Store, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::open(&folder.path().join("test.sqlite")).await.expect("a new database");
        (store, folder)
    }

    /// A scan set with the given scan names, each of 10 points.
    pub async fn scan_set(store: &Store, names: &[&str]) -> ScanSetId {
        let set = NewScanSet {
            id: ScanSetId::new(),
            name: "set".to_owned(),
            unit: crate::geometry::Unit::Mm,
            scans: names
                .iter()
                .map(|name| ScanRecord {
                    name: (*name).to_owned(),
                    file_id: FileId::new(),
                    points: 10,
                    bytes: 100,
                    checksum: "00".to_owned(),
                    reading: None,
                })
                .collect(),
            poses: None,
        };
        store.create_scan_set(&set, None).await.expect("stored");
        set.id
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second migration was the last before jobs had kinds.
    #[tokio::test]
    async fn a_database_from_before_kinds_keeps_its_jobs_and_models() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("old.sqlite");
        let options = SqliteConnectOptions::new().filename(&file).create_if_missing(true).foreign_keys(true);
        let old = SqlitePoolOptions::new().max_connections(1).connect_with(options).await.expect("a new database");
        let mut before = sqlx::migrate!("./migrations");
        before.migrations.to_mut().truncate(2);
        before.run(&old).await.expect("migrated");
        let (set, job, model) = (ScanSetId::new(), JobId::new(), ModelId::new());
        sqlx::query("INSERT INTO scan_set (id, name, unit) VALUES (?, 'set', 'mm')")
            .bind(set.to_string())
            .execute(&old)
            .await
            .expect("stored");
        let options = serde_json::to_string(&crate::pipeline::Options::default()).expect("plain data");
        sqlx::query("INSERT INTO job (id, scan_set_id, options, status) VALUES (?, ?, ?, 'succeeded')")
            .bind(job.to_string())
            .bind(set.to_string())
            .bind(options)
            .execute(&old)
            .await
            .expect("stored");
        sqlx::query(
            "INSERT INTO model (id, job_id, scan_set_id, name, unit, points) VALUES (?, ?, ?, 'model', 'mm', 1)",
        )
        .bind(model.to_string())
        .bind(job.to_string())
        .bind(set.to_string())
        .execute(&old)
        .await
        .expect("stored");
        old.close().await;

        let store = Store::open(&file).await.expect("brought up to date");
        let kept = store.job(job).await.expect("kept");
        assert_eq!((kept.kind, kept.scan_set_id, kept.model_id), (JobKind::Register, Some(set), Some(model)));
        store.delete_job(job).await.expect("deleted");
        let gone = store.model(model).await;
        assert!(matches!(gone, Err(StoreError::NotFound { .. })), "foreign keys hold again: {gone:?}");
    }
}
