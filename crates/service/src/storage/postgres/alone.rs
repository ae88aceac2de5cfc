//! Which servers use a database. Those that keep their files in one bucket may be several; one whose files are in a folder is alone, since
//! others would miss its files. And each has a seat of its own: who starts on one takes over what was left there.
//!
//! Advisory locks say so, held on a connection of their own for as long as a server runs: one of the database, shared or not, and one of the
//! seat. When that connection is lost (the database server is restarted, a firewall has forgotten it) they are free. Nothing is
//! written until they are held again; if another server has taken one meanwhile, that goes on until that one ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{AssertSqlSafe, ConnectOptions, Connection};
use tokio::time::timeout;
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::storage::DatabaseError;
use visage_domain::SeatId;

/// The name of the servers' lock among advisory locks.
const SERVER_LOCK: i64 = 0x7669_7361_6765_0002;
/// How often a lock that is held, or a server that is gone, is tried again, and how often the connection is looked at.
const POLL: Duration = Duration::from_millis(200);
/// A connection that says nothing for so long is lost: less than the database server takes to find that out and to free the lock.
const SILENCE: Duration = Duration::from_secs(5);

/// Who wants to use a database.
#[derive(Debug, Clone, Copy)]
pub struct Claim {
    /// What no two servers have at a time.
    pub seat: SeatId,
    /// Whether others may use the database, too.
    pub is_shared: bool,
}

/// Locks that are held, on their connection.
pub(super) struct Locks {
    connection: PgConnection,
    options: PgConnectOptions,
    claim: Claim,
}

/// The locks, held while this lives.
#[derive(Debug)]
pub(super) struct Held {
    end: DropGuard,
}

impl Held {
    /// Gives them up.
    pub(super) fn end(&self) {
        self.end.token().cancel();
    }
}

impl Locks {
    /// Takes the locks for a server whose tables may have to be changed, which nobody may look at meanwhile; `is_due` says whether they
    /// have to. Waits so long for servers that are about to end.
    pub(super) async fn take<F>(
        options: &PgConnectOptions,
        claim: Claim,
        patience: Duration,
        is_due: impl Fn() -> F,
    ) -> Result<Locks, DatabaseError>
    where
        F: Future<Output = Result<bool, DatabaseError>>,
    {
        let begin = Instant::now();
        let mut connection = options.connect().await?;
        let refused = loop {
            let alone = !claim.is_shared || is_due().await?;
            let refused = match try_lock(&mut connection, SERVER_LOCK, !alone).await? {
                false if claim.is_shared && alone => DatabaseError::OthersOfBefore,
                false => DatabaseError::Taken,
                true if try_lock(&mut connection, seat_lock(claim.seat), false).await? => {
                    return Ok(Locks { connection, options: options.clone(), claim });
                }
                true => {
                    unlock(&mut connection, !alone).await?;
                    DatabaseError::SeatTaken
                }
            };
            if begin.elapsed() >= patience {
                break refused;
            }
            tokio::time::sleep(POLL).await;
        };
        Err(refused)
    }

    /// Lets others use the database that may, and keeps the locks. `is_ours` tells from then on whether they are held.
    pub(super) async fn hold(mut self, is_ours: Arc<AtomicBool>) -> Result<Held, DatabaseError> {
        if self.claim.is_shared {
            // whoever has a lock for himself may share it, too
            try_lock(&mut self.connection, SERVER_LOCK, true).await?;
            unlock(&mut self.connection, false).await?;
        }
        let end = CancellationToken::new();
        let keep = end.clone().run_until_cancelled_owned(async move { self.keep(&is_ours).await });
        tokio::spawn(keep);
        Ok(Held { end: end.drop_guard() })
    }

    async fn keep(mut self, is_ours: &AtomicBool) {
        loop {
            while matches!(timeout(SILENCE, self.connection.ping()).await, Ok(Ok(()))) {
                tokio::time::sleep(POLL).await;
            }
            is_ours.store(false, Ordering::Release);
            tracing::error!("the connection to the database is lost: nothing is written until it is there again");
            self.connection = again(&self.options, self.claim).await;
            is_ours.store(true, Ordering::Release);
            tracing::info!("the database is there again");
        }
    }
}

/// A connection that holds the locks, as soon as that can be.
async fn again(options: &PgConnectOptions, claim: Claim) -> PgConnection {
    let mut has_complained = false;
    loop {
        if let Ok(Ok(mut connection)) = timeout(SILENCE, options.connect()).await {
            match try_both(&mut connection, claim).await {
                Ok(true) => return connection,
                Ok(false) if !std::mem::replace(&mut has_complained, true) => {
                    tracing::error!("another server uses the database now, or this server's seat: stop one of them");
                }
                Ok(false) | Err(_) => {}
            }
        }
        tokio::time::sleep(POLL).await;
    }
}

async fn try_both(connection: &mut PgConnection, claim: Claim) -> Result<bool, DatabaseError> {
    Ok(try_lock(connection, SERVER_LOCK, claim.is_shared).await?
        && try_lock(connection, seat_lock(claim.seat), false).await?)
}

/// The name of a seat's lock: random ids don't meet.
fn seat_lock(seat: SeatId) -> i64 {
    let hash = blake3::hash(seat.to_string().as_bytes());
    i64::from_be_bytes(hash.as_bytes().first_chunk().copied().unwrap_or_default())
}

async fn try_lock(connection: &mut PgConnection, lock: i64, is_shared: bool) -> Result<bool, DatabaseError> {
    let shared = if is_shared { "_shared" } else { "" };
    let statement = format!("SELECT pg_try_advisory_lock{shared}({lock})");
    Ok(sqlx::query_scalar(AssertSqlSafe(statement)).fetch_one(connection).await?)
}

/// Gives up the servers' lock.
async fn unlock(connection: &mut PgConnection, is_shared: bool) -> Result<(), DatabaseError> {
    let shared = if is_shared { "_shared" } else { "" };
    let statement = format!("SELECT pg_advisory_unlock{shared}({SERVER_LOCK})");
    // PostgreSQL warns of one that was not held
    sqlx::query(AssertSqlSafe(statement)).execute(connection).await?;
    Ok(())
}
