//! Handles and tunnels that only doubtful nodes would make are taken away.
//!
//! Homotopic growth (Szymczak and Vanderhyde, "Extraction of topologically simple isosurfaces from volume datasets",
//! VIS 2003; Bischoff and Kobbelt 2002): what is sure keeps its side. Of the rest the surest nodes are added first, each
//! unless it would join a piece to itself, which makes a ring: such nodes are left out. What is left out parts necks that
//! are at most as wide as a small hole; wider ones are the object's. First so the inside grows, which cuts handles; then
//! the outside, which fills tunnels.

use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::components::Components;
use super::field::FieldBlock;
use super::grid::{BlockKey, EDGE, Node, around, first_node, node_at};
use super::levels::Volume;
use super::mask::Mask;
use super::simple::Neighbourhood;
use super::trim::SEEN;
use visage_geometry::UnionFind;

/// Where nobody saw the surface, nodes nearer to it than this are doubtful, in cells.
const UNSEEN: f32 = 1.2;
/// Where it was seen, nodes nearer than this: as far as it wavers.
const WAVERING: f32 = 0.25;
/// The value, in cells, of a node that changed sides, at most: the surface passes close to it.
const CHANGED: f32 = 0.4;
/// The nodes that an edge joins to a node, by their bits in its neighbourhood.
const FACES: [usize; 6] = [4, 10, 12, 14, 16, 22];
/// Of a block that isn't there.
const NONE: u32 = u32::MAX;

/// A node by its block's index and its place there.
type At = (u32, u16);

/// Takes handles and tunnels away whose necks are doubtful and at most `widest` cells wide. Returns how many nodes changed
/// sides.
pub fn simplify(volume: &mut Volume, widest: f32) -> usize {
    [false, true].into_iter().map(|is_outer| grow(volume, is_outer, widest)).sum()
}

fn is_doubtful(block: &FieldBlock, place: usize) -> bool {
    block.values[place].abs() < if block.weights[place] < SEEN { UNSEEN } else { WAVERING }
}

/// One side as it grows.
struct Growth<'a> {
    volume: &'a Volume<'a>,
    is_outer: bool,
    around: Neighbourhood,
    /// For each block with doubtful nodes the indices of the blocks around.
    near: Vec<Option<Box<[u32; 27]>>>,
    members: Vec<Mask>,
    /// What is refused or not asked yet.
    waiting: Vec<Mask>,
    queued: Vec<Mask>,
    components: Components,
}

impl<'a> Growth<'a> {
    fn new(volume: &'a Volume<'a>, is_outer: bool) -> Self {
        let (keys, blocks) = (volume.blocks.keys(), &volume.blocks.values);
        let outside: Vec<Mask> = blocks.par_iter().map(|block| Mask::of(|place| block.values[place] >= 0.0)).collect();
        let side = |mask: &Mask| if is_outer { *mask } else { Mask([u64::MAX; 8]).without(mask) };
        let waiting: Vec<Mask> = blocks
            .par_iter()
            .zip(&outside)
            .map(|(block, outside)| Mask::of(|place| is_doubtful(block, place)).and(&side(outside)))
            .collect();
        let members: Vec<Mask> =
            outside.iter().zip(&waiting).map(|(outside, waiting)| side(outside).without(waiting)).collect();
        let index =
            |key: Option<BlockKey>| key.and_then(|key| volume.blocks.index(key)).map_or(NONE, |index| index as u32);
        let near = keys
            .par_iter()
            .zip(&waiting)
            .map(|(key, waiting)| (!waiting.is_empty()).then(|| Box::new(around(*key).map(index))))
            .collect();
        let components = Components::of(keys, &members, &outside, is_outer);
        let queued = vec![Mask::default(); keys.len()];
        Growth { volume, is_outer, around: Neighbourhood::default(), near, members, waiting, queued, components }
    }

    fn node(&self, at: At, bit: usize) -> Node {
        let own = node_at(&[0; 3], usize::from(at.1));
        [own[0] + bit as i32 % 3 - 1, own[1] + bit as i32 / 3 % 3 - 1, own[2] + bit as i32 / 9 - 1]
    }

