//! Reads of the database that many ask for at the same moment are made once for all of them.

use std::collections::HashMap;
use std::future::Future;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use futures_util::FutureExt;
use futures_util::future::{BoxFuture, Shared};

use crate::storage::DatabaseError;

/// What was read, or why it could not be.
type Outcome<T> = Result<Arc<T>, Arc<DatabaseError>>;
/// A read that any number wait for; it goes on without them.
type Read<T> = Shared<BoxFuture<'static, Outcome<T>>>;
type Places<K, T> = Mutex<HashMap<K, Place<T>>>;

/// The reads of one thing.
struct Place<T> {
    /// Has not begun: whoever asks now shares it.
    next: Option<Read<T>>,
    /// Has begun, so it may have missed what changed since: the next one follows it.
    begun: Option<Read<T>>,
}

impl<T> Default for Place<T> {
    fn default() -> Self {
        Place { next: None, begun: None }
    }
}

/// Reads by what they are of. Whoever asks gets what was stored at some moment after that: never the outcome of a read that had begun
/// before, since a change that its client knows of may be missing there.
pub struct SharedReads<K, T>(Arc<Places<K, T>>);

impl<K, T> Default for SharedReads<K, T> {
    fn default() -> Self {
        SharedReads(Arc::default())
    }
}

impl<K, T> std::fmt::Debug for SharedReads<K, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SharedReads").finish_non_exhaustive()
    }
}

impl<K, T> SharedReads<K, T>
where
    K: Copy + Eq + Hash + Send + 'static,
    T: Send + Sync + 'static,
{
    /// What `read` finds, or another one's `read` of the same that begins after this call.
    pub async fn get<R>(&self, of: K, read: impl FnOnce() -> R) -> Result<Arc<T>, DatabaseError>
    where
        R: Future<Output = Result<T, DatabaseError>> + Send + 'static,
    {
        let shared = {
            let mut places = lock(&self.0);
            let place = places.entry(of).or_default();
            match &place.next {
                Some(next) => next.clone(),
                None => place.next.insert(begin(of, self.0.clone(), place.begun.clone(), read())).clone(),
            }
        };
        shared.await.map_err(|error| same(&error))
    }
}

/// A read that begins when the one before has ended.
fn begin<K, T, R>(of: K, places: Arc<Places<K, T>>, before: Option<Read<T>>, read: R) -> Read<T>
where
    K: Copy + Eq + Hash + Send + 'static,
    T: Send + Sync + 'static,
    R: Future<Output = Result<T, DatabaseError>> + Send + 'static,
{
    let reading = async move {
        if let Some(before) = before {
            let _ = before.await;
        }
        let _turn = Turn::begin(of, places);
        read.await.map(Arc::new).map_err(Arc::new)
    };
    // of its own: those who wait may all leave, and a connection to the database must not stay taken then
    tokio::spawn(reading)
        .map(|ended| ended.unwrap_or_else(|panic| Err(Arc::new(DatabaseError::Failed(panic.into())))))
        .boxed()
        .shared()
}

/// A read that is under way.
struct Turn<K: Copy + Eq + Hash, T> {
    of: K,
    places: Arc<Places<K, T>>,
}

impl<K: Copy + Eq + Hash, T> Turn<K, T> {
    /// From now on nobody else shares it.
    fn begin(of: K, places: Arc<Places<K, T>>) -> Self {
        if let Some(place) = lock(&places).get_mut(&of) {
            place.begun = place.next.take();
        }
        Turn { of, places }
    }
}

impl<K: Copy + Eq + Hash, T> Drop for Turn<K, T> {
    fn drop(&mut self) {
        let mut places = lock(&self.places);
        match places.get_mut(&self.of) {
            Some(place) if place.next.is_some() => place.begun = None,
            _ => drop(places.remove(&self.of)),
        }
    }
}

fn lock<K, T>(places: &Places<K, T>) -> MutexGuard<'_, HashMap<K, Place<T>>> {
    places.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An error for each of those who share it.
