//! The sparse grid: nodes at whole coordinates, kept in blocks of 8 x 8 x 8 where something is near.

/// Nodes along an edge of a block.
pub const EDGE: i32 = 8;
/// Nodes of a block.
pub const NODES: usize = (EDGE * EDGE * EDGE) as usize;
/// Bits of a block's coordinate along an axis.
const BITS: u32 = 17;

/// Nodes along an axis, at most, with room around what is kept.
pub const MOST_NODES: i32 = (1 << (BITS + 3)) - 64;

/// A node's coordinates, in edges of cells; at least 0.
pub type Node = [i32; 3];
/// A block's place; blocks are in order by z, then y, then x.
pub type BlockKey = u64;

/// The block that holds a node.
#[inline]
pub fn block_of(node: &Node) -> BlockKey {
    key([node[0] >> 3, node[1] >> 3, node[2] >> 3])
}

/// The key of a block by its coordinates, at least 0.
#[inline]
pub fn key(block: [i32; 3]) -> BlockKey {
    (block[2] as u64) << (2 * BITS) | (block[1] as u64) << BITS | block[0] as u64
}

/// A block's coordinates.
#[inline]
pub fn block_at(key: BlockKey) -> [i32; 3] {
    let mask = (1 << BITS) - 1;
    [(key & mask) as i32, (key >> BITS & mask) as i32, (key >> (2 * BITS)) as i32]
}

/// A block's first node.
#[inline]
pub fn first_node(key: BlockKey) -> Node {
    block_at(key).map(|at| at * EDGE)
}

/// A node's place in its block.
#[inline]
pub fn place_of(node: &Node) -> usize {
    ((node[2] & 7) << 6 | (node[1] & 7) << 3 | (node[0] & 7)) as usize
}

/// The node at a place of a block whose first node is `first`.
#[inline]
pub fn node_at(first: &Node, place: usize) -> Node {
    [first[0] + (place & 7) as i32, first[1] + (place >> 3 & 7) as i32, first[2] + (place >> 6) as i32]
}

/// The corners of a cell, each by its offset along x, y, z, with their weights at a place that lies at `share` of the cell's
/// edges: trilinear interpolation.
#[inline]
pub fn corners(share: &[f32; 3]) -> [([usize; 3], f32); 8] {
    std::array::from_fn(|corner| {
        let offset = [corner & 1, corner >> 1 & 1, corner >> 2];
        let along = |axis: usize| if offset[axis] == 1 { share[axis] } else { 1.0 - share[axis] };
        (offset, along(0) * along(1) * along(2))
    })
}

/// Blocks in the order of their keys, each with what is kept of it.
#[derive(Debug, Clone)]
pub struct Blocks<T> {
    keys: Vec<BlockKey>,
    /// In the order of the keys.
    pub values: Vec<T>,
}

impl<T> Blocks<T> {
    /// Of keys in order, no two of them equal.
    pub fn new(keys: Vec<BlockKey>, values: Vec<T>) -> Self {
        debug_assert!(keys.is_sorted() && keys.len() == values.len());
        Blocks { keys, values }
    }

    /// The keys, in order.
    pub fn keys(&self) -> &[BlockKey] {
        &self.keys
    }

    /// The block of a key, if it is there.
    #[inline]
    pub fn get(&self, key: BlockKey) -> Option<&T> {
        self.keys.binary_search(&key).ok().map(|index| &self.values[index])
    }

    /// The index of a block, if it is there.
    #[inline]
    pub fn index(&self, key: BlockKey) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }
}

/// Looks up one block after the other: mostly the one that was wanted last is wanted again.
#[derive(Debug, Clone)]
pub struct Finder<'a, T> {
    blocks: &'a Blocks<T>,
    last: Option<(BlockKey, Option<&'a T>)>,
}

impl<'a, T> Finder<'a, T> {
    /// Over blocks.
    pub fn new(blocks: &'a Blocks<T>) -> Self {
        Finder { blocks, last: None }
    }

    /// The block of a key, if it is there.
    #[inline]
    pub fn get(&mut self, key: BlockKey) -> Option<&'a T> {
        match self.last {
            Some((last, found)) if last == key => found,
            _ => {
                let found = self.blocks.get(key);
                self.last = Some((key, found));
                found
            }
        }
    }
}

/// The keys of the blocks around a block and of itself, in the order of offsets from -1 to 1 by z, y, x; `None` beyond the
/// grid.
pub fn around(key_of: BlockKey) -> [Option<BlockKey>; 27] {
    let at = block_at(key_of);
    std::array::from_fn(|k| {
        let offset = [k as i32 % 3 - 1, k as i32 / 3 % 3 - 1, k as i32 / 9 - 1];
        let near = [at[0] + offset[0], at[1] + offset[1], at[2] + offset[2]];
        near.iter().all(|x| (0..1 << BITS).contains(x)).then(|| key(near))
    })
}