    /// The node at an offset, by its bit in a neighbourhood; `Err` with the offset of a block that isn't there.
    fn beside(&self, at: At, bit: usize) -> Result<At, usize> {
        let node = self.node(at, bit);
        let of = node.map(|x| (x + EDGE) >> 3);
        let slot = (of[2] * 9 + of[1] * 3 + of[0]) as usize;
        let block = if slot == 13 { at.0 } else { self.near[at.0 as usize].as_ref().map_or(NONE, |near| near[slot]) };
        if block == NONE { Err(slot) } else { Ok((block, super::grid::place_of(&node) as u16)) }
    }

    fn is_member(&self, at: At, bit: usize) -> bool {
        match self.beside(at, bit) {
            Ok((block, place)) => self.members[block as usize].has(usize::from(place)),
            Err(_) => {
                let first = first_node(self.volume.blocks.keys()[at.0 as usize]);
                let local = self.node(at, bit);
                let node = std::array::from_fn(|axis| first[axis] + local[axis]);
                (self.volume.beyond(&node) >= 0.0) == self.is_outer
            }
        }
    }

    fn root(&mut self, at: At, bit: usize) -> Option<usize> {
        match self.beside(at, bit) {
            Ok((block, place)) => self.components.root(block as usize, usize::from(place)),
            Err(slot) => {
                let key = around(self.volume.blocks.keys()[at.0 as usize])[slot]?;
                Some(self.components.root_beyond(key))
            }
        }
    }

    /// The members around a node, as bits.
    fn members_around(&self, at: At) -> u32 {
        let place = usize::from(at.1);
        let [x, y, z] = node_at(&[0; 3], place);
        if [x, y, z].iter().all(|at| (1..EDGE - 1).contains(at)) {
            let slices = &self.members[at.0 as usize].0;
            let row = |dz: usize, dy: usize| {
                (slices[z as usize + dz - 1] >> ((y as usize + dy - 1) * 8 + x as usize - 1) & 7) as u32
            };
            return (0..9).fold(0, |set, k| set | row(k / 3, k % 3) << (3 * k));
        }
        (0..27).filter(|bit| *bit != 13 && self.is_member(at, *bit)).fold(0, |set, bit| set | 1 << bit)
    }

    /// Adds a node unless it would join a piece to itself, or touches none; true if it was added.
    fn add(&mut self, at: At) -> bool {
        let members = self.members_around(at);
        let own = if self.is_outer { self.around.outside(!members) } else { self.around.inside(members) };
        if own.count == 0 || own.count > own.first.len() {
            return false;
        }
        let roots: Vec<usize> =
            own.first[..own.count].iter().filter_map(|bit| self.root(at, usize::from(*bit))).collect();
        if roots.is_empty() || (1..roots.len()).any(|k| roots[..k].contains(&roots[k])) {
            return false;
        }
        let (block, place) = (at.0 as usize, usize::from(at.1));
        self.components.add(block, place, &roots);
        self.members[block].set(place, true);
        self.waiting[block].set(place, false);
        true
    }

    /// Adds nodes, surest first, as long as any can be added.
    fn run(&mut self) {
        let volume = self.volume;
        // of equals the first
        let priority = |(block, place): At| {
            let value = volume.blocks.values[block as usize].values[usize::from(place)];
            (value.abs().to_bits(), Reverse((block, place)))
        };
        let mut queue = BinaryHeap::new();
        for block in 0..self.waiting.len() {
            for place in self.waiting[block].places() {
                let at = (block as u32, place as u16);
                if FACES.iter().any(|bit| self.is_member(at, *bit)) {
                    self.queued[block].set(place, true);
                    queue.push(priority(at));
                }
            }
        }
        while let Some((_, Reverse(at))) = queue.pop() {
            self.queued[at.0 as usize].set(usize::from(at.1), false);
            if !self.add(at) {
                continue;
            }
            for bit in (0..27).filter(|bit| *bit != 13) {
                let Ok(next) = self.beside(at, bit) else { continue };
                let (block, place) = (next.0 as usize, usize::from(next.1));
                // what was refused is asked again
                if self.waiting[block].has(place) && !self.queued[block].has(place) {
                    self.queued[block].set(place, true);
                    queue.push(priority(next));
                }
            }
        }
    }

