//! Writes: one at a time, whole or not at all, on a connection that no failure spoils.
//!
//! A transaction is a plain `BEGIN IMMEDIATE` and `COMMIT`, not one that the driver counts: when a disk is full or
//! fails, SQLite has rolled back already, and a driver that still counts an open transaction refuses every later one.
//! Whatever is open when a connection is given back is rolled back then.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use sqlx::pool::PoolConnection;
use sqlx::sqlite::{Sqlite, SqliteConnectOptions, SqliteConnection, SqlitePool, SqlitePoolOptions};

use super::{SqliteDatabase, now_ms};
use crate::storage::{DatabaseError, Unseen};

/// SQLite's result codes, the low byte of the extended ones.
mod code {
    pub const BUSY: i32 = 5;
    pub const LOCKED: i32 = 6;
    pub const CORRUPT: i32 = 11;
    pub const FULL: i32 = 13;
    pub const CANT_OPEN: i32 = 14;
    pub const NOT_A_DATABASE: i32 = 26;
    /// Extended: the index of the write-ahead log could not be made larger.
    pub const INDEX_SIZE: i32 = 10 | (19 << 8);
}

/// What an error of SQLite means, by its extended code.
pub(in crate::storage) fn meaning(extended: Option<i32>, error: sqlx::Error) -> DatabaseError {
    match extended.map(|extended| (extended & 0xff, extended)) {
        Some((code::FULL, _) | (_, code::INDEX_SIZE)) => DatabaseError::Full,
        Some((code::BUSY | code::LOCKED, _)) => DatabaseError::Locked,
        Some((code::CORRUPT | code::NOT_A_DATABASE, _)) => DatabaseError::Corrupt { found: error.to_string() },
        Some((code::CANT_OPEN, _)) => DatabaseError::Shortage(Box::new(error)),
        _ => DatabaseError::Failed(Box::new(error)),
    }
}

/// The pool of the one connection that writes.
pub(super) async fn writer(options: &SqliteConnectOptions) -> Result<SqlitePool, DatabaseError> {
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .idle_timeout(None)
        .max_lifetime(None)
        .after_release(|connection, _| {
            Box::pin(async move {
                // the usual answer is that nothing is open
                let _ = sqlx::query("ROLLBACK").execute(connection).await;
                Ok(true)
            })
        })
        .connect_with(options.clone())
        .await?;
    Ok(pool)
}

/// A transaction that holds the write lock from its start. Dropped before [`Self::commit`], it changes nothing.
pub(super) struct Writing {
    connection: PoolConnection<Sqlite>,
    now_ms: i64,
}

impl Writing {
    /// When it began, by the clock that decides: this machine's.
    pub(super) fn now_ms(&self) -> i64 {
        self.now_ms
    }

    /// Makes it durable.
    pub(super) async fn commit(mut self) -> Result<(), DatabaseError> {
        sqlx::query("COMMIT").execute(&mut *self.connection).await?;
        Ok(())
    }

    /// The same for what the index in memory has to follow: queries wait until the answer is dropped.
    pub(super) async fn commit_unseen(self, store: &SqliteDatabase) -> Result<Unseen, DatabaseError> {
        let unseen = store.changes.begin().await;
        self.commit().await?;
        Ok(unseen)
    }
}

impl Deref for Writing {
    type Target = SqliteConnection;

    fn deref(&self) -> &SqliteConnection {
        &self.connection
    }
}

impl DerefMut for Writing {
    fn deref_mut(&mut self) -> &mut SqliteConnection {
        &mut self.connection
    }
}

impl SqliteDatabase {
    /// A transaction of what takes space: refused while the reserve is given away.
    pub(super) async fn begin(&self) -> Result<Writing, DatabaseError> {
        if !self.has_reserve().await {
            return Err(DatabaseError::Full);
        }
        self.begin_any().await
    }

    /// A transaction of what must be possible on a full disk too; see [`Self::with_reserve`].
    pub(super) async fn begin_any(&self) -> Result<Writing, DatabaseError> {
        let mut connection = self.writer.acquire().await?;
        sqlx::query("BEGIN IMMEDIATE").execute(&mut *connection).await?;
        Ok(Writing { connection, now_ms: now_ms() })
    }

    /// A transaction whose rows have nothing to do with others: here one like any.
    pub(super) async fn begin_rows(&self) -> Result<Writing, DatabaseError> {
        self.begin_any().await
    }

