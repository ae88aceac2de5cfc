//! Threads that compute in the background: they give way to those that answer, and to what somebody waits for.

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
        assert_eq!(niceness(), own);
    }
}
