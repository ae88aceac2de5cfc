//! Whether a registration fits into memory, estimated from the points of its scans before it begins. A job that does not fit
//! would take the whole server down with it, again at each attempt.

use visage_domain::Room;

/// The most bytes that a registration takes at its peak for each point of its scans. Measured: 120 to 140 with plain
/// points, 200 with normals and colours, 225 to 271 with a mesh (`docs/PERFORMANCE.md`). The grid of a surface keeps itself to
/// 240 of them, but for 128 MiB that it may take however few points there are.
pub const BYTES_PER_POINT: u64 = 320;

/// The memory that all running jobs together may take; `None` if it is not limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget(pub Option<u64>);

/// A registration that needs more than there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("registering {points} points takes up to {needed_mb} MB of memory, and jobs may take {allowed_mb} MB here")]
pub struct TooLarge {
    /// Points of all scans.
    pub points: u64,
    /// What they take, megabytes (10^6).
    pub needed_mb: u64,
    /// What there is for jobs.
    pub allowed_mb: u64,
}

impl TooLarge {
    /// What to do about it.
    pub const HINT: &str = "use fewer or thinner scans, or ask the operator for more memory (--job-memory-mb)";
}

impl Budget {
    /// Whether so many points fit when nothing else runs.
    pub fn admit(self, points: u64) -> Result<(), TooLarge> {
        let needed = points.saturating_mul(BYTES_PER_POINT);
        match self.0 {
            Some(allowed) if needed > allowed => {
                Err(TooLarge { points, needed_mb: needed.div_ceil(1_000_000), allowed_mb: allowed / 1_000_000 })
            }
            _ => Ok(()),
        }
    }

    /// What is left beside jobs of so many points.
    pub fn room(self, running_points: u64) -> Option<Room> {
        let all_points = self.0? / BYTES_PER_POINT;
        Some(Room { free_points: all_points.saturating_sub(running_points), all_points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_large_is_said_in_figures() {
        let budget = Budget(Some(1_000_000_000));
        assert_eq!(budget.admit(3_125_000), Ok(()));
        let refused = budget.admit(20_000_000).expect_err("too large");
        assert_eq!(
            refused.to_string(),
            "registering 20000000 points takes up to 6400 MB of memory, and jobs may take 1000 MB here"
        );
        assert_eq!(budget.room(3_000_000), Some(Room { free_points: 125_000, all_points: 3_125_000 }));
        assert_eq!((Budget(None).admit(u64::MAX), Budget(None).room(5)), (Ok(()), None));
    }
}