    /// One state of everything, for several statements that read.
    pub(super) async fn snapshot(&self) -> Result<sqlx::Transaction<'static, Sqlite>, DatabaseError> {
        Ok(self.readers.begin().await?)
    }

    /// The time by the clock that decides.
    #[allow(clippy::unused_async, reason = "another database has to be asked for its own")]
    pub(super) async fn now_ms(&self) -> Result<i64, DatabaseError> {
        Ok(now_ms())
    }

    /// Makes a write that gives space free or ends something: if the disk is full, once more with the reserve.
    pub(super) async fn with_reserve<T, F>(&self, write: impl Fn() -> F) -> Result<T, DatabaseError>
    where
        F: Future<Output = Result<T, DatabaseError>>,
    {
        match write().await {
            Err(DatabaseError::Full) if self.reserve.give() => {
                tracing::warn!("the disk is full: the reserve is used for what ends jobs and deletes");
                write().await
            }
            done => done,
        }
    }

    pub(super) async fn has_reserve(&self) -> bool {
        let reserve = Arc::clone(&self.reserve);
        tokio::task::spawn_blocking(move || reserve.is_whole()).await.unwrap_or(false)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use super::super::testing;
    use super::*;
    use crate::storage::Reserve;
    use crate::storage::database::*;
    use visage_domain::{Finish, JobError, JobId, JobStatus, NewJob, NewModel, NewScanSet, ScanSetId};
    use visage_geometry::Unit;

    fn large_set() -> NewScanSet {
        let poses = visage_domain::PoseFile { name: "poses".to_owned(), content: vec![7; 100_000] };
        NewScanSet {
            id: ScanSetId::new(),
            name: "set".to_owned(),
            unit: Unit::Mm,
            scans: Vec::new(),
            poses: Some(poses),
            passed_over: Vec::new(),
        }
    }

    /// Space that comes and goes as the test wants.
    #[derive(Debug, Default)]
    struct TestReserve {
        given: AtomicBool,
        has_space: AtomicBool,
    }

    impl Reserve for TestReserve {
        fn is_whole(&self) -> bool {
            if self.has_space.load(Ordering::Relaxed) {
                self.given.store(false, Ordering::Relaxed);
            }
            !self.given.load(Ordering::Relaxed)
        }

        fn give(&self) -> bool {
            !self.given.swap(true, Ordering::Relaxed)
        }

        fn has_space(&self) -> bool {
            self.has_space.load(Ordering::Relaxed)
        }
    }

    #[tokio::test]
    async fn a_full_database_takes_writes_again_as_soon_as_there_is_space() {
        let (store, _folder) = testing::store().await;
        store.set_most_pages(Some(1)).await;
        for _ in 0..3 {
            let refused = store.create_scan_set(&large_set(), None).await.expect_err("full");
            assert!(matches!(refused, DatabaseError::Full), "{refused}");
        }
        store.set_most_pages(None).await;
        let set = large_set();
        store.create_scan_set(&set, None).await.expect("there is space again");
        drop(store.delete_scan_set(set.id).await.expect("deleted"));
    }

    #[tokio::test]
    async fn a_write_that_was_broken_off_holds_no_lock_and_leaves_nothing() {
        let (store, _folder) = testing::store().await;
        let id = testing::scan_set(&store, &[]).await;
        let mut broken_off = store.begin().await.expect("begun");
        sqlx::query("DELETE FROM scan_set").execute(&mut *broken_off).await.expect("deleted");
        drop(broken_off);
        testing::scan_set(&store, &[]).await;
        store.scan_set(id).await.expect("nothing was deleted");
    }

    #[tokio::test]
    async fn the_reserve_lets_ends_and_deletions_through_and_nothing_else() {
        let reserve = Arc::new(TestReserve::default());
        let (store, _folder) = testing::store_with(reserve.clone()).await;
        let set = testing::scan_set(&store, &["a.ply", "b.ply"]).await;
        let job = NewJob {
            id: JobId::new(),
            scan_set_id: set,
            label: None,
            options: Default::default(),
            base: None,
            hints: Default::default(),
        };
        store.create_job(&job, None, 10, None).await.expect("queued");
        let claim = store.claim_job(&testing::claimant("w")).await.expect("asked").expect("one waits");

        reserve.give();
        assert!(matches!(store.create_scan_set(&large_set(), None).await, Err(DatabaseError::Full)));
        assert!(matches!(store.check_writable().await, Err(DatabaseError::Full)));
        let error = JobError { code: "x".into(), message: "y".into(), scan: None, hint: "z".into() };
        assert!(store.finish_job(&claim, &Finish::Failed(error)).await.expect("ended").is_some());
        assert_eq!(store.job(job.id).await.expect("there").status, JobStatus::Failed);
        drop(store.delete_scan_set(set).await.expect("deleted"));

        reserve.has_space.store(true, Ordering::Relaxed);
        store.check_writable().await.expect("there is space");
        drop(store.create_model(&NewModel::example(None), None).await.expect("stored"));
    }

    #[tokio::test]
    async fn what_is_full_is_tried_once_more_with_the_reserve() {
        let reserve = Arc::new(TestReserve::default());
        let (store, _folder) = testing::store_with(reserve.clone()).await;
        let tries = std::cell::Cell::new(0);
        let write = || async {
            tries.set(tries.get() + 1);
            if reserve.given.load(Ordering::Relaxed) { Ok(()) } else { Err(DatabaseError::Full) }
        };
        store.with_reserve(write).await.expect("the reserve is enough");
        assert_eq!(tries.get(), 2);
    }

    #[tokio::test]
    async fn a_lock_of_another_program_is_told_from_a_failure() {
        let (store, folder) = testing::store().await;
        let mut other = testing::other_program(&folder).await;
        sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.expect("locked");
        store.set_patience(Duration::from_millis(10)).await;
        let refused = store.create_scan_set(&large_set(), None).await.expect_err("locked");
        assert!(matches!(refused, DatabaseError::Locked), "{refused}");
        sqlx::query("ROLLBACK").execute(&mut other).await.expect("free");
        store.create_scan_set(&large_set(), None).await.expect("free again");
    }

    #[test]
    fn connections_that_are_all_in_use_are_no_lock() {
        assert!(matches!(DatabaseError::from(sqlx::Error::PoolTimedOut), DatabaseError::Busy));
    }
}
