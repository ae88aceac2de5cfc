//! Signatures for requests: computed while the client waits, a few at a time, and given up when it goes away.
//!
//! Who waits has its file on disk: a surface is read when it is its turn. Turns come in the order in which they were asked
//! for, and large surfaces never take all places, so a small one waits for small ones alone.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::problem::Problem;
use super::state::{AppState, blocking};
use super::upload::UploadedFile;
use visage_geometry::progress::{Progress, ProgressSink, Stage};
use visage_geometry::{Surface, Unit};
use visage_service::app::engine::Engine;
use visage_service::panics::panic_message;
use visage_shape::faces::Signature;

/// Larger files count as large: they take more than a second or two.
const LARGE: u64 = 8 << 20;

/// The places at which surfaces are described. Cheap to clone.
#[derive(Clone)]
pub struct Turns {
    all: Arc<Semaphore>,
    /// Those of the places that large surfaces may take.
    large: Arc<Semaphore>,
}

/// A place, until it is dropped.
pub struct Turn {
    _place: OwnedSemaphorePermit,
    _large: Option<OwnedSemaphorePermit>,
}

impl Turns {
    /// So many places; if there are several, one of them is for small surfaces alone.
    pub fn new(places: usize) -> Turns {
        let places = places.clamp(1, Semaphore::MAX_PERMITS);
        Turns { all: Arc::new(Semaphore::new(places)), large: Arc::new(Semaphore::new((places - 1).max(1))) }
    }

    async fn take(&self, bytes: u64) -> Result<Turn, Problem> {
        let large = match bytes > LARGE {
            true => Some(self.large.clone().acquire_owned().await.map_err(Problem::internal)?),
            false => None,
        };
        let place = self.all.clone().acquire_owned().await.map_err(Problem::internal)?;
        Ok(Turn { _place: place, _large: large })
    }
}

/// Waits until it is the file's turn to be read and described.
pub async fn turn(state: &AppState, file: &UploadedFile) -> Result<Turn, Problem> {
    turn_of(state, file.staged.bytes).await
}

/// Waits until it is the turn of a surface of so many bytes.
pub async fn turn_of(state: &AppState, bytes: u64) -> Result<Turn, Problem> {
    turn_in(state, &state.describing, bytes).await
}

/// Waits until it is the turn of work that takes many seconds.
pub async fn long_turn(state: &AppState) -> Result<Turn, Problem> {
    turn_of(state, LARGE + 1).await
}

/// The same, at other places.
pub async fn turn_in(state: &AppState, turns: &Turns, bytes: u64) -> Result<Turn, Problem> {
    tokio::select! {
        turn = turns.take(bytes) => turn,
        () = state.stop.cancelled() => Err(Problem::shutting_down()),
    }
}

/// Nobody watches the progress of a request.
struct Nobody;

impl ProgressSink for Nobody {
    fn report(&self, _stage: Stage, _fraction: f64) {}
}

/// Raises the cancel flag when the request is dropped.
struct CancelOnDrop(Arc<AtomicBool>);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Computes the signature of an uploaded surface on a pool with the server's threads.
pub async fn describe(
    state: &AppState,
    turn: Turn,
    name: &str,
    surface: Surface,
    unit: Unit,
) -> Result<Signature, Problem> {
    computed(state, turn, move |engine, progress| engine.describe(&surface, unit, progress).map_err(Problem::from))
        .await
        .map_err(|problem| problem.scan(name))
}

/// Lets the engine work for a request, on a pool with the server's threads. The place comes free when the work has ended,
/// be it that nobody waits for it any more.
pub async fn computed<T: Send + 'static>(
    state: &AppState,
    turn: Turn,
    work: impl FnOnce(&dyn Engine, &Progress) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let cancel = Arc::new(AtomicBool::new(false));
    let given_up = CancelOnDrop(cancel.clone());
    let working = async {
        let engine = state.context.engine.clone();
        let threads = state.context.config.threads.max(1);
        let progress = Progress::new(Arc::new(Nobody), cancel);
        blocking(move || {
            let _turn = turn;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Problem::shortage)?;
            let computed = AssertUnwindSafe(|| pool.install(|| work(&*engine, &progress)));
            std::panic::catch_unwind(computed)
                .unwrap_or_else(|payload| Err(Problem::internal(panic_message(&*payload))))
        })
        .await?
    };
    let outcome = tokio::select! {
        outcome = working => outcome,
        () = state.stop.cancelled() => Err(Problem::shutting_down()),
    };
    drop(given_up);
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn large_surfaces_leave_a_place_and_keep_their_order() {
        use futures_util::FutureExt;
        let turns = Turns::new(3);
        let large = || turns.take(LARGE + 1);
        let (first, second) = (large().await.expect("a place"), large().await.expect("a place"));
        let (mut third, mut fourth) = (Box::pin(large()), Box::pin(large()));
        assert!(third.as_mut().now_or_never().is_none() && fourth.as_mut().now_or_never().is_none());
        let small = turns.take(LARGE).await.expect("the place that is left");
        assert!(Box::pin(turns.take(1)).now_or_never().is_none(), "all are taken");
        drop(first);
        assert!(fourth.as_mut().now_or_never().is_none(), "the third is before it");
        let third = third.now_or_never().expect("its turn").expect("a place");
        drop((second, small, third));
        assert!(fourth.now_or_never().is_some());
    }

    #[tokio::test]
    async fn one_place_is_for_all() {
        let turns = Turns::new(0);
        drop(turns.take(LARGE + 1).await.expect("a place"));
        drop(turns.take(1).await.expect("a place"));
    }
}
