//! Writes: transactions, and what keeps those of several processes apart.
//!
//! What has to hold over several rows (how many jobs wait, that one evaluation does, a name that is given once) is checked by a
//! transaction that holds the write lock, an advisory lock of the database, from its start to its end. So such transactions come
//! one after the other, each sees all that was committed before (READ COMMITTED), and what holds on SQLite, where whoever writes
//! is alone, holds here for the same reason. None is ever refused for a conflict, so none has to be repeated, as those of
//! SERIALIZABLE would; what it costs is that commits wait for each other.
//!
//! What concerns single rows does without the lock: heartbeats, the audit log, and claims. A claim locks the row that it takes and
//! passes over those of others (`FOR UPDATE SKIP LOCKED`); whoever holds the write lock and goes on from a job's status locks that
//! row, too.

use std::ops::{Deref, DerefMut};
use std::sync::atomic::Ordering;

use sqlx::postgres::{PgConnection, Postgres};
use sqlx::{AssertSqlSafe, Transaction};

use super::PostgresDatabase;
use crate::storage::{DatabaseError, Unseen};

/// The name of the write lock among advisory locks.
const WRITE_LOCK: i64 = 0x7669_7361_6765_0001;
/// The clock that decides: the server's, in milliseconds since 1970.
const NOW: &str = "CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT)";

/// A transaction. Dropped before [`Self::commit`], it changes nothing.
pub(super) struct Writing {
    transaction: Transaction<'static, Postgres>,
    now_ms: i64,
}

impl Writing {
    /// When it began to be alone, by the clock that decides: the server's.
    pub(super) fn now_ms(&self) -> i64 {
        self.now_ms
    }

    /// Makes it durable.
    pub(super) async fn commit(self) -> Result<(), DatabaseError> {
        Ok(self.transaction.commit().await?)
    }

    /// The same for what the index in memory has to follow: queries wait until the answer is dropped.
    pub(super) async fn commit_unseen(self, store: &PostgresDatabase) -> Result<Unseen, DatabaseError> {
        let unseen = store.changes.begin().await;
        self.commit().await?;
        Ok(unseen)
    }
}

impl Deref for Writing {
    type Target = PgConnection;

    fn deref(&self) -> &PgConnection {
        &self.transaction
    }
}

impl DerefMut for Writing {
    fn deref_mut(&mut self) -> &mut PgConnection {
        &mut self.transaction
    }
}

impl PostgresDatabase {
    /// A transaction that holds the write lock.
    pub(super) async fn begin(&self) -> Result<Writing, DatabaseError> {
        // what stands in front is done first
        self.begin_by(format!("SELECT {NOW} FROM (SELECT pg_advisory_xact_lock({WRITE_LOCK}) OFFSET 0) AS alone")).await
    }

    /// The same: the space that is kept for a full disk is not the server's.
    pub(super) async fn begin_any(&self) -> Result<Writing, DatabaseError> {
        self.begin().await
    }

    /// A transaction whose rows have nothing to do with others.
    pub(super) async fn begin_rows(&self) -> Result<Writing, DatabaseError> {
        self.begin_by(format!("SELECT {NOW}")).await
    }

    async fn begin_by(&self, first: String) -> Result<Writing, DatabaseError> {
        self.check_ours()?;
        let mut transaction = self.writer.begin().await?;
        let now_ms = sqlx::query_scalar(AssertSqlSafe(first)).fetch_one(&mut *transaction).await?;
        Ok(Writing { transaction, now_ms })
    }

    /// A server that has lost the lock of its database may not write: another one may have begun.
    pub(super) fn check_ours(&self) -> Result<(), DatabaseError> {
        match self.is_ours.load(Ordering::Acquire) {
            true => Ok(()),
            false => Err(DatabaseError::Unreachable("the database is not this server's at the moment".into())),
        }
    }

    /// One state of everything, for several statements that read.
    pub(super) async fn snapshot(&self) -> Result<Transaction<'static, Postgres>, DatabaseError> {
        Ok(self.readers.begin_with("BEGIN ISOLATION LEVEL REPEATABLE READ, READ ONLY").await?)
    }

    /// The time by the clock that decides.
    pub(super) async fn now_ms(&self) -> Result<i64, DatabaseError> {
        Ok(sqlx::query_scalar(AssertSqlSafe(format!("SELECT {NOW}"))).fetch_one(&self.readers).await?)
    }

    /// Makes a write that gives space free or ends something; nothing is kept for it here.
    pub(super) async fn with_reserve<T, F>(&self, write: impl Fn() -> F) -> Result<T, DatabaseError>
    where
        F: Future<Output = Result<T, DatabaseError>>,
    {
        write().await
    }

    /// Whether space is kept, and not given away: here it never is.
    #[allow(clippy::unused_async, reason = "another database has to look at a disk")]
    pub(super) async fn has_reserve(&self) -> bool {
        true
    }
}
