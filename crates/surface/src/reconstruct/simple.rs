//! Whether a node of the grid can change its side without changing the topology of the surface.
//!
//! Simple points (Bertrand and Malandain, Pattern Recognition Letters 1994) for the surface that [`cubes`](super::cubes) makes:
//! nodes inside hang together along edges of cells, nodes outside across faces, too.

/// The place of the node itself among the 27 around it.
const OWN: usize = 13;
/// All 26 around a node.
const ALL: u32 = ((1 << 27) - 1) & !(1 << OWN);

/// How the nodes around a node hang together, as sets of bits: bit `k` is the node at offset `k % 3 - 1`, `k / 3 % 3 - 1`,
/// `k / 9 - 1`.
#[derive(Debug, Clone)]
pub struct Neighbourhood {
    /// For each node those that an edge joins to it.
    by_edge: [u32; 27],
    /// For each node those that an edge or the diagonal of a face joins to it.
    by_face: [u32; 27],
    /// Nodes that an edge joins to the middle one.
    faces: u32,
    /// Nodes on a diagonal of a face with the middle one.
    edges: u32,
}

/// Pieces of one side around a node; each holds a node that is next to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pieces {
    /// How many.
    pub count: usize,
    /// One node of each, next to the middle one, by its bit.
    pub first: [u8; 8],
}

fn apart(a: usize, b: usize) -> usize {
    let along = |k: usize| [k % 3, k / 3 % 3, k / 9];
    (0..3).map(|axis| along(a)[axis].abs_diff(along(b)[axis])).fold(0, |sum, d| if d > 1 { 9 } else { sum + d })
}

impl Default for Neighbourhood {
    fn default() -> Self {
        let joined = |a: usize, most: usize| {
            (0..27).filter(|b| (1..=most).contains(&apart(a, *b)) && *b != OWN).fold(0, |set, b| set | 1 << b)
        };
        let at = |distance: usize| (0..27).filter(|b| apart(OWN, *b) == distance).fold(0, |set, b| set | 1 << b);
        Neighbourhood {
            by_edge: std::array::from_fn(|a| joined(a, 1)),
            by_face: std::array::from_fn(|a| joined(a, 2)),
            faces: at(1),
            edges: at(2),
        }
    }
}

impl Neighbourhood {
    /// The pieces of what is inside (`inside`: bits of the nodes around that are).
    pub fn inside(&self, inside: u32) -> Pieces {
        let inside = inside & ALL;
        let beside = inside & self.faces;
        let edges = self.joined(beside, &self.by_edge) & inside & self.edges;
        let corners = self.joined(edges, &self.by_edge) & inside & !self.faces & !self.edges;
        self.pieces(beside | edges | corners, self.faces, &self.by_edge)
    }

    /// The pieces of what is outside.
    pub fn outside(&self, inside: u32) -> Pieces {
        let outside = !inside & ALL;
        let beside = outside & (self.faces | self.edges);
        let corners = self.joined(beside, &self.by_face) & outside;
        self.pieces(beside | corners, self.faces | self.edges, &self.by_face)
    }

    fn joined(&self, set: u32, by: &[u32; 27]) -> u32 {
        let (mut found, mut rest) = (0, set);
        while rest != 0 {
            found |= by[rest.trailing_zeros() as usize];
            rest &= rest - 1;
        }
        found
    }

    fn pieces(&self, set: u32, beside: u32, by: &[u32; 27]) -> Pieces {
        let mut found = Pieces { count: 0, first: [0; 8] };
        let mut starts = set & beside;
        while starts != 0 {
            let mut piece = 1u32 << starts.trailing_zeros();
            let mut fresh = piece;
            while fresh != 0 {
                fresh = self.joined(fresh, by) & set & !piece;
                piece |= fresh;
            }
            if let Some(first) = found.first.get_mut(found.count) {
                *first = starts.trailing_zeros() as u8;
            }
            found.count += 1;
            starts &= !piece;
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(offsets: &[[i32; 3]]) -> u32 {
        offsets.iter().fold(0, |set, [x, y, z]| set | 1 << ((z + 1) * 9 + (y + 1) * 3 + x + 1))
    }

    #[test]
    fn the_end_of_a_rod_is_simple_and_its_middle_is_not() {
        let around = Neighbourhood::default();
        let end = bits(&[[1, 0, 0]]);
        assert_eq!((around.inside(end).count, around.outside(end).count), (1, 1));
        let middle = bits(&[[1, 0, 0], [-1, 0, 0]]);
        assert_eq!((around.inside(middle).count, around.outside(middle).count), (2, 1));
        // the last node that is missing in a plate
        let plate: Vec<[i32; 3]> = (0..9).filter(|k| *k != 4).map(|k| [k % 3 - 1, k / 3 - 1, 0]).collect();
        assert_eq!((around.inside(bits(&plate)).count, around.outside(bits(&plate)).count), (1, 2));
        // inside does not hang together across a diagonal, outside does
        let diagonal = bits(&[[1, 1, 0]]);
        assert_eq!(around.inside(diagonal).count, 0);
        assert_eq!(around.outside(ALL & !diagonal).count, 1);
        assert_eq!(around.inside(ALL).count, 1);
        assert_eq!(around.outside(ALL).count, 0);
    }
}
