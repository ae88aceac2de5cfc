//! Space on the disk that is kept so that a full one can be emptied again.

/// Space on the disk that is kept so that a full one can be emptied again.
pub trait Reserve: Send + Sync + std::fmt::Debug {
    /// Whether the space is there; where it was given away, an attempt is made to take it back. Blocks for a moment.
    fn is_whole(&self) -> bool;
    /// Gives the space away; false if that was done before.
    fn give(&self) -> bool;
    /// Whether the disk has space beside it for a small write.
    fn has_space(&self) -> bool;
}

/// Nothing is kept: for databases that stand alone, as in tests and benches.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoReserve;

impl Reserve for NoReserve {
    fn is_whole(&self) -> bool {
        true
    }

    fn give(&self) -> bool {
        false
    }

    fn has_space(&self) -> bool {
        true
    }
}
