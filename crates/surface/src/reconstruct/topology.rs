//! Handles and tunnels that only doubtful nodes would make are taken away.
//!
//! Homotopic growth (Szymczak and Vanderhyde, "Extraction of topologically simple isosurfaces from volume datasets",
//! VIS 2003; Bischoff and Kobbelt 2002): what is sure keeps its side. Of the rest the surest nodes are added first, each
//! unless it would join a piece to itself, which makes a ring: such nodes are left out. What is left out parts necks that
//! are at most as wide as a small hole; wider ones are the object's. First so the inside grows, which cuts handles; then
//! the outside, which fills tunnels.
//!
//! Where nobody saw the surface its topology is free to be chosen, and the simplest is. Doubtful there is what lies beside the
//! surface, whatever the field's values: they are no distances where it was carried on from far. Outside that reaches farther
//! than inside: a tunnel is filled only if nobody saw what is around it, while of a ring with a gap in its data the rest was
//! seen, and it is not to be cut there.

use rayon::prelude::*;
use std::collections::VecDeque;

use super::components::Components;
use super::field::FieldBlock;
use super::free_space::IsFree;
use super::grid::{BlockKey, EDGE, Node, around, first_node, node_at, place_of};
use super::levels::{FAR, Volume};
use super::mask::Mask;
use super::simple::Neighbourhood;
use super::trim::SEEN;
use visage_geometry::UnionFind;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Where the surface was seen, nodes nearer to it than this are doubtful, in cells: what is nowhere deeper is thinner than a
        /// cell, and the grid does not resolve it.
        wavering: f32 = 0.5,
        /// The value, in cells, of a node that changed sides, at most: the surface passes close to it.
        changed: f32 = 0.4,
    }
}
/// The nodes that an edge joins to a node, by their bits in its neighbourhood.
const FACES: [usize; 6] = [4, 10, 12, 14, 16, 22];
/// Of a block that isn't there and lies inside.
const NONE_INSIDE: u32 = u32::MAX - 1;
/// Of a block that isn't there and lies outside.
const NONE_OUTSIDE: u32 = u32::MAX;
/// The steps of the order in which nodes are added, for each cell that they are off the surface.
const STEPS: f32 = 256.0;

/// The blocks before and behind along x, y and z, in the order of those around a block.
const BESIDE: [usize; 6] = [12, 14, 10, 16, 4, 22];
/// All nodes of a block.
const ALL: Mask = Mask([u64::MAX; 8]);

/// A node by its block's index and its place there.
type At = (u32, u16);

/// How much is doubtful and may be changed; lengths in cells.
pub struct Doubt<'a> {
    /// The greatest width of a cut.
    pub widest: f32,
    /// How far outside nodes are doubtful where nobody saw the surface; within it is always one.
    pub outside: usize,
    /// What scanners looked through stays outside.
    pub is_free: &'a IsFree<'a>,
}

/// Takes handles and tunnels away whose necks are doubtful. Returns the blocks in which nodes changed sides, in order.
pub fn simplify(volume: &mut Volume, doubt: &Doubt) -> Vec<BlockKey> {
    let mut changed: Vec<BlockKey> =
        [false, true].into_iter().flat_map(|is_outer| grow(volume, is_outer, doubt)).collect();
    changed.sort_unstable();
    changed.dedup();
    changed
}

