//! Corners that are at one place as one vertex, for formats whose triangles don't share their corners.
//!
//! Files name a vertex again soon, or after a while: those that were met last are known at once. The others are told apart
//! in rounds, in the order of the table in which they are looked for: one by one, nearly all time would be spent waiting
//! for memory.

use std::hash::{BuildHasher, Hasher};

use foldhash::fast::RandomState;

use super::FormatError;
use super::budget::Budget;
use visage_geometry::Point3;

/// Hashes of which the two vertices that were met last are kept; a power of two.
const RECENT: usize = 1 << 14;
/// The least slots.
const LEAST: usize = 16;
/// The least vertices of a round, as far as that many are allowed, and that share of the slots.
const LEAST_ROUND: usize = 1 << 12;
const SHARE: usize = 4;
/// Pieces of the table that are gone through one after the other.
const PIECES: usize = 1 << 10;
/// Fewer vertices are not worth sorting.
const FEW: usize = 64;

/// Triangles over the vertices at their corners. The vertices are in the order in which they first come; the hash has a
/// random seed, so that files can't be made to collide, and which vertices there are does not depend on it.
pub(super) struct Weld {
    pub(super) positions: Vec<Point3>,
    pub(super) faces: Vec<[u32; 3]>,
    /// The most vertices.
    limit: usize,
    state: RandomState,
    /// For some hashes the vertices that had them last, the last first.
    recent: Vec<[u64; 2]>,
    /// All vertices before those of this round, by their hashes. A power of two, at most two thirds full.
    slots: Vec<u64>,
    /// How many vertices and triangles there were before this round, and the hashes of its vertices, of which some may be
    /// vertices from before.
    settled: (usize, usize),
    hashes: Vec<u64>,
}

impl Weld {
    /// With room for so many vertices and triangles, for which there must be bytes.
    pub(super) fn new(vertices: usize, faces: usize, limit: u64, budget: &mut Budget) -> Result<Self, FormatError> {
        let count = (vertices + vertices / 2).next_power_of_two().max(LEAST);
        budget.take_description((count + 2 * RECENT) as u64, size_of::<u64>())?;
        Ok(Weld {
            positions: Vec::with_capacity(vertices),
            faces: Vec::with_capacity(faces),
            limit: usize::try_from(limit).unwrap_or(usize::MAX),
            state: RandomState::default(),
            recent: vec![[0; 2]; RECENT],
            slots: vec![0; count],
            settled: (0, 0),
            hashes: Vec::new(),
        })
    }

    /// Adds a triangle, whose coordinates are finite.
    ///
    /// # Errors
    /// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits.
    #[inline]
    pub(super) fn push(&mut self, corners: &[[f64; 3]; 3], budget: &mut Budget) -> Result<(), FormatError> {
        let [a, b, c] = corners;
        let face = [self.vertex(a), self.vertex(b), self.vertex(c)];
        self.faces.push(face);
        if self.hashes.len() >= (self.slots.len() / SHARE).max(LEAST_ROUND) || self.positions.len() > self.limit {
            self.settle(budget)?;
        }
        Ok(())
    }

    #[inline]
    fn vertex(&mut self, place: &[f64; 3]) -> u32 {
        let hash = self.hash(place);
        let recent = &mut self.recent[hash as usize % RECENT];
        let next = self.positions.len();
        for known in *recent {
            if let Some(vertex) = vertex_of(known, hash)
                && self.positions[vertex as usize].coords.as_slice() == place
            {
                return vertex;
            }
        }
        *recent = [entry(hash, next), recent[0]];
        self.positions.push(Point3::from(*place));
        self.hashes.push(hash);
        next as u32
    }

    /// The hash of a place; -0 and 0 are one.
    #[inline]
    fn hash(&self, place: &[f64; 3]) -> u64 {
        let mut hasher = self.state.build_hasher();
        place.iter().for_each(|x| hasher.write_u64((x + 0.0).to_bits()));
        hasher.finish()
    }

