//! One server a database: the gallery in memory and its files follow what this process commits, so a second server would answer
//! wrongly. A server holds an advisory lock of the database for as long as it runs, on a connection of its own.
//!
//! When that connection is lost (the database server is restarted, a firewall has forgotten it) the lock is free. Nothing is
//! written until it is held again; if another server has taken it meanwhile, that goes on until that one ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions, Connection};
use tokio::sync::Notify;
use tokio::time::timeout;
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::storage::DatabaseError;

/// The name of the server's lock among advisory locks.
const SERVER_LOCK: i64 = 0x7669_7361_6765_0002;
/// How often a lock that is held, or a server that is gone, is tried again, and how often the connection is looked at.
const POLL: Duration = Duration::from_millis(200);
/// A connection that says nothing for so long is lost: less than the database server takes to find that out and to free the lock.
const SILENCE: Duration = Duration::from_secs(5);

/// The lock, held while this lives.
#[derive(Debug)]
pub(super) struct Alone {
    end: DropGuard,
}

impl Alone {
    /// Gives it up.
    pub(super) fn end(&self) {
        self.end.token().cancel();
    }

    /// Takes the lock; waits so long for a server that is about to end. `is_ours` tells from then on whether it is held, and
    /// `doubts` rings when it is again.
    pub(super) async fn take(
        options: &PgConnectOptions,
        patience: Duration,
        is_ours: Arc<AtomicBool>,
        doubts: Arc<Notify>,
    ) -> Result<Alone, DatabaseError> {
        let begin = Instant::now();
        let mut connection = options.connect().await?;
        while !try_lock(&mut connection).await? {
            if begin.elapsed() >= patience {
                return Err(DatabaseError::Taken);
            }
            tokio::time::sleep(POLL).await;
        }
        let (end, options) = (CancellationToken::new(), options.clone());
        let keep =
            end.clone().run_until_cancelled_owned(async move { hold(connection, &options, &is_ours, &doubts).await });
        tokio::spawn(keep);
        Ok(Alone { end: end.drop_guard() })
    }
}

async fn hold(mut connection: PgConnection, options: &PgConnectOptions, is_ours: &AtomicBool, doubts: &Notify) {
    loop {
        while matches!(timeout(SILENCE, connection.ping()).await, Ok(Ok(()))) {
            tokio::time::sleep(POLL).await;
        }
        is_ours.store(false, Ordering::Release);
        tracing::error!("the connection to the database is lost: nothing is written until it is there again");
        connection = again(options).await;
        is_ours.store(true, Ordering::Release);
        doubts.notify_one();
        tracing::info!("the database is there again");
    }
}

/// A connection that holds the lock, as soon as that can be.
async fn again(options: &PgConnectOptions) -> PgConnection {
    let mut has_complained = false;
    loop {
        if let Ok(Ok(mut connection)) = timeout(SILENCE, options.connect()).await {
            match try_lock(&mut connection).await {
                Ok(true) => return connection,
                Ok(false) if !std::mem::replace(&mut has_complained, true) => {
                    tracing::error!("another server uses the database now: stop one of them");
                }
                Ok(false) | Err(_) => {}
            }
        }
        tokio::time::sleep(POLL).await;
    }
}

async fn try_lock(connection: &mut PgConnection) -> Result<bool, DatabaseError> {
    Ok(sqlx::query_scalar("SELECT pg_try_advisory_lock($1)").bind(SERVER_LOCK).fetch_one(connection).await?)
}
