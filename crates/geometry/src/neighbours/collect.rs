//! What a search keeps of the points it comes across.

/// A point of the tree and its squared distance from the query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Index into the points the tree was built from.
    pub index: u32,
    /// Squared distance, in the square of the points' unit.
    pub distance2: f32,
}

/// Receives candidates; the search leaves out cells that lie beyond `bound`.
pub(super) trait Collect {
    /// Squared distance at or beyond which points are of no interest.
    fn bound(&self) -> f32;
    /// A point whose squared distance is below `bound()`.
    fn offer(&mut self, candidate: Neighbour);
}

/// Keeps the one nearest.
pub(super) struct Nearest {
    pub best: Neighbour,
}

impl Collect for Nearest {
    #[inline]
    fn bound(&self) -> f32 {
        self.best.distance2
    }

    #[inline]
    fn offer(&mut self, candidate: Neighbour) {
        self.best = candidate;
    }
}

/// Keeps the nearest and the distance of the second nearest.
pub(super) struct NearestTwo {
    pub best: Neighbour,
    pub rival_distance2: f32,
}

impl Collect for NearestTwo {
    #[inline]
    fn bound(&self) -> f32 {
        self.rival_distance2
    }

    #[inline]
    fn offer(&mut self, candidate: Neighbour) {
        if candidate.index == self.best.index {
            return;
        }
        if candidate.distance2 < self.best.distance2 {
            self.rival_distance2 = self.best.distance2;
            self.best = candidate;
        } else {
            self.rival_distance2 = candidate.distance2;
        }
    }
}

/// Keeps the `k` nearest, sorted by distance.
pub(super) struct KNearest<'a> {
    pub k: usize,
    pub max_distance2: f32,
    pub found: &'a mut Vec<Neighbour>,
}

impl Collect for KNearest<'_> {
    #[inline]
    fn bound(&self) -> f32 {
        if self.found.len() < self.k { self.max_distance2 } else { self.found[self.k - 1].distance2 }
    }

    #[inline]
    fn offer(&mut self, candidate: Neighbour) {
        if self.found.len() == self.k {
            self.found.pop();
        }
        let position = self.found.partition_point(|n| n.distance2 <= candidate.distance2);
        self.found.insert(position, candidate);
    }
}

/// Hands every point within a radius to a closure.
pub(super) struct Within<F> {
    pub radius2: f32,
    pub visit: F,
}

impl<F: FnMut(Neighbour)> Collect for Within<F> {
    #[inline]
    fn bound(&self) -> f32 {
        self.radius2
    }

    #[inline]
    fn offer(&mut self, candidate: Neighbour) {
        (self.visit)(candidate);
    }
}

/// Notes whether there is any point within a radius, and ends the search with the first.
pub(super) struct Any {
    pub radius2: f32,
    pub found: bool,
}

impl Collect for Any {
    #[inline]
    fn bound(&self) -> f32 {
        if self.found { f32::NEG_INFINITY } else { self.radius2 }
    }

    #[inline]
    fn offer(&mut self, _candidate: Neighbour) {
        self.found = true;
    }
}