    /// The nodes that were left out, where those that hang together reach no farther than `widest`.
    fn small_cuts(&self, widest: f32) -> Vec<At> {
        let of_block =
            |(block, waiting): (usize, &Mask)| waiting.places().map(move |place| (block as u32, place as u16));
        let left: Vec<At> = self.waiting.iter().enumerate().flat_map(of_block).collect();
        let mut cuts = UnionFind::new(left.len());
        for (index, at) in left.iter().enumerate() {
            for bit in (0..27).filter(|bit| *bit != 13) {
                if let Some(other) = self.beside(*at, bit).ok().and_then(|next| left.binary_search(&next).ok()) {
                    cuts.join(index, other);
                }
            }
        }
        let mut bounds = vec![([i32::MAX; 3], [i32::MIN; 3]); left.len()];
        for (index, (block, place)) in left.iter().enumerate() {
            let node = node_at(&first_node(self.volume.blocks.keys()[*block as usize]), usize::from(*place));
            let (low, high) = &mut bounds[cuts.find(index)];
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(node[axis]), high[axis].max(node[axis]));
            }
        }
        let mut is_small = |index: usize| {
            let (low, high) = bounds[cuts.find(index)];
            let square: f64 = (0..3).map(|k| f64::from(high[k] - low[k]).powi(2)).sum();
            square <= f64::from(widest).powi(2)
        };
        (0..left.len()).filter(|index| is_small(*index)).map(|index| left[index]).collect()
    }
}

/// Grows one side; what is left out changes to the other one, where that makes but a small cut.
fn grow(volume: &mut Volume, is_outer: bool, widest: f32) -> usize {
    let mut growth = Growth::new(volume, is_outer);
    growth.run();
    let changed = growth.small_cuts(widest);
    for (block, place) in &changed {
        let value = &mut volume.blocks.values[*block as usize].values[usize::from(*place)];
        let size = value.abs().clamp(f32::MIN_POSITIVE, CHANGED);
        *value = if is_outer { -size } else { size };
    }
    changed.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::grid::{Blocks, NODES, key};
    use crate::reconstruct::samples::Samples;
    use crate::reconstruct::{coarse, extract, levels};
    use std::collections::BTreeSet;

    /// The Euler characteristic of the surface of a torus that nobody saw for a sixth of its turn, if `is_seen` isn't told,
    /// after handles were taken away up to a width.
    fn euler_of_torus(is_seen: bool, widest: f32) -> i64 {
        let keys: Vec<BlockKey> = (0..27).map(|k| key([k % 3, k / 3 % 3, k / 9])).collect();
        let block = |of: &BlockKey| {
            let first = first_node(*of);
            let mut block = FieldBlock { values: Box::new([0.0; NODES]), weights: Box::new([0.0; NODES]) };
            for place in 0..NODES {
                let [x, y, z] = node_at(&first, place).map(|x| x as f32 - 11.7);
                let value = (x.hypot(y) - 6.3).hypot(z) - 2.7;
                let is_unseen = !is_seen && y.atan2(x).abs() < 0.5;
                block.values[place] = if is_unseen { value.max(-1.0) } else { value };
                block.weights[place] = if is_unseen { 0.5 * SEEN } else { 10.0 };
            }
            block
        };
        let values = keys.iter().map(block).collect();
        let field = Blocks::new(keys, values);
        let nothing = Samples { samples: Vec::new(), blocks: Blocks::new(Vec::new(), Vec::new()) };
        let coarse = coarse::sides(&nothing, &[24; 3]);
        let mut volume = levels::volume(&field, &coarse, &|_| false);
        extract::close(&mut volume);
        simplify(&mut volume, widest);
        let found = extract::extract(&volume);
        let edges: BTreeSet<[u32; 2]> = found
            .faces
            .iter()
            .flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        assert_eq!(3 * found.faces.len(), 2 * edges.len(), "closed");
        found.vertices.len() as i64 - edges.len() as i64 + found.faces.len() as i64
    }

    #[test]
    fn a_doubtful_neck_is_cut_unless_it_is_wide_and_a_ring_that_was_seen_stays() {
        assert_eq!(euler_of_torus(false, 20.0), 2);
        assert_eq!(euler_of_torus(false, 3.0), 0);
        assert_eq!(euler_of_torus(true, 20.0), 0);
    }
}