    /// Ends a round: its vertices that were there before go.
    pub(super) fn settle(&mut self, budget: &mut Budget) -> Result<(), FormatError> {
        let first = self.settled.0;
        if 3 * self.positions.len() >= 2 * self.slots.len() {
            self.grow(budget)?;
        }
        let order = self.order();
        // the vertex that each one is: itself, or one before it
        let mut numbers: Vec<u32> = (first as u32..).take(self.hashes.len()).collect();
        let mut are_doubled = false;
        for (hash, k) in &order {
            let vertex = first + *k as usize;
            match self.search(*hash, vertex) {
                (at, None) => self.slots[at] = entry(*hash, vertex),
                (_, Some(known)) => {
                    numbers[*k as usize] = known;
                    are_doubled = true;
                }
            }
        }
        if are_doubled {
            self.close_ranks(&order, &mut numbers);
        }
        budget.take((self.positions.len() - first) as u64, size_of::<Point3>())?;
        if self.positions.len() > self.limit {
            let limit = self.limit as u64;
            return Err(FormatError::TooLarge { what: "points", found: limit + 1, limit });
        }
        self.settled = (self.positions.len(), self.faces.len());
        self.hashes.clear();
        Ok(())
    }

    /// The hashes and vertices of a round in the order of their slots, by and large; of two in one piece the earlier comes
    /// first.
    fn order(&self) -> Vec<(u64, u32)> {
        let hashes = || self.hashes.iter().copied().zip(0..);
        if self.hashes.len() < FEW {
            return hashes().collect();
        }
        // a shift, since the width is a power of two
        let shift = self.slots.len().div_ceil(PIECES).trailing_zeros();
        let piece = |hash: u64| (hash as usize & (self.slots.len() - 1)) >> shift;
        let mut starts = vec![0u32; PIECES + 1];
        self.hashes.iter().for_each(|hash| starts[piece(*hash) + 1] += 1);
        for k in 1..=PIECES {
            starts[k] += starts[k - 1];
        }
        let mut order = vec![(0, 0); self.hashes.len()];
        for (hash, k) in hashes() {
            let start = &mut starts[piece(hash)];
            order[*start as usize] = (hash, k);
            *start += 1;
        }
        order
    }

    /// The slot of a vertex that is not in the table yet, or of one at its place and that one.
    #[inline]
    fn search(&self, hash: u64, vertex: usize) -> (usize, Option<u32>) {
        let mask = self.slots.len() - 1;
        let mut at = hash as usize & mask;
        while self.slots[at] != 0 {
            if let Some(known) = vertex_of(self.slots[at], hash)
                && self.positions[known as usize] == self.positions[vertex]
            {
                return (at, Some(known));
            }
            at = (at + 1) & mask;
        }
        (at, None)
    }

    /// Takes out the vertices of a round that are another one; `numbers` says which, and then what each one is called.
    fn close_ranks(&mut self, order: &[(u64, u32)], numbers: &mut [u32]) {
        let (first, first_face) = self.settled;
        let mut next = first;
        for k in 0..numbers.len() {
            let vertex = numbers[k] as usize;
            if vertex == first + k {
                self.positions[next] = self.positions[first + k];
                numbers[k] = next as u32;
                next += 1;
            } else if vertex >= first {
                // it comes before this one, so it has its number
                numbers[k] = numbers[vertex - first];
            }
        }
        let mask = self.slots.len() - 1;
        for (hash, k) in order.iter().map(|(hash, k)| (*hash, *k as usize)) {
            let now = numbers[k] as usize;
            let (old, new) = (entry(hash, first + k), entry(hash, now));
            let mut at = hash as usize & mask;
            while self.slots[at] != 0 && self.slots[at] != old {
                at = (at + 1) & mask;
            }
            if self.slots[at] == old {
                self.slots[at] = new;
            }
            for recent in &mut self.recent[hash as usize % RECENT] {
                if *recent == old {
                    *recent = new;
                }
            }
        }
        for vertex in self.faces[first_face..].iter_mut().flatten().filter(|vertex| **vertex as usize >= first) {
            *vertex = numbers[*vertex as usize - first];
        }
        self.positions.truncate(next);
    }

