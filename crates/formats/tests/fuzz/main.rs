//! Sound files of every reader, changed at random with their structure in mind: never a panic, no hang, no memory beyond
//! the limits, and whatever is read is sound.
//!
//! A plain run tries some hundred files a reader. `VISAGE_FUZZ_SECONDS=600` spends so much CPU on each,
//! `VISAGE_FUZZ_READER=e57` keeps to one reader, and `VISAGE_FUZZ_SEED` begins elsewhere. A file that
//! goes wrong is kept in the folder for tests' files below `target`, and the message says where: once the fault is mended it
//! goes into `corpus/`, which every run reads first. With `VISAGE_FUZZ_TRACE=1` each file is kept there before it is read, for
//! faults that end the process.
//!
//! The changes are blind, but files that are answered in a new way (another message, another set of attributes) are
//! changed further, which leads to the depths of a reader much as measuring its coverage would.

mod bounds;
mod check;
mod corpus;
mod mutate;
mod readers;
mod seeds;
mod words;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use bounds::{Watch, cpu_time};
use readers::{READERS, Target};
use seeds::Seed;

/// Files of a reader without a budget of time.
const FILES: u64 = 150;
/// One small file must not take longer (CPU of a debug build).
const MOST_TIME: Duration = Duration::from_secs(2);
/// Files that are changed further, at most.
const MOST_KEPT: usize = 600;
/// The largest file that is tried.
const MOST_BYTES: usize = 64 << 10;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name} is no number: {text}")))
}

/// What a reader said, without what differs from file to file: numbers, and words of the file.
fn kind_of(answer: &str) -> String {
    const MOST: usize = 100;
    let mut is_quoted = false;
    let letters = answer.chars().filter(|c| {
        is_quoted ^= *c == '"';
        !is_quoted && c.is_ascii_alphabetic()
    });
    letters.take(MOST).collect()
}

/// One run over a reader.
struct Run<'a> {
    target: &'a Target,
    watch: &'a Watch,
    /// Answers so far.
    kinds: BTreeSet<String>,
    slowest: Duration,
    largest: usize,
}

impl Run<'_> {
    /// Reads a file and holds it to the bounds; whether the answer is of a new kind.
    fn is_new(&mut self, name: &str, bytes: &[u8], whence: &str) -> bool {
        let kept = self.watch.begin(self.target.name, name, bytes);
        let (before, begin) = (bounds::used_bytes(), cpu_time());
        bounds::reset_peak();
        let answer = std::panic::catch_unwind(|| (self.target.read)(name, bytes));
        let (time, memory) = (cpu_time() - begin, bounds::peak_bytes().saturating_sub(before));
        self.watch.end();
        let fail = |what: String| -> ! {
            let path = kept.write();
            panic!("{} {whence}: {name} {what}; the file is {}", self.target.name, path.display())
        };
        let Ok(answer) = answer else { fail("makes the reader panic".into()) };
        if time > MOST_TIME {
            fail(format!("takes {time:?}"));
        }
        if memory > bounds::most_memory(bytes.len()) {
            fail(format!("takes {memory} bytes of memory, for {} of its own", bytes.len()));
        }
        self.slowest = self.slowest.max(time);
        self.largest = self.largest.max(memory);
        self.kinds.insert(kind_of(&answer))
    }
}

/// Changes files of a reader until its time or number is spent.
fn fuzz(target: &Target, watch: &Watch, seconds: Option<Duration>, first: u64) {
    let mut run = Run { target, watch, kinds: BTreeSet::new(), slowest: Duration::ZERO, largest: 0 };
    let mut pool = (target.seeds)();
    for seed in &pool {
        let bytes = (seed.wrap)(&seed.bytes);
        run.is_new(&seed.name, &bytes, "as it is");
        let answer = (target.read)(&seed.name, &bytes);
        assert!(!answer.starts_with(check::REFUSED), "{}: {} is sound, but: {answer}", target.name, seed.name);
    }
    for (name, bytes) in corpus::of(target.name) {
        run.is_new(&name, &bytes, "of the corpus");
        pool.push(Seed::plain(&name, bytes));
    }
    let begin = cpu_time();
    let mut count = 0;
    while seconds.map_or(count < FILES, |budget| cpu_time() - begin < budget) {
        let mut random = ChaCha8Rng::seed_from_u64(first + count);
        let seed = mutate::pick(&mut random, &pool);
        let (name, wrap) = (seed.name.clone(), seed.wrap);
        let mut inner = seed.bytes.clone();
        // what is inside of checksums and packing, then perhaps the outside
        for _ in 0..random.random_range(1..5) {
            mutate::change(&mut random, &mut inner, &pool, target.words);
        }
        inner.truncate(MOST_BYTES);
        let mut bytes = wrap(&inner);
        if random.random_bool(0.15) {
            mutate::change(&mut random, &mut bytes, &pool, target.words);
            bytes.truncate(MOST_BYTES);
        }
        let whence = format!("VISAGE_FUZZ_SEED={first}, file {count}");
        if run.is_new(&name, &bytes, &whence) && pool.len() < MOST_KEPT {
            pool.push(Seed { name, bytes: inner, wrap });
        }
        count += 1;
    }
    println!(
        "{:10} {count:7} files, {:4} kinds of answers, {:6.1} s; at most {:5.1} ms and {:5} KiB a file",
        target.name,
        run.kinds.len(),
        (cpu_time() - begin).as_secs_f64(),
        run.slowest.as_secs_f64() * 1e3,
        run.largest >> 10,
    );
}

/// Where files that go wrong are kept.
fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fuzz")
}

#[test]
fn changed_files_are_read_soundly_or_refused() {
    let seconds = number("VISAGE_FUZZ_SECONDS").map(Duration::from_secs);
    let first = number("VISAGE_FUZZ_SEED").unwrap_or(0);
    let wanted = std::env::var("VISAGE_FUZZ_READER").unwrap_or_default();
    let targets: Vec<&Target> = READERS.iter().filter(|target| wanted.is_empty() || target.name == wanted).collect();
    assert!(!targets.is_empty(), "no reader is called {wanted}");
    readers::check_table();
    corpus::check_list();
    // readers that use threads do all of it here, so that time and memory are theirs
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    assert!(pool.is_ok(), "a pool was there before");
    // panics that readers catch themselves are no news
    if std::env::var("RUST_BACKTRACE").as_deref() != Ok("full") {
        std::panic::set_hook(Box::new(|panic| {
            let text = panic.payload_as_str().unwrap_or_default();
            let is_ours = panic.location().is_some_and(|place| !place.file().contains("/registry/"));
            if is_ours {
                eprintln!("{text} ({})", panic.location().map(ToString::to_string).unwrap_or_default());
            }
        }));
    }
    let watch = Watch::start();
    targets.into_iter().for_each(|target| fuzz(target, &watch, seconds, first));
}