fn same(error: &DatabaseError) -> DatabaseError {
    match error {
        DatabaseError::NotFound { kind, id } => DatabaseError::NotFound { kind, id: id.clone() },
        DatabaseError::Damaged { what, reason } => DatabaseError::Damaged { what, reason: reason.clone() },
        DatabaseError::Corrupt { found } => DatabaseError::Corrupt { found: found.clone() },
        DatabaseError::Shortage(source) => DatabaseError::Shortage(source.to_string().into()),
        DatabaseError::Unreachable(source) => DatabaseError::Unreachable(source.to_string().into()),
        DatabaseError::Failed(source) => DatabaseError::Failed(source.to_string().into()),
        DatabaseError::Unkeepable => DatabaseError::Unkeepable,
        DatabaseError::Full => DatabaseError::Full,
        DatabaseError::Locked => DatabaseError::Locked,
        DatabaseError::Busy => DatabaseError::Busy,
        // no read ends with another one
        other => DatabaseError::Failed(other.to_string().into()),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::task::{Context, Waker};

    use tokio::sync::{Semaphore, watch};

    use super::*;

    /// What is stored is a number; a read of it is under way until it is let through.
    struct Stored {
        value: AtomicU64,
        reads: AtomicU64,
        gate: Semaphore,
    }

    impl Stored {
        fn new(open: usize) -> Arc<Stored> {
            Arc::new(Stored { value: AtomicU64::new(0), reads: AtomicU64::new(0), gate: Semaphore::new(open) })
        }

        async fn read(self: Arc<Self>) -> Result<u64, DatabaseError> {
            self.reads.fetch_add(1, Ordering::SeqCst);
            let value = self.value.load(Ordering::SeqCst);
            self.gate.acquire().await.expect("never closed").forget();
            Ok(value)
        }
    }

    fn poll<F: Future>(future: std::pin::Pin<&mut F>) -> std::task::Poll<F::Output> {
        future.poll(&mut Context::from_waker(Waker::noop()))
    }

    #[tokio::test]
    async fn a_read_that_began_before_is_not_shared_and_one_that_follows_is() {
        let (reads, stored) = (SharedReads::default(), Stored::new(0));
        let ask = || Box::pin(reads.get(7, || stored.clone().read()));
        let mut early = ask();
        assert!(poll(early.as_mut()).is_pending());
        while stored.reads.load(Ordering::SeqCst) == 0 {
            tokio::task::yield_now().await;
        }
        stored.value.store(1, Ordering::SeqCst);
        let mut late = [ask(), ask(), ask()];
        for one in &mut late {
            assert!(poll(one.as_mut()).is_pending());
        }
        // one of those who wait leaves
        let [first, second, gone] = late;
        drop(gone);
        stored.gate.add_permits(2);
        assert_eq!(*early.await.expect("read"), 0);
        let (first, second) = (first.await.expect("read"), second.await.expect("read"));
        assert_eq!(*first, 1, "it was read after it was asked for");
        assert!(Arc::ptr_eq(&first, &second), "one read for both");
        assert_eq!(stored.reads.load(Ordering::SeqCst), 2);
        stored.gate.add_permits(1);
        assert!(!Arc::ptr_eq(&first, &ask().await.expect("read")), "and another one for who asks later");
        assert!(lock(&reads.0).is_empty());
    }

    #[tokio::test]
    async fn whoever_asks_for_something_else_shares_nothing_and_errors_are_for_all() {
        let reads = SharedReads::<u8, ()>::default();
        let missing = |id: &str| {
            let id = id.to_owned();
            async move { Err(DatabaseError::NotFound { kind: "job", id }) }
        };
        let (a, b, c) =
            tokio::join!(reads.get(1, || missing("a")), reads.get(1, || missing("b")), reads.get(2, || missing("c")));
        let said = [a, b, c].map(|ended| ended.expect_err("not there").to_string());
        assert_eq!(said, ["there is no job a", "there is no job a", "there is no job c"]);
        assert!(lock(&reads.0).is_empty());
    }

    #[tokio::test]
    async fn a_read_that_panics_or_that_nobody_waits_for_leaves_nothing() {
        let reads = SharedReads::<u8, u64>::default();
        let panics = || async { panic!("as the test wants it") };
        assert!(matches!(reads.get(1, panics).await, Err(DatabaseError::Failed(_))));
        let stored = Stored::new(0);
        let mut left = Box::pin(reads.get(1, || stored.clone().read()));
        assert!(poll(left.as_mut()).is_pending());
        drop(left);
        stored.gate.add_permits(1);
        while !lock(&reads.0).is_empty() {
            tokio::task::yield_now().await;
        }
    }

    /// As polls with `wait` do it: the bell is armed, then they look; whoever was woken by a change has to see it.
    #[tokio::test(flavor = "multi_thread", worker_threads = 4)]
    async fn nobody_sees_an_older_state_than_was_there_when_the_bell_rang() {
        const LAST: u64 = 2000;
        let (reads, stored) = (Arc::new(SharedReads::default()), Stored::new(Semaphore::MAX_PERMITS));
        let (ring, bell) = watch::channel(0);
        let followers: Vec<_> = (0..16)
            .map(|_| {
                let (reads, stored, mut bell) = (reads.clone(), stored.clone(), bell.clone());
                tokio::spawn(async move {
                    let mut seen = 0;
                    while seen < LAST {
                        let rung = *bell.borrow_and_update();
                        let now = *reads.get((), || stored.clone().read()).await.expect("read");
                        assert!(now >= rung, "{now} was seen after {rung} had been announced");
                        assert!(now >= seen, "{now} was seen after {seen}");
                        seen = now;
                        if seen < LAST {
                            bell.changed().await.expect("it rings until the last");
                        }
                    }
                })
            })
            .collect();
        for value in 1..=LAST {
            stored.value.store(value, Ordering::SeqCst);
            ring.send_replace(value);
            tokio::task::yield_now().await;
        }
        for follower in followers {
            follower.await.expect("nobody saw an older state");
        }
        assert!(lock(&reads.0).is_empty());
    }
}
