//! Which nodes of one side hang together over all of space, in the blocks of a volume and where none is: along edges of cells, and
//! outside across the faces whose signs alternate, too.

use rayon::prelude::*;

use super::grid::{BlockKey, NODES, block_at, key};
use super::mask::Mask;
use visage_geometry::UnionFind;

/// Nodes of one block that hang together, with their label.
type Piece = (Mask, u32);

/// Of a node that is no member.
const NOBODY: u32 = u32::MAX;

/// The members of one side.
#[derive(Debug)]
pub struct Components {
    /// The pieces of each block.
    pieces: Vec<Vec<Piece>>,
    /// Of the blocks that nodes are added to, the label of each node.
    labels: Vec<Option<Box<[u32; NODES]>>>,
    joined: UnionFind,
    runs: Vec<Run>,
    outer: u32,
}

/// Blocks side by side along x that aren't there: no surface passes through them.
#[derive(Debug, Clone, Copy)]
struct Run {
    first: BlockKey,
    last: BlockKey,
    label: u32,
}

fn pieces_of(members: &Mask) -> Vec<Piece> {
    let mut rest = *members;
    let mut found = Vec::new();
    while let Some(place) = rest.places().next() {
        let piece = rest.piece(place);
        rest = rest.without(&piece);
        found.push((piece, 0));
    }
    found
}

/// The index of the block behind another one along an axis, if it is there.
fn behind(keys: &[BlockKey], of: BlockKey, axis: usize) -> Option<usize> {
    let mut at = block_at(of);
    at[axis] += 1;
    keys.binary_search(&key(at)).ok()
}

fn labels_of(pieces: &[Piece]) -> Box<[u32; NODES]> {
    let mut labels = Box::new([NOBODY; NODES]);
    for (piece, label) in pieces {
        piece.places().for_each(|place| labels[place] = *label);
    }
    labels
}

impl Components {
    /// Of the members of each block. `outside` are the nodes outside, of which those of the outer side are the members or
    /// not (`is_outer`): space beyond all blocks is outside, between two blocks of a row it is what the node before is.
    /// Nodes may be added to the blocks for which `grows` says so.
    pub fn of(keys: &[BlockKey], members: &[Mask], outside: &[Mask], grows: &[bool], is_outer: bool) -> Components {
        let mut pieces: Vec<Vec<Piece>> = members.par_iter().map(pieces_of).collect();
        let mut next = 0u32;
        for (_, label) in pieces.iter_mut().flatten() {
            *label = next;
            next += 1;
        }
        let mut runs = Vec::new();
        for (pair, outside) in keys.windows(2).zip(outside) {
            let (a, b) = (block_at(pair[0]), block_at(pair[1]));
            if a[1..] == b[1..] && b[0] > a[0] + 1 && outside.has(7) == is_outer {
                runs.push(Run { first: key([a[0] + 1, a[1], a[2]]), last: key([b[0] - 1, a[1], a[2]]), label: next });
                next += 1;
            }
        }
        let labels = pieces.par_iter().zip(grows).map(|(pieces, grows)| grows.then(|| labels_of(pieces))).collect();
        let mut found = Components { pieces, labels, joined: UnionFind::new(next as usize + 1), runs, outer: next };
        found.join_blocks(keys, is_outer);
        found.join_runs(keys, is_outer);
        if is_outer {
            found.join_across_faces(keys, members);
        }
        found
    }

    /// What a member of a block hangs together with.
    pub fn root(&mut self, block: usize, place: usize) -> Option<usize> {
        let label = match &self.labels[block] {
            Some(labels) => Some(labels[place]).filter(|label| *label != NOBODY)?,
            None => self.pieces[block].iter().find(|(piece, _)| piece.has(place))?.1,
        };
        Some(self.joined.find(label as usize))
    }

    /// What space in a block that isn't there hangs together with.
    pub fn root_beyond(&mut self, at: BlockKey) -> usize {
        let label = self.beyond(at);
        self.joined.find(label as usize)
    }

