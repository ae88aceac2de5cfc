//! Signatures for requests: computed while the client waits, one at a time, and given up when it goes away.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::problem::Problem;
use super::state::{AppState, blocking};
use crate::faces::Signature;
use crate::geometry::{Surface, Unit};
use crate::jobs::engine::Engine;
use crate::progress::{Progress, ProgressSink, Stage};
use crate::telemetry::panic_message;

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
pub async fn describe(state: &AppState, name: &str, surface: Surface, unit: Unit) -> Result<Signature, Problem> {
    computed(state, move |engine, progress| engine.describe(&surface, unit, progress).map_err(Problem::from))
        .await
        .map_err(|problem| problem.scan(name))
}

/// Lets the engine work for a request, on a pool with the server's threads; one at a time.
pub async fn computed<T: Send + 'static>(
    state: &AppState,
    work: impl FnOnce(&dyn Engine, &Progress) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let cancel = Arc::new(AtomicBool::new(false));
    let given_up = CancelOnDrop(cancel.clone());
    let working = async {
        let permit = state.describing.clone().acquire_owned().await.map_err(Problem::internal)?;
        let engine = state.shop.engine.clone();
        let threads = state.shop.config.threads.max(1);
        let progress = Progress::new(Arc::new(Nobody), cancel);
        blocking(move || {
            let _permit = permit;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Problem::internal)?;
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