    #[cold]
    fn grow(&mut self, budget: &mut Budget) -> Result<(), FormatError> {
        let count = (self.positions.len() * 3 / 2 + 1).next_power_of_two().max(2 * self.slots.len());
        budget.take((count - self.slots.len()) as u64, size_of::<u64>())?;
        self.slots = vec![0; count];
        for vertex in 0..self.settled.0 {
            let position = &self.positions[vertex];
            let hash = self.hash(&[position.x, position.y, position.z]);
            let mut at = hash as usize & (count - 1);
            while self.slots[at] != 0 {
                at = (at + 1) & (count - 1);
            }
            self.slots[at] = entry(hash, vertex);
        }
        Ok(())
    }
}

/// Half of a hash, and behind it the number of a vertex, counted from 1; 0 is none.
#[inline]
fn entry(hash: u64, vertex: usize) -> u64 {
    hash >> 32 << 32 | (vertex as u64 + 1)
}

/// The vertex of an entry, if it may have this hash.
#[inline]
fn vertex_of(entry: u64, hash: u64) -> Option<u32> {
    let is_alike = (entry ^ hash) >> 32 == 0;
    if is_alike { (entry as u32).checked_sub(1) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadLimits;
    use std::collections::HashMap;

    /// Corners, and the vertices and triangles that they are.
    type Soup = (Vec<[[f64; 3]; 3]>, Vec<Point3>, Vec<[u32; 3]>);

    /// Corners on a grid of so many places a side, and what a map makes of them.
    fn soup(faces: usize, side: u64) -> Soup {
        let mut state = 1u64;
        let mut corner = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            [40, 46, 52]
                .map(|shift| 0.1 * ((state >> shift) % side) as f64 - 1.0)
                .map(|x| if x == 0.0 { -x } else { x })
        };
        let corners: Vec<[[f64; 3]; 3]> = (0..faces).map(|_| [corner(), corner(), corner()]).collect();
        let (mut known, mut positions) = (HashMap::new(), Vec::new());
        let mut number = |place: [f64; 3]| {
            *known.entry(place.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                positions.push(Point3::from(place));
                positions.len() as u32 - 1
            })
        };
        let numbered = corners.iter().map(|corners| corners.map(&mut number)).collect();
        (corners, positions, numbered)
    }

    fn weld(corners: &[[[f64; 3]; 3]], limit: u64) -> Result<Weld, FormatError> {
        let mut budget = ReadLimits::default().budget();
        let mut weld = Weld::new(0, 0, limit, &mut budget)?;
        corners.iter().try_for_each(|corners| weld.push(corners, &mut budget))?;
        weld.settle(&mut budget)?;
        Ok(weld)
    }

    #[test]
    fn vertices_are_those_of_a_map_in_the_order_in_which_they_come() {
        for (faces, side) in [(1, 2), (200, 3), (5_000, 20), (60_000, 33), (60_000, 64)] {
            let (corners, positions, numbered) = soup(faces, side);
            for limit in [u64::from(u32::MAX), positions.len() as u64] {
                let weld = weld(&corners, limit).expect("room");
                assert!(weld.positions == positions && weld.faces == numbered, "{faces} {side} {limit}");
            }
            let less = weld(&corners, positions.len() as u64 - 1);
            assert!(matches!(less, Err(FormatError::TooLarge { what: "points", .. })), "{faces} {side}");
        }
    }

    #[test]
    fn zero_has_no_sign() {
        let corners = [[[0.0, 0.0, -0.0], [-0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]];
        let weld = weld(&corners, 9).expect("room");
        assert_eq!((weld.positions.len(), weld.faces), (2, vec![[0, 0, 1]]));
    }

    #[test]
    fn what_it_takes_is_of_the_budget() {
        let limits = ReadLimits { max_points: 100, max_faces: 0, max_bytes: 0 };
        assert!(Weld::new(1 << 17, 0, 100, &mut limits.budget()).is_err());
        let mut budget = limits.budget();
        let mut weld = Weld::new(0, 0, u64::MAX, &mut budget).expect("room");
        let (corners, ..) = soup(60_000, 64);
        assert!(corners.iter().try_for_each(|corners| weld.push(corners, &mut budget)).is_err());
    }
}
