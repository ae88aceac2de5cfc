//! Sets of nodes of a block, a bit each.

use super::grid::EDGE;

/// Slices of a block along z.
const SLICES: usize = EDGE as usize;
/// The nodes of a slice at the low end of x.
const LOW: u64 = 0x0101_0101_0101_0101;
/// The nodes of a slice at the high end of x.
const HIGH: u64 = LOW << 7;

/// Nodes of a block: a slice for each z, in it the bit `y * 8 + x`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Mask(pub [u64; SLICES]);

impl Mask {
    /// The nodes for which `holds` does, by their places.
    #[inline]
    pub fn of(mut holds: impl FnMut(usize) -> bool) -> Mask {
        Mask(std::array::from_fn(|z| (0..64).fold(0, |slice, at| slice | u64::from(holds(z << 6 | at)) << at)))
    }

    /// Whether a node is in it.
    #[inline]
    pub fn has(&self, place: usize) -> bool {
        self.0[place >> 6] >> (place & 63) & 1 == 1
    }

    /// Adds or removes a node.
    #[inline]
    pub fn set(&mut self, place: usize, is_in: bool) {
        let bit = 1 << (place & 63);
        self.0[place >> 6] = if is_in { self.0[place >> 6] | bit } else { self.0[place >> 6] & !bit };
    }