/// For each block its doubtful nodes: where nobody saw the surface those next to it and `reach` times the ones beside these, where it
/// was seen those that it may waver across.
fn doubtful(volume: &Volume, outside: &[Mask], reach: usize) -> Vec<Mask> {
    let (keys, blocks) = (volume.blocks.keys(), &volume.blocks.values);
    let beside: Vec<[Option<usize>; 6]> = keys
        .par_iter()
        .map(|key| {
            let near = around(*key);
            BESIDE.map(|slot| near[slot].and_then(|key| volume.blocks.index(key)))
        })
        .collect();
    let spread = |masks: &[Mask]| -> Vec<Mask> {
        let of =
            |(mask, near): (&Mask, &[Option<usize>; 6])| mask.spread(near.map(|near| near.map(|near| &masks[near])));
        masks.par_iter().zip(&beside).map(of).collect()
    };
    let inside: Vec<Mask> = outside.par_iter().map(|outside| ALL.without(outside)).collect();
    let unseen: Vec<Mask> = blocks.par_iter().map(|block| Mask::of(|place| block.weights[place] < SEEN)).collect();
    let mut near: Vec<Mask> = spread(outside)
        .iter()
        .zip(&spread(&inside))
        .zip(&unseen)
        .map(|((outside, inside), unseen)| outside.and(inside).and(unseen))
        .collect();
    for _ in 0..reach {
        near = spread(&near).iter().zip(&unseen).map(|(near, unseen)| near.and(unseen)).collect();
    }
    let wavers =
        |block: &FieldBlock, place: usize| block.weights[place] >= SEEN && block.values[place].abs() < TUNING.wavering;
    blocks.par_iter().zip(&near).map(|(block, near)| near.or(&Mask::of(|place| wavers(block, place)))).collect()
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
    fn new(volume: &'a Volume<'a>, is_outer: bool, doubt: &Doubt) -> Self {
        let (keys, blocks) = (volume.blocks.keys(), &volume.blocks.values);
        let outside: Vec<Mask> = blocks.par_iter().map(|block| Mask::of(|place| block.values[place] >= 0.0)).collect();
        let side = |outside: &Mask| if is_outer { *outside } else { ALL.without(outside) };
        let waiting: Vec<Mask> = doubtful(volume, &outside, if is_outer { doubt.outside } else { 1 })
            .iter()
            .zip(&outside)
            .map(|(doubtful, outside)| doubtful.and(&side(outside)))
            .collect();
        let members: Vec<Mask> =
            outside.iter().zip(&waiting).map(|(outside, waiting)| side(outside).without(waiting)).collect();
        let grows: Vec<bool> = waiting.iter().map(|waiting| !waiting.is_empty()).collect();
        let near =
            keys.par_iter().zip(&grows).map(|(key, grows)| grows.then(|| Box::new(near(volume, *key)))).collect();
        let components = Components::of(keys, &members, &outside, &grows, is_outer);
        let queued = vec![Mask::default(); keys.len()];
        Growth { volume, is_outer, around: Neighbourhood::default(), near, members, waiting, queued, components }
    }

    /// The block that holds the node at an offset, by its bit in a neighbourhood, or what stands for one that isn't there; which of
    /// the blocks around that is; the node's place there.
    fn beside(&self, at: At, bit: usize) -> (u32, usize, usize) {
        let own = node_at(&[0; 3], usize::from(at.1));
        let node = [own[0] + bit as i32 % 3 - 1, own[1] + bit as i32 / 3 % 3 - 1, own[2] + bit as i32 / 9 - 1];
        let of = node.map(|x| (x + EDGE) >> 3);
        let slot = (of[2] * 9 + of[1] * 3 + of[0]) as usize;
        let block = match &self.near[at.0 as usize] {
            Some(near) => near[slot],
            None => at.0,
        };
        (block, slot, place_of(&node))
    }

    fn is_member(&self, at: At, bit: usize) -> bool {
        match self.beside(at, bit) {
            (NONE_INSIDE, ..) => !self.is_outer,
            (NONE_OUTSIDE, ..) => self.is_outer,
            (block, _, place) => self.members[block as usize].has(place),
        }
    }

    fn root(&mut self, at: At, bit: usize) -> Option<usize> {
        match self.beside(at, bit) {
            (NONE_INSIDE | NONE_OUTSIDE, slot, _) => {
                let key = around(self.volume.blocks.keys()[at.0 as usize])[slot]?;
                Some(self.components.root_beyond(key))
            }
            (block, _, place) => self.components.root(block as usize, place),
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

    /// Adds nodes, surest first and of equals the first that was reached, as long as any can be added.
    fn run(&mut self) {
        let volume = self.volume;
        let step = |(block, place): At| {
            let value = volume.blocks.values[block as usize].values[usize::from(place)];
            (STEPS * value.abs().min(FAR)) as usize
        };
        let mut queue = vec![VecDeque::new(); (STEPS * FAR) as usize + 1];
        let mut top = 0;
        for block in 0..self.waiting.len() {
            for place in self.waiting[block].places() {
                let at = (block as u32, place as u16);
                if FACES.iter().any(|bit| self.is_member(at, *bit)) {
                    self.queued[block].set(place, true);
                    queue[step(at)].push_back(at);
                    top = top.max(step(at));
                }
            }
        }
        loop {
            let Some(at) = queue[top].pop_front() else {
                if top == 0 {
                    return;
                }
                top -= 1;
                continue;
            };
            self.queued[at.0 as usize].set(usize::from(at.1), false);
            if !self.add(at) {
                continue;
            }
            for bit in (0..27).filter(|bit| *bit != 13) {
                let (block, _, place) = self.beside(at, bit);
                // what was refused is asked again
                if block < NONE_INSIDE
                    && self.waiting[block as usize].has(place)
                    && !self.queued[block as usize].has(place)
                {
                    let next = (block, place as u16);
                    self.queued[block as usize].set(place, true);
                    queue[step(next)].push_back(next);
                    top = top.max(step(next));
                }
            }
        }
    }

    /// The nodes that were left out, where those that hang together reach no farther than they may and nobody looked through them.
    fn small_cuts(&self, doubt: &Doubt) -> Vec<At> {
        let of_block =
            |(block, waiting): (usize, &Mask)| waiting.places().map(move |place| (block as u32, place as u16));
        let left: Vec<At> = self.waiting.iter().enumerate().flat_map(of_block).collect();
        let mut cuts = UnionFind::new(left.len());
        for (index, at) in left.iter().enumerate() {
            for bit in (0..27).filter(|bit| *bit != 13) {
                let (block, _, place) = self.beside(*at, bit);
                if let Ok(other) = left.binary_search(&(block, place as u16)) {
                    cuts.join(index, other);
                }
            }
        }
        let mut bounds = vec![([i32::MAX; 3], [i32::MIN; 3]); left.len()];
        let mut is_looked_through = vec![false; left.len()];
        for (index, (block, place)) in left.iter().enumerate() {
            let node = node_at(&first_node(self.volume.blocks.keys()[*block as usize]), usize::from(*place));
            let cut = cuts.find(index);
            is_looked_through[cut] |= self.is_outer && (doubt.is_free)(&node.map(|x| x as f32));
            let (low, high) = &mut bounds[cut];
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(node[axis]), high[axis].max(node[axis]));
            }
        }
        let mut is_small = |index: usize| {
            let cut = cuts.find(index);
            let (low, high) = bounds[cut];
            let square: f64 = (0..3).map(|k| f64::from(high[k] - low[k]).powi(2)).sum();
            square <= f64::from(doubt.widest).powi(2) && !is_looked_through[cut]
        };
        (0..left.len()).filter(|index| is_small(*index)).map(|index| left[index]).collect()
    }
}

