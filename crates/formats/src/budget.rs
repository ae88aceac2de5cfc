//! Bounds on what a reader accepts and keeps.

use super::FormatError;
use visage_geometry::Point3;

/// What is kept of one point with every attribute (bytes): position, normal, colour as it is read, intensity, pixel.
const POINT_BYTES: u64 = (size_of::<Point3>() + size_of::<[f32; 3]>() * 2 + size_of::<f32>() + size_of::<u32>()) as u64;
/// What is kept of one triangle (bytes).
const FACE_BYTES: u64 = size_of::<[u32; 3]>() as u64;

/// What the description of a file may take whatever the limits (bytes).
const DESCRIPTION: u64 = 1 << 20;

/// Bounds on what a reader accepts.
#[derive(Debug, Clone, Copy)]
pub struct ReadLimits {
    /// Points in one file.
    pub max_points: u64,
    /// Faces in one file.
    pub max_faces: u64,
    /// Bytes of one file; a compressed one counts as what it unpacks to.
    pub max_bytes: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        ReadLimits { max_points: 20_000_000, max_faces: 40_000_000, max_bytes: 512 << 20 }
    }
}

impl ReadLimits {
    /// The most points: u32 indexes them, and its largest value stands for none.
    pub(super) fn most_points(&self) -> u64 {
        self.max_points.min(u64::from(u32::MAX) - 1)
    }

    /// What may be kept of one file in all: as much as the most points and faces take.
    pub(super) fn budget(&self) -> Budget {
        let points = self.max_points.saturating_mul(POINT_BYTES);
        let limit = points.saturating_add(self.max_faces.saturating_mul(FACE_BYTES));
        Budget { limit, left: limit }
    }
}

/// The memory that a file may still take while it is read. Whatever grows with the file is taken from it first.
#[derive(Debug, Clone)]
pub(super) struct Budget {
    limit: u64,
    left: u64,
}

impl Budget {
    /// Takes `bytes` for `count` things.
    #[inline]
    pub(super) fn take(&mut self, count: u64, bytes: usize) -> Result<(), FormatError> {
        match self.left.checked_sub(count.saturating_mul(bytes as u64)) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(self.exceeded(count, bytes)),
        }
    }

    /// Takes `bytes` for all `count` things that describe the file and are no points, at once: the first
    /// [`DESCRIPTION`] are free, so that small limits on points don't refuse the description of a few.
    pub(super) fn take_description(&mut self, count: u64, bytes: usize) -> Result<(), FormatError> {
        self.take(count.saturating_mul(bytes as u64).saturating_sub(DESCRIPTION), 1)
    }

    #[cold]
    fn exceeded(&self, count: u64, bytes: usize) -> FormatError {
        let found = (self.limit - self.left).saturating_add(count.saturating_mul(bytes as u64));
        FormatError::TooManyBytes { what: "what it holds takes", found, limit: self.limit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_what_the_limits_add_up_to() {
        let mut budget = ReadLimits { max_points: 10, max_faces: 5, max_bytes: 0 }.budget();
        assert_eq!(budget.limit, 10 * 56 + 5 * 12);
        assert!(budget.take(10, 56).is_ok());
        assert!(budget.take(5, 12).is_ok());
        assert!(budget.take(0, 12).is_ok());
        let error = budget.take(1, 4).expect_err("used up").to_string();
        assert!(error.starts_with("what it holds takes 624 bytes, more than the 620 that are allowed"), "{error}");
        assert!(budget.take(u64::MAX, usize::MAX).is_err());
        assert!(budget.take_description(1 << 20, 1).is_ok() && budget.take_description(1 << 20, 2).is_err());
    }
}