    /// Whether nothing is in it.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|slice| *slice == 0)
    }

    /// What is in both.
    #[inline]
    pub fn and(&self, other: &Mask) -> Mask {
        Mask(std::array::from_fn(|z| self.0[z] & other.0[z]))
    }

    /// What is in either.
    #[inline]
    pub fn or(&self, other: &Mask) -> Mask {
        Mask(std::array::from_fn(|z| self.0[z] | other.0[z]))
    }

    /// What is in this one alone.
    #[inline]
    pub fn without(&self, other: &Mask) -> Mask {
        Mask(std::array::from_fn(|z| self.0[z] & !other.0[z]))
    }

    /// The places of all that is in it, in order.
    pub fn places(self) -> impl Iterator<Item = usize> {
        (0..SLICES).flat_map(move |z| {
            let mut rest = self.0[z];
            std::iter::from_fn(move || {
                let at = rest.trailing_zeros() as usize;
                rest &= rest.wrapping_sub(1);
                (at < 64).then_some(z << 6 | at)
            })
        })
    }

    /// What hangs together with the node at `place` along edges of cells.
    pub fn piece(&self, place: usize) -> Mask {
        let mut piece = Mask::default();
        piece.set(place, true);
        loop {
            let grown = Mask(std::array::from_fn(|z| {
                let own = piece.0[z];
                let below = if z > 0 { piece.0[z - 1] } else { 0 };
                let above = piece.0.get(z + 1).copied().unwrap_or(0);
                let beside = (own << 1 & !LOW) | (own >> 1 & !HIGH) | own << 8 | own >> 8;
                (own | beside | below | above) & self.0[z]
            }));
            if grown == piece {
                return piece;
            }
            piece = grown;
        }
    }

    /// Each node whose next one along an axis is in it; `behind` is the block behind.
    #[inline]
    pub fn before(&self, axis: usize, behind: Option<&Mask>) -> Mask {
        let slice = |z: usize| behind.map_or(0, |mask| mask.0[z]);
        Mask(std::array::from_fn(|z| match axis {
            0 => (self.0[z] >> 1 & !HIGH) | (slice(z) << 7 & HIGH),
            1 => self.0[z] >> 8 | slice(z) << 56,
            _ => self.0.get(z + 1).copied().unwrap_or_else(|| slice(0)),
        }))
    }

    /// All that an edge of a cell joins to what is in it, and itself; `near` are the blocks before and behind along x, y, z.
    #[inline]
    pub fn spread(&self, near: [Option<&Mask>; 6]) -> Mask {
        let slice = |of: Option<&Mask>, z: usize| of.map_or(0, |mask| mask.0[z]);
        Mask(std::array::from_fn(|z| {
            let own = self.0[z];
            let below = if z > 0 { self.0[z - 1] } else { slice(near[4], SLICES - 1) };
            let above = if z + 1 < SLICES { self.0[z + 1] } else { slice(near[5], 0) };
            let along_x = (own << 1 & !LOW) | (own >> 1 & !HIGH);
            let into_x = (slice(near[0], z) >> 7 & LOW) | (slice(near[1], z) << 7 & HIGH);
            let along_y = own << 8 | own >> 8 | slice(near[2], z) >> 56 | slice(near[3], z) << 56;
            own | below | above | along_x | into_x | along_y
        }))
    }

    /// The nodes on the face at the low or the high end of an axis, moved to the low end.
    #[inline]
    pub fn face(&self, axis: usize, is_high: bool) -> Mask {
        let along = |slice: &u64| match (axis, is_high) {
            (0, false) => slice & LOW,
            (0, true) => slice >> 7 & LOW,
            (_, false) => slice & 0xff,
            (_, true) => slice >> 56,
        };
        match axis {
            2 => {
                let mut found = Mask::default();
                found.0[0] = self.0[if is_high { SLICES - 1 } else { 0 }];
                found
            }
            _ => Mask(std::array::from_fn(|z| along(&self.0[z]))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_hang_together_along_edges_alone_and_faces_meet() {
        // a bar along x at y = 1, z = 2; a node on a diagonal from it
        let bar = Mask::of(|place| place >> 3 == (2 << 3 | 1));
        let mut all = bar;
        all.set(2 << 6 | 2 << 3, true);
        all.set(1 << 6, true);
        assert_eq!(all.piece(2 << 6 | 1 << 3).places().count(), 9);
        assert_eq!(all.without(&all.piece(1 << 6)).places().count(), 9);
        assert_eq!(bar.face(0, false), bar.face(0, true));
        assert_eq!(bar.face(0, true).places().collect::<Vec<_>>(), [2 << 6 | 1 << 3]);
        assert!(bar.face(1, false).is_empty() && bar.face(2, true).is_empty());
        assert_eq!(Mask::of(|place| place >> 6 == 7).face(2, true), Mask::of(|place| place < 64));
        assert_eq!(Mask::of(|place| place >> 3 & 7 == 7).face(1, true), Mask::of(|place| place >> 3 & 7 == 0));
    }

    #[test]
    fn the_node_before_is_found_also_across_the_border() {
        let mut nodes = Mask::default();
        [(3, 3, 3), (0, 0, 0), (7, 7, 7)].into_iter().for_each(|(x, y, z)| nodes.set(z << 6 | y << 3 | x, true));
        for axis in 0..3 {
            let step = [1, 8, 64][axis];
            let inner: Vec<usize> = nodes.before(axis, None).places().collect();
            assert_eq!(inner, [(3 << 6 | 3 << 3 | 3) - step, 511 - step], "{axis}");
            let across: Vec<usize> = Mask::default().before(axis, Some(&nodes)).places().collect();
            assert_eq!(across, [7 * step], "{axis}");
        }
    }

    #[test]
    fn what_is_spread_reaches_one_edge_farther_also_from_the_blocks_around() {
        let middle = Mask::of(|place| place == (3 << 6 | 3 << 3 | 3));
        let spread = middle.spread([None; 6]);
        assert_eq!(spread.places().count(), 7);
        assert_eq!(spread.spread([None; 6]).places().count(), 25);
        // at the border nothing comes in from the row beside
        let corner = Mask::of(|place| place == 0 || place == 511);
        assert_eq!(corner.spread([None; 6]).places().count(), 8);
        let nothing = Mask::default();
        for (side, (axis, is_high)) in
            [(0, true), (0, false), (1, true), (1, false), (2, true), (2, false)].iter().enumerate()
        {
            let mut near = [None; 6];
            let all = Mask([u64::MAX; SLICES]);
            near[side] = Some(&all);
            // from the block before into the low end, from that behind into the high end
            let found = nothing.spread(near);
            assert_eq!(found.places().count(), 64);
            assert_eq!(found.face(*axis, !is_high).places().count(), 64, "{axis} {is_high}");
        }
    }
}