/// For the blocks around a block which they are, or on which side they lie.
fn near(volume: &Volume, of: BlockKey) -> [u32; 27] {
    let (first, keys, mut beyond) = (first_node(of), around(of), volume.beyond());
    std::array::from_fn(|slot| {
        if let Some(index) = keys[slot].and_then(|key| volume.blocks.index(key)) {
            return index as u32;
        }
        // no surface passes between the node of that block that is next to this one and those beside it
        let offset = [slot % 3, slot / 3 % 3, slot / 9].map(|at| [-1, 0, EDGE][at]);
        let node: Node = std::array::from_fn(|axis| first[axis] + offset[axis]);
        if beyond.at(&node) < 0.0 { NONE_INSIDE } else { NONE_OUTSIDE }
    })
}

/// Grows one side; what is left out changes to the other one, where that makes but a small cut. Returns the blocks of what changed.
fn grow(volume: &mut Volume, is_outer: bool, doubt: &Doubt) -> Vec<BlockKey> {
    let mut growth = Growth::new(volume, is_outer, doubt);
    growth.run();
    let changed = growth.small_cuts(doubt);
    for (block, place) in &changed {
        let value = &mut volume.blocks.values[*block as usize].values[usize::from(*place)];
        let size = value.abs().clamp(f32::MIN_POSITIVE, TUNING.changed);
        *value = if is_outer { -size } else { size };
    }
    changed.iter().map(|(block, _)| volume.blocks.keys()[*block as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::grid::{Blocks, NODES, key};
    use crate::reconstruct::samples::Samples;
    use crate::reconstruct::{coarse, extract, levels};
    use std::collections::BTreeSet;

    /// The Euler characteristic of a surface whose field and weight are told for each place from its middle, after handles were taken away.
    fn euler(field: impl Fn([f32; 3]) -> (f32, f32), doubt: &Doubt) -> i64 {
        let keys: Vec<BlockKey> = (0..27).map(|k| key([k % 3, k / 3 % 3, k / 9])).collect();
        let block = |of: &BlockKey| {
            let first = first_node(*of);
            let mut block = FieldBlock { values: Box::new([0.0; NODES]), weights: Box::new([0.0; NODES]) };
            for place in 0..NODES {
                let at = node_at(&first, place).map(|x| x as f32 - 11.7);
                (block.values[place], block.weights[place]) = field(at);
            }
            block
        };
        let values = keys.iter().map(block).collect();
        let field = Blocks::new(keys, values);
        let nothing = Samples { samples: Vec::new(), blocks: Blocks::new(Vec::new(), Vec::new()) };
        let coarse = coarse::sides(&nothing, &[24; 3]);
        let mut volume = levels::volume(&field, &coarse, &|_| false);
        extract::close(&mut volume);
        simplify(&mut volume, doubt);
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

    const NOBODY_SAW: f32 = 0.5 * SEEN;
    const SEEN_WELL: f32 = 10.0 * SEEN;

    fn ring([x, y, z]: [f32; 3], tube: f32) -> f32 {
        (x.hypot(y) - 6.3).hypot(z) - tube
    }

    #[test]
    fn a_doubtful_neck_is_cut_unless_it_is_wide_and_a_ring_that_was_seen_stays() {
        // nobody saw a sixth of the ring, where its tube has another radius
        let of_ring = |unseen: Option<f32>, widest: f32| {
            let field = |at: [f32; 3]| match unseen.filter(|_| at[1].atan2(at[0]).abs() < 0.5) {
                Some(tube) => (ring(at, tube), NOBODY_SAW),
                None => (ring(at, 2.7), SEEN_WELL),
            };
            euler(field, &Doubt { widest, outside: 3, is_free: &|_| false })
        };
        assert_eq!(of_ring(Some(1.6), 20.0), 2);
        assert_eq!(of_ring(Some(1.6), 1.5), 0);
        assert_eq!(of_ring(Some(2.7), 20.0), 0, "what is thick has a core that is sure");
        assert_eq!(of_ring(None, 20.0), 0);
    }

    #[test]
    fn a_tunnel_is_filled_if_nobody_saw_what_is_around_it_or_looked_through() {
        let of_tunnel = |outside: usize, weight: f32, is_free: bool| {
            let field = |at: [f32; 3]| (ring(at, 2.9), if at[0].hypot(at[1]) < 6.0 { weight } else { SEEN_WELL });
            euler(field, &Doubt { widest: 20.0, outside, is_free: &|_| is_free })
        };
        assert_eq!(of_tunnel(3, NOBODY_SAW, false), 2);
        assert_eq!(of_tunnel(1, NOBODY_SAW, false), 0, "its middle is sure");
        assert_eq!(of_tunnel(3, NOBODY_SAW, true), 0, "looked through");
        assert_eq!(of_tunnel(3, SEEN_WELL, false), 0, "seen");
    }

    #[test]
    fn a_strand_thinner_than_a_cell_holds_nothing_together_though_it_was_seen() {
        // two balls, joined by a rod and by a strand whose nodes are hardly inside
        let of_strand = |depth: f32| {
            let field = |[x, y, z]: [f32; 3]| {
                let ball = |middle: f32| (x - middle).hypot(y).hypot(z) - 4.2;
                let rod = if x.abs() < 6.0 { (y - 2.3).hypot(z - 0.3) - 1.7 } else { 2.0 };
                let strand = if x.abs() < 6.0 { ((y + 2.7).abs() + (z - 0.3).abs()) * 0.8 - depth } else { 2.0 };
                (ball(-6.0).min(ball(6.0)).min(rod).min(strand), SEEN_WELL)
            };
            euler(field, &Doubt { widest: 10.0, outside: 1, is_free: &|_| false })
        };
        assert_eq!(of_strand(0.35), 2);
        assert_eq!(of_strand(0.7), 0, "that is thick enough");
    }
}
