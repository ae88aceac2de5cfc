//! Corners that are at one place as one vertex, for formats whose triangles don't share their corners.

use std::hash::{BuildHasher, Hasher};

use foldhash::fast::RandomState;

use super::FormatError;
use super::budget::Budget;
use visage_geometry::Point3;

/// The least slots.
const LEAST: usize = 8;

/// Finds vertices by their coordinates. Only their numbers are kept, each with half of its hash: coordinates are those of
/// the points. The hash has a random seed: files can't be made to collide, and which vertex is found does not depend on it.
pub(super) struct Places {
    /// 0, or half of a hash and behind it the number of a vertex, counted from 1. A power of two, at most two thirds full.
    slots: Vec<u64>,
    state: RandomState,
}

impl Places {
    /// With room for so many vertices.
    pub(super) fn new(vertices: usize, budget: &mut Budget) -> Result<Self, FormatError> {
        let count = (vertices + vertices / 2).next_power_of_two().max(LEAST);
        budget.take(count as u64, size_of::<u64>())?;
        Ok(Places { slots: vec![0; count], state: RandomState::default() })
    }

    /// The vertex at a place of this hash, of those that have these `positions`; `None` for a new one, which is to become
    /// the next of them.
    #[inline]
    pub(super) fn find(
        &mut self,
        hash: u64,
        place: &[f64; 3],
        positions: &[Point3],
        budget: &mut Budget,
    ) -> Result<Option<u32>, FormatError> {
        if 3 * positions.len() >= 2 * self.slots.len() {
            self.grow(positions, budget)?;
        }
        let mask = self.slots.len() - 1;
        let mut at = hash as usize & mask;
        loop {
            let slot = self.slots[at];
            if slot == 0 {
                self.slots[at] = entry(hash, positions.len());
                return Ok(None);
            }
            if (slot ^ hash) >> 32 == 0 {
                let vertex = slot as u32 - 1;
                if positions.get(vertex as usize).is_some_and(|known| known.coords.as_slice() == place) {
                    return Ok(Some(vertex));
                }
            }
            at = (at + 1) & mask;
        }
    }

    /// The hashes of places that are looked for soon. Their slots are fetched side by side: one after the other, most of the
    /// time would be spent waiting for memory.
    #[inline]
    pub(super) fn fetch(&self, places: &[[f64; 3]], hashes: &mut [u64]) {
        let mask = self.slots.len() - 1;
        let mut seen = 0;
        for (hash, place) in hashes.iter_mut().zip(places) {
            *hash = self.hash(place);
            seen ^= self.slots[*hash as usize & mask];
        }
        std::hint::black_box(seen);
    }

    /// The hash of a place; -0 and 0 are one.
    #[inline]
    pub(super) fn hash(&self, place: &[f64; 3]) -> u64 {
        let mut hasher = self.state.build_hasher();
        place.iter().for_each(|x| hasher.write_u64((x + 0.0).to_bits()));
        hasher.finish()
    }

    #[cold]
    fn grow(&mut self, positions: &[Point3], budget: &mut Budget) -> Result<(), FormatError> {
        let count = 2 * self.slots.len();
        budget.take((count / 2) as u64, size_of::<u64>())?;
        self.slots = vec![0; count];
        for (vertex, position) in positions.iter().enumerate() {
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

/// What stands in the slot of a vertex.
#[inline]
fn entry(hash: u64, vertex: usize) -> u64 {
    hash >> 32 << 32 | (vertex as u64 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadLimits;
    use std::collections::HashMap;

    #[test]
    fn vertices_are_those_of_a_map_in_the_order_in_which_they_come() {
        let mut budget = ReadLimits::default().budget();
        let mut places = Places::new(0, &mut budget).expect("room");
        let (mut positions, mut known) = (Vec::new(), HashMap::new());
        let mut state = 1u64;
        for _ in 0..20_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let place = [40, 46, 52].map(|shift| ((state >> shift) % 20) as f64 - 10.0).map(|x| x * 0.1 - 0.0);
            let mut hashes = [0];
            places.fetch(&[place], &mut hashes);
            assert_eq!(hashes[0], places.hash(&place));
            let found = places.find(hashes[0], &place, &positions, &mut budget).expect("room");
            let next = positions.len() as u32;
            let expected = *known.entry(place.map(|x| (x + 0.0).to_bits())).or_insert(next);
            assert_eq!(found, (expected < next).then_some(expected));
            if found.is_none() {
                positions.push(Point3::from(place));
            }
        }
        assert!(positions.len() > LEAST, "it has grown");
        let mut find = |place| places.find(places.hash(&place), &place, &positions, &mut budget).expect("room");
        let zero = find([-0.0, 0.0, 0.0]);
        assert_eq!(zero, find([0.0, -0.0, 0.0]));
        assert!(zero.is_some());
    }

    #[test]
    fn what_it_takes_is_of_the_budget() {
        let mut budget = ReadLimits { max_points: 100, max_faces: 0, max_bytes: 0 }.budget();
        assert!(Places::new(1000, &mut budget).is_err());
    }
}
