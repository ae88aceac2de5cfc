//! What a file may cost: memory by an allocator that counts, time by the process's CPU, and a watch that ends what hangs.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;
use peak_alloc::PeakAlloc;
use visage_formats::ReadLimits;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// What the readers may take.
pub const LIMITS: ReadLimits = ReadLimits { max_points: 5_000, max_faces: 10_000, max_bytes: 1 << 20 };

/// Bytes of a point with all attributes as it is read, and of a triangle: what the limits are counted in.
const POINT: usize = 56;
const FACE: usize = 12;
/// What a description may take whatever the limits, and what unpackers have for themselves.
const DESCRIPTION: usize = 2 << 20;
/// CPU of one file after which it hangs.
const HANG: Duration = Duration::from_secs(20);

/// The bytes that are in use.
pub fn used_bytes() -> usize {
    ALLOCATOR.current_usage()
}

/// Counts the peak anew.
pub fn reset_peak() {
    ALLOCATOR.reset_peak_usage();
}

/// The most bytes that were in use at a time.
pub fn peak_bytes() -> usize {
    ALLOCATOR.peak_usage()
}

/// What reading a file of so many bytes may add at its peak: what is kept, twice where it moves while it grows, and the
/// file itself once more, unpacked and apart.
pub fn most_memory(bytes: usize) -> usize {
    let kept = LIMITS.max_points as usize * POINT + LIMITS.max_faces as usize * FACE;
    2 * kept + 2 * LIMITS.max_bytes as usize + 4 * bytes + DESCRIPTION
}

/// The CPU that the process has used.
pub fn cpu_time() -> Duration {
    let usage = getrusage(UsageWho::RUSAGE_SELF).expect("the system counts it");
    let micros = usage.user_time().num_microseconds() + usage.system_time().num_microseconds();
    Duration::from_micros(micros.unsigned_abs())
}

/// A file on its way.
#[derive(Clone)]
pub struct Kept {
    name: String,
    bytes: Vec<u8>,
    begin: Duration,
}

impl Kept {
    /// Writes it where it can be looked at.
    pub fn write(&self) -> PathBuf {
        let path = super::folder().join(&self.name);
        std::fs::create_dir_all(super::folder()).expect("a folder for tests' files");
        std::fs::write(&path, &self.bytes).expect("room for a small file");
        path
    }
}

/// Ends the process when a file hangs.
pub struct Watch {
    current: Arc<Mutex<Option<Kept>>>,
    /// Whether every file is written before it is read.
    is_traced: bool,
}

impl Watch {
    /// Begins to watch.
    pub fn start() -> Self {
        let current: Arc<Mutex<Option<Kept>>> = Arc::default();
        let watched = current.clone();
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(Duration::from_secs(1));
                let kept = watched.lock().expect("nobody panics with it").clone();
                if let Some(kept) = kept.filter(|kept| cpu_time() - kept.begin > HANG) {
                    eprintln!("a file hangs: {}", kept.write().display());
                    std::process::abort();
                }
            }
        });
        Watch { current, is_traced: std::env::var("VISAGE_FUZZ_TRACE").is_ok() }
    }

    /// A file is about to be read.
    pub fn begin(&self, reader: &str, name: &str, bytes: &[u8]) -> Kept {
        let kept = Kept { name: format!("{reader}-{name}"), bytes: bytes.to_vec(), begin: cpu_time() };
        if self.is_traced {
            kept.write();
        }
        *self.current.lock().expect("nobody panics with it") = Some(kept.clone());
        kept
    }

    /// It was read.
    pub fn end(&self) {
        *self.current.lock().expect("nobody panics with it") = None;
    }
}
