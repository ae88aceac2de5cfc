//! One SQLite file.
//!
//! The statements stand in `sql`; here is what is SQLite's own: `upkeep` is about the database as a whole, `writing` about
//! transactions, full disks and locks, `words` about how words are found in names.
//!
//! There is one writing connection and a few read-only ones, on a write-ahead log. Writes of several
//! statements take the write lock at their start (`BEGIN IMMEDIATE`): a transaction that begins by reading
//! and then writes would be refused at once when another one has written meanwhile.

#[cfg(test)]
mod bin_tests;
mod checksums;
mod dialect;
#[cfg(test)]
mod history_tests;
mod migrations;
mod others;
#[path = "../sql/mod.rs"]
#[allow(clippy::duplicate_mod, reason = "one text for each database, see there")]
mod sql;
mod upkeep;
mod words;
mod writing;

pub(in crate::storage) use writing::meaning;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

use super::unseen::Changes;
use crate::storage::{Database, DatabaseError, NoReserve, Reserve};
use visage_domain::{Owner, SeatId};

/// Connections that read at the same time.
const READERS: u32 = 4;
/// How long a statement waits for a lock before it fails.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// The embedded database. Cheap to clone.
#[derive(Debug, Clone)]
pub struct SqliteDatabase {
    writer: SqlitePool,
    readers: SqlitePool,
    reserve: Arc<dyn Reserve>,
    changes: Changes,
    owner: Owner,
}

impl Database for SqliteDatabase {}

impl SqliteDatabase {
    /// Opens a database that stands alone; see [`Self::open_with`].
    pub async fn open(file: &Path) -> Result<SqliteDatabase, DatabaseError> {
        Self::open_with(file, Arc::new(NoReserve)).await
    }

    /// Opens the database file, creates it when absent, checks it, and brings it to this program's version. `reserve`
    /// is what is given away when the disk is full.
    pub async fn open_with(file: &Path, reserve: Arc<dyn Reserve>) -> Result<SqliteDatabase, DatabaseError> {
        let options = options(file).create_if_missing(true);
        migrate(&options).await?;
        let store = Self::connect(options, reserve).await?;
        store.fill_in_checksums().await?;
        Ok(store)
    }

    /// Opens a database that another process of the same version may be using, and leaves it as it is.
    pub async fn open_beside(file: &Path) -> Result<SqliteDatabase, DatabaseError> {
        let store = Self::connect(options(file), Arc::new(NoReserve)).await?;
        let version: Option<i64> =
            sqlx::query_scalar("SELECT max(version) FROM _sqlx_migrations").fetch_one(&store.readers).await?;
        if version != migrations::migrator().iter().next_back().map(|migration| migration.version) {
            return Err(DatabaseError::OtherVersion);
        }
        Ok(store)
    }

    async fn connect(options: SqliteConnectOptions, reserve: Arc<dyn Reserve>) -> Result<Self, DatabaseError> {
        let writer = writing::writer(&options).await?;
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_with(options.read_only(true).create_if_missing(false))
            .await?;
        Ok(SqliteDatabase { writer, readers, reserve, changes: Changes::default(), owner: Owner::on(SeatId::new()) })
    }

    /// The same database, used from a seat that may have been another process's before. Without, it is a new one.
    #[must_use]
    pub fn on_seat(self, seat: SeatId) -> SqliteDatabase {
        SqliteDatabase { owner: Owner::on(seat), ..self }
    }
}

fn options(file: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(file)
        .journal_mode(SqliteJournalMode::Wal)
        // a job is answered with 202 only when it would survive a power cut
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(BUSY_TIMEOUT)
        // what was deleted must not stay readable in the file
        .pragma("secure_delete", "ON")
}

/// Checks the file and brings it to this program's version, on a connection that lets tables be built anew without
/// taking along what refers to them.
async fn migrate(options: &SqliteConnectOptions) -> Result<(), DatabaseError> {
    let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone().foreign_keys(false)).await?;
    let migrated = migrate_checked(&pool).await;
    pool.close().await;
    migrated
}

async fn migrate_checked(pool: &SqlitePool) -> Result<(), DatabaseError> {
    let tables: Vec<String> =
        sqlx::query_scalar("SELECT name FROM sqlite_schema WHERE type = 'table'").fetch_all(pool).await?;
    if !tables.is_empty() && !tables.iter().any(|table| table == "_sqlx_migrations") {
        return Err(DatabaseError::Foreign);
    }
    let found: Vec<String> = sqlx::query_scalar("PRAGMA quick_check(1)").fetch_all(pool).await?;
    if let Some(damage) = found.into_iter().find(|line| line != "ok") {
        return Err(DatabaseError::Corrupt { found: damage });
    }
    migrations::migrator().run(pool).await.map_err(|error| DatabaseError::Migration(Box::new(error)))
}