    /// Adds a node that joins what `roots` stand for, to a block that grows.
    pub fn add(&mut self, block: usize, place: usize, roots: &[usize]) {
        let Some((root, labels)) = roots.first().zip(self.labels[block].as_mut()) else { return };
        labels[place] = *root as u32;
        roots[1..].iter().for_each(|other| {
            self.joined.join(*root, *other);
        });
    }

    fn beyond(&self, at: BlockKey) -> u32 {
        let after = self.runs.partition_point(|run| run.first <= at);
        match after.checked_sub(1).map(|k| self.runs[k]) {
            Some(run) if at <= run.last => run.label,
            _ => self.outer,
        }
    }

    fn join_blocks(&mut self, keys: &[BlockKey], is_outer: bool) {
        for (index, of) in keys.iter().enumerate() {
            for (axis, is_high) in [(0, false), (0, true), (1, false), (1, true), (2, false), (2, true)] {
                let mut near = block_at(*of);
                near[axis] += if is_high { 1 } else { -1 };
                let beside = if near[axis] < 0 { None } else { Some(key(near)) };
                match beside.map(|key| (key, keys.binary_search(&key))) {
                    Some((_, Ok(beside))) => {
                        // each pair of blocks once
                        for (piece, label) in self.pieces[index].iter().filter(|_| is_high) {
                            let face = piece.face(axis, true);
                            for (other, with) in &self.pieces[beside] {
                                if !face.and(&other.face(axis, false)).is_empty() {
                                    self.joined.join(*label as usize, *with as usize);
                                }
                            }
                        }
                    }
                    missing => {
                        let label = missing.map_or(self.outer, |(key, _)| self.beyond(key));
                        for (piece, own) in self.pieces[index].iter().filter(|_| is_outer || label != self.outer) {
                            if !piece.face(axis, is_high).is_empty() {
                                self.joined.join(*own as usize, label as usize);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Joins members on a diagonal of a face whose other corners are none: there the outside hangs together, and what is labelled
    /// apart would be taken to make no ring when it is joined elsewhere.
    fn join_across_faces(&mut self, keys: &[BlockKey], members: &[Mask]) {
        let next = |masks: &[Mask], axis: usize| -> Vec<Mask> {
            let of = |(mask, key): (&Mask, &BlockKey)| mask.before(axis, behind(keys, *key, axis).map(|at| &masks[at]));
            masks.par_iter().zip(keys).map(of).collect()
        };
        let along: [Vec<Mask>; 3] = std::array::from_fn(|axis| next(members, axis));
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let across = next(&along[a], b);
            for index in 0..keys.len() {
                let (own, across) = (&members[index], &across[index]);
                let (along_a, along_b) = (&along[a][index], &along[b][index]);
                for place in own.and(across).without(along_a).without(along_b).places() {
                    self.join_nodes(keys, (index, place, [None, None]), [Some(a), Some(b)]);
                }
                for place in along_a.and(along_b).without(own).without(across).places() {
                    self.join_nodes(keys, (index, place, [Some(a), None]), [Some(b), None]);
                }
            }
        }
    }

    /// Joins two members, each by the steps along axes that lead to it from a node.
    fn join_nodes(
        &mut self,
        keys: &[BlockKey],
        (block, place, first): (usize, usize, [Option<usize>; 2]),
        second: [Option<usize>; 2],
    ) {
        let mut root = |steps: [Option<usize>; 2]| {
            let mut at = (block, place);
            for axis in steps.into_iter().flatten() {
                let (stride, high) = (1 << (3 * axis), 7 << (3 * axis));
                at = match at.1 & high == high {
                    true => (behind(keys, keys[at.0], axis)?, at.1 - high),
                    false => (at.0, at.1 + stride),
                };
            }
            self.root(at.0, at.1)
        };
        if let Some((a, b)) = root(first).zip(root(second)) {
            self.joined.join(a, b);
        }
    }

    /// Joins runs of rows side by side where no block parts them.
    fn join_runs(&mut self, keys: &[BlockKey], is_outer: bool) {
        for run in &self.runs {
            let (first, last) = (block_at(run.first), block_at(run.last));
            for (y, z) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let row = [first[1] + y, first[2] + z];
                if row.iter().any(|at| *at < 0) {
                    if is_outer {
                        self.joined.join(run.label as usize, self.outer as usize);
                    }
                    continue;
                }
                let (from, to) = (key([first[0], row[0], row[1]]), key([last[0], row[0], row[1]]));
                let start = self.runs.partition_point(|other| other.last < from);
                let mut covered = 0;
                for other in self.runs[start..].iter().take_while(|other| other.first <= to) {
                    self.joined.join(run.label as usize, other.label as usize);
                    covered += other.last.min(to) - other.first.max(from) + 1;
                }
                let blocks = keys.partition_point(|k| *k <= to) - keys.partition_point(|k| *k < from);
                if is_outer && covered + (blocks as u64) < to - from + 1 {
                    self.joined.join(run.label as usize, self.outer as usize);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_parts_what_is_within_from_what_is_around() {
        // blocks 1..=5 along each axis but for the middle one and its faces; no node of them is outside
        let mut keys: Vec<BlockKey> = Vec::new();
        for at in 0..125 {
            let block = [at % 5, at / 5 % 5, at / 25];
            if block.iter().any(|x| *x == 0 || *x == 4) {
                keys.push(key(block.map(|x| x + 1)));
            }
        }
        let (all, none) = (vec![Mask::of(|_| true); keys.len()], vec![Mask::default(); keys.len()]);
        let mut inside = Components::of(&keys, &all, &none, &vec![false; keys.len()], false);
        let shell = inside.root(0, 0).expect("a member");
        assert_eq!(inside.root(97, 511), Some(shell));
        assert_eq!(inside.root_beyond(key([3, 3, 3])), shell, "what is within hangs together with the shell");
        assert_eq!(inside.root_beyond(key([2, 4, 3])), shell);
        // of the outer side nothing is within the shell, and what is around is not joined to it
        let mut outside = Components::of(&keys, &none, &none, &vec![true; keys.len()], true);
        assert_eq!(outside.root(0, 0), None);
        outside.add(0, 0, &[outside.outer as usize]);
        assert_eq!(outside.root(0, 0), Some(outside.root_beyond(key([0, 0, 0]))));
    }

    #[test]
    fn the_outside_hangs_together_across_a_face_whose_signs_alternate_and_the_inside_does_not() {
        // two nodes on a diagonal of a face, in one block and in two that share a face or an edge
        let at = |x: usize, y: usize, z: usize| z << 6 | y << 3 | x;
        let one = |place: usize| Mask::of(|at| at == place);
        let keys: Vec<BlockKey> = (0..8).map(|k| key([1 + k % 2, 1 + k / 2 % 2, 1 + k / 4])).collect();
        let cases = [
            ((0, at(3, 3, 3)), (0, at(4, 4, 3))),
            ((0, at(4, 3, 3)), (0, at(3, 3, 4))),
            ((0, at(7, 2, 2)), (1, at(0, 2, 3))),
            ((2, at(2, 0, 5)), (0, at(2, 7, 6))),
            ((0, at(7, 7, 4)), (3, at(0, 0, 4))),
            ((1, at(0, 7, 4)), (2, at(7, 0, 4))),
        ];
        for (a, b) in cases {
            let mut members = vec![Mask::default(); keys.len()];
            for (block, place) in [a, b] {
                members[block] = members[block].or(&one(place));
            }
            let are_together = |is_outer: bool| {
                let mut found = Components::of(&keys, &members, &members, &[true; 8], is_outer);
                found.root(a.0, a.1).expect("a member") == found.root(b.0, b.1).expect("a member")
            };
            assert!(are_together(true) && !are_together(false), "{a:?} {b:?}");
        }
    }
}
