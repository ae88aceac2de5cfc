//! Who holds leases, and files in the making.

use super::{ProcessId, SeatId};

/// A process that works on a database, among others maybe.
///
/// A process that starts has to know which of the leases it finds belonged to a process that is gone. Its own seat tells:
/// a seat is taken by one process at a time (the lock of a data folder sees to it), so whoever had it before is gone.
/// Of the processes on other seats it knows nothing but when their leases end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Owner {
    /// What only one process has at a time.
    pub seat: SeatId,
    /// The process.
    pub process: ProcessId,
}

impl Owner {
    /// This process, on a seat.
    pub fn on(seat: SeatId) -> Self {
        Owner { seat, process: ProcessId::new() }
    }

    /// A worker of this process.
    pub fn worker(self, number: usize) -> WorkerId {
        WorkerId { process: self.process, number }
    }
}

/// A worker: holds the lease of the job that it works on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkerId {
    /// The process that it runs in.
    pub process: ProcessId,
    /// Which one of that process.
    pub number: usize,
}

impl std::fmt::Display for WorkerId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}-{}", self.process, self.number)
    }
}
