//! Triangles of a primitive, from its indices and its mode.

/// How the vertices of a primitive belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    Points,
    Triangles,
    Strip,
    Fan,
}

impl Mode {
    /// By its number; `None` for lines and for what there is not.
    pub(super) fn of(number: Option<u32>) -> Option<Mode> {
        match number {
            Some(0) => Some(Mode::Points),
            None | Some(4) => Some(Mode::Triangles),
            Some(5) => Some(Mode::Strip),
            Some(6) => Some(Mode::Fan),
            _ => None,
        }
    }

    /// How many triangles so many corners make.
    pub(super) fn triangles(self, corners: u64) -> u64 {
        match self {
            Mode::Points => 0,
            Mode::Triangles => corners / 3,
            Mode::Strip | Mode::Fan => corners.saturating_sub(2),
        }
    }

    /// The corners of a triangle, as places in the list of indices.
    pub(super) fn corners(self, triangle: usize) -> [usize; 3] {
        let t = triangle;
        match self {
            Mode::Points | Mode::Triangles => [3 * t, 3 * t + 1, 3 * t + 2],
            // every other one turns the other way round
            Mode::Strip if t % 2 == 1 => [t + 1, t, t + 2],
            Mode::Strip => [t, t + 1, t + 2],
            Mode::Fan => [0, t + 1, t + 2],
        }
    }
}