/// Milliseconds since 1970, as the tables keep times.
fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use crate::storage::conformance::DatabasePlace;
    pub use crate::storage::conformance::{claimant, scan_set};
    use crate::storage::database::Upkeep;
    use visage_domain::FolderId;

    /// A store in a folder that goes with the test.
    pub async fn store() -> (SqliteDatabase, tempfile::TempDir) {
        store_with(Arc::new(NoReserve)).await
    }

    /// The same with a reserve.
    pub async fn store_with(reserve: Arc<dyn Reserve>) -> (SqliteDatabase, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store =
            SqliteDatabase::open_with(&folder.path().join("test.sqlite"), reserve).await.expect("a new database");
        store.put_folder_id(FolderId::new()).await.expect("stored");
        (store, folder)
    }

    /// A connection of some other program to the same database.
    pub async fn other_program(folder: &tempfile::TempDir) -> sqlx::SqliteConnection {
        use sqlx::ConnectOptions;
        let options = SqliteConnectOptions::new().filename(folder.path().join("test.sqlite"));
        options.connect().await.expect("a connection")
    }

    impl SqliteDatabase {
        /// Makes the database full at this many pages (at the pages it has, if that is more); `None` ends that.
        pub async fn set_most_pages(&self, pages: Option<u32>) {
            let pragma = format!("PRAGMA max_page_count = {}", pages.unwrap_or(u32::MAX - 1));
            sqlx::query(sqlx::AssertSqlSafe(pragma)).execute(&self.writer).await.expect("set");
        }

        /// How long the writer waits for locks.
        pub async fn set_patience(&self, patience: Duration) {
            let pragma = format!("PRAGMA busy_timeout = {}", patience.as_millis());
            sqlx::query(sqlx::AssertSqlSafe(pragma)).execute(&self.writer).await.expect("set");
        }
    }

    /// A database file that several processes may use.
    pub struct SqlitePlace {
        folder: tempfile::TempDir,
    }

    impl SqlitePlace {
        async fn database(&self) -> SqliteDatabase {
            SqliteDatabase::open(&self.folder.path().join("test.sqlite")).await.expect("opened")
        }
    }

    #[async_trait::async_trait]
    impl DatabasePlace for SqlitePlace {
        async fn new() -> Self {
            SqlitePlace { folder: tempfile::tempdir().expect("a temporary folder") }
        }

        async fn open(&self, seat: SeatId) -> Arc<dyn Database> {
            Arc::new(self.database().await.on_seat(seat))
        }

        async fn open_full(&self) -> Arc<dyn Database> {
            let database = self.database().await;
            database.set_most_pages(Some(1)).await;
            Arc::new(database)
        }
    }

    mod conformance {
        use super::SqlitePlace;

        crate::storage::conformance::database_conformance!(SqlitePlace);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::database::*;
    use visage_domain::{JobId, JobKind, JobStatus, ModelId, ScanSetId};

    /// The second migration was the last before jobs had kinds.
    #[tokio::test]
    async fn a_database_from_before_kinds_keeps_its_jobs_and_models() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("old.sqlite");
        let options = SqliteConnectOptions::new().filename(&file).create_if_missing(true).foreign_keys(true);
        let old = SqlitePoolOptions::new().max_connections(1).connect_with(options).await.expect("a new database");
        let mut before = migrations::migrator();
        before.migrations.to_mut().truncate(2);
        before.run(&old).await.expect("migrated");
        let (set, job, model) = (ScanSetId::new(), JobId::new(), ModelId::new());
        sqlx::query("INSERT INTO scan_set (id, name, unit) VALUES (?, 'set', 'mm')")
            .bind(set.to_string())
            .execute(&old)
            .await
            .expect("stored");
        let options = serde_json::to_string(&visage_domain::options::Options::default()).expect("plain data");
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

        let store = SqliteDatabase::open(&file).await.expect("brought up to date");
        let kept = store.job(job).await.expect("kept");
        assert_eq!((kept.kind, kept.scan_set_id, kept.model_id), (JobKind::Register, Some(set), Some(model)));
        drop(store.delete_job(job).await.expect("deleted"));
        let gone = store.model(model).await;
        assert!(matches!(gone, Err(DatabaseError::NotFound { .. })), "foreign keys hold again: {gone:?}");
    }

    /// The sixth migration was the last before there were seats. One process had the database then.
    #[tokio::test]
    async fn what_ran_before_there_were_seats_is_taken_back_at_the_first_start() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("old.sqlite");
        let options = SqliteConnectOptions::new().filename(&file).create_if_missing(true).foreign_keys(true);
        let old = SqlitePoolOptions::new().max_connections(1).connect_with(options).await.expect("a new database");
        let mut before = migrations::migrator();
        before.migrations.to_mut().truncate(6);
        before.run(&old).await.expect("migrated");
        let (job, model) = (JobId::new(), ModelId::new());
        let running = "INSERT INTO job (id, kind, options, status, worker, leased_until)
                       VALUES (?, 'evaluate', ?, 'running', 'somebody', ?)";
        sqlx::query(running)
            .bind(job.to_string())
            .bind(serde_json::to_string(&visage_domain::options::Options::default()).expect("plain data"))
            .bind(now_ms() + 30_000)
            .execute(&old)
            .await
            .expect("stored");
        sqlx::query("INSERT INTO loose_file (kind, id, is_deleted, since) VALUES ('model', ?, 0, ?)")
            .bind(model.to_string())
            .bind(now_ms())
            .execute(&old)
            .await
            .expect("stored");
        old.close().await;

        let database = SqliteDatabase::open(&file).await.expect("brought up to date");
        assert_eq!(database.reclaim_jobs(3).await.expect("a start"), 1);
        assert_eq!(database.job(job).await.expect("there").status, JobStatus::Queued);
        let (_, loose) = database.known_files().await.expect("read");
        assert!(loose[0].is_left(database.owner(), jiff::Timestamp::now()), "{loose:?}");
    }
}
