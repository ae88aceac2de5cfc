//! Threads that compute in the background: they give way to those that answer, and to what somebody waits for.

use std::sync::{Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// How much nicer than the rest of the process. Where a thread that computes and one that answers want the same processor, the first
/// gets a quarter of it; where nobody else wants it, all. Twice as much would nearly stop jobs beside other programs.
#[cfg(target_os = "linux")]
const NICER: i32 = 5;

/// So many threads, of this name and a number.
///
/// # Errors
/// The system gives no more threads.
pub fn workers(name: &'static str, threads: usize) -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |index| format!("{name}-{index}"))
        .start_handler(|_| give_way())
        .build()
}

/// Does work on a thread that gives way, and waits for it: no answer is to wait while a large file is read. Where the system gives no
/// thread, it is done on this one.
pub fn giving_way<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let work = Mutex::new(Some(work));
    let take = || work.lock().unwrap_or_else(PoisonError::into_inner).take();
    let runtime = tokio::runtime::Handle::try_current().ok();
    let done = std::thread::scope(|scope| {
        let there = || {
            let _inside = runtime.as_ref().map(tokio::runtime::Handle::enter);
            give_way();
            take().map(|work| work())
        };
        let thread = std::thread::Builder::new().name("visage-check".to_owned()).spawn_scoped(scope, there).ok()?;
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    match (done, take()) {
        (Some(done), _) => done,
        (None, Some(work)) => work(),
        // whoever takes the work does it
        (None, None) => unreachable!("the work is done where it was taken"),
    }
}

/// Linux alone has this for single threads: elsewhere the whole process would give way.
fn give_way() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICER) {
        tracing::debug!("a thread that computes has the priority of those that answer: {error}");
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn threads_that_compute_are_nicer_than_the_one_that_asks() {
        let niceness = || rustix::process::getpriority_process(None).expect("a thread has one");
        let own = niceness();
        let pool = workers("test", 2).expect("two threads");
        let inside = pool.broadcast(|_| niceness());
        assert_eq!(inside, vec![(own + NICER).min(19); 2]);
        assert_eq!(giving_way(niceness), (own + NICER).min(19));
        assert_eq!(niceness(), own);
    }

    #[tokio::test]
    async fn work_that_gives_way_knows_its_runtime_and_panics_as_it_would_here() {
        assert!(giving_way(|| tokio::runtime::Handle::try_current().is_ok()));
        let caught = std::panic::catch_unwind(|| giving_way(|| panic!("as the test wants it")));
        assert_eq!(caught.expect_err("a panic").downcast_ref::<&str>(), Some(&"as the test wants it"));
    }
}
