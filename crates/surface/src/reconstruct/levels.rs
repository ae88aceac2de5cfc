//! The field carried on to where there is no data, from coarse to fine: known near the samples, smooth between.

use rayon::prelude::*;

use super::coarse::Dense;
use super::field::{Field, FieldBlock};
use super::free_space::{IsFree, JUST_OUTSIDE};
use super::grid::{BlockKey, Blocks, Finder, NODES, Node, around, block_of, first_node, node_at, place_of};

/// Values beyond this, in cells, say only which side it is.
pub const FAR: f32 = 2.0;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Relaxations on each level.
        sweeps: usize = 12,
    }
}

/// The nodes of a block of one level.
#[derive(Debug, Clone)]
struct LevelBlock {
    values: Box<[f32; NODES]>,
    /// Whether a value is given, by data or by free space.
    is_known: Box<[bool; NODES]>,
}

/// What is known on the nodes of one level, whose coordinates are those of the finest divided by `step`.
struct Level {
    step: i32,
    blocks: Blocks<LevelBlock>,
}

/// The field on the finest grid wherever the surface passes.
pub struct Volume<'a> {
    /// With values between the data, too.
    pub blocks: Blocks<FieldBlock>,
    levels: Vec<Level>,
    coarse: &'a Dense,
}

impl Volume<'_> {
    /// What is beyond the blocks of the finest grid.
    pub fn beyond(&self) -> Above<'_> {
        Above::new(&self.levels, self.coarse)
    }
}

/// Carries the field on. `coarse` tells the side of each place; `is_free` is asked where there is no data.
pub fn volume<'a>(field: &Field, coarse: &'a Dense, is_free: &IsFree) -> Volume<'a> {
    let mut levels: Vec<Level> = Vec::new();
    let mut step = coarse.step / 2;
    while step > 1 {
        let level = next_level(field, &levels, coarse, step, Vec::new(), is_free);
        levels.push(level);
        step /= 2;
    }
    let finest = next_level(field, &levels, coarse, 1, field.keys().to_vec(), is_free);
    let nothing = || Box::new([0.0f32; NODES]);
    let weights = |key: &BlockKey| field.get(*key).map_or_else(nothing, |block| block.weights.clone());
    let keys = finest.blocks.keys().to_vec();
    let blocks: Vec<FieldBlock> = keys
        .par_iter()
        .zip(finest.blocks.values)
        .map(|(key, block)| FieldBlock { values: block.values, weights: weights(key) })
        .collect();
    Volume { blocks: Blocks::new(keys, blocks), levels, coarse }
}

/// What levels say of places.
pub struct Above<'a> {
    /// From coarse to fine, each with the edge of its cells.
    levels: Vec<(i32, Finder<'a, LevelBlock>)>,
    coarse: &'a Dense,
}

impl<'a> Above<'a> {
    fn new(levels: &'a [Level], coarse: &'a Dense) -> Self {
        let levels = levels.iter().map(|level| (level.step, Finder::new(&level.blocks))).collect();
        Above { levels, coarse }
    }

    /// The value at a node of the finest grid, or of the level that comes next.
    pub fn at(&mut self, node: &Node) -> f32 {
        above(&mut self.levels, self.coarse, node)
    }
}

/// What the levels say of a node, in cells of the finest grid; the last of them is the finest. Its cells are twice as wide as those
/// of whose node it is: along each axis that is on one of its nodes, or half way between two.
fn above(levels: &mut [(i32, Finder<LevelBlock>)], coarse: &Dense, node: &Node) -> f32 {
    let Some(((step, last), others)) = levels.split_last_mut() else {
        return FAR * coarse.at(&node.map(|x| x as f32));
    };
    // a power of two
    let shift = step.trailing_zeros();
    let is_between = node.map(|x| usize::from(x & (*step - 1) != 0));
    let between = is_between[0] | is_between[1] << 1 | is_between[2] << 2;
    let low = node.map(|x| x >> shift);
    let mut sum = 0.0;
    for corner in (0..8).filter(|corner| corner & !between == 0) {
        let at: Node = std::array::from_fn(|axis| low[axis] + (corner >> axis & 1) as i32);
        sum += match last.get(block_of(&at)) {
            Some(block) => block.values[place_of(&at)],
            None => above(others, coarse, &at.map(|x| x << shift)),
        };
    }
    sum / (1 << between.count_ones()) as f32
}

/// The next finer level: the blocks in which the surface passes and those in `wanted`.
fn next_level(
    field: &Field,
    levels: &[Level],
    coarse: &Dense,
    step: i32,
    wanted: Vec<BlockKey>,
    is_free: &IsFree,
) -> Level {
    let mut keys = passed(levels, coarse, step);
    keys.extend(wanted);
    keys.par_sort_unstable();
    keys.dedup();
    let blocks: Vec<LevelBlock> =
        keys.par_iter().map(|key| begin(field, levels, coarse, step, *key, is_free)).collect();
    let mut level = Level { step, blocks: Blocks::new(keys, blocks) };
    for _ in 0..TUNING.sweeps {
        relax(&mut level);
    }
    level
}

/// Blocks of the next level near which the last one's values change sign.
fn passed(levels: &[Level], coarse: &Dense, step: i32) -> Vec<BlockKey> {
    // a block of the next level covers 4 cells of the last, and is wanted if the surface passes within one cell of it
    match levels.last() {
        Some(last) => {
            let found: Vec<Vec<BlockKey>> = last
                .blocks
                .keys()
                .par_iter()
                .zip(&last.blocks.values)
                .map(|(key, block)| {
                    let first = first_node(*key);
                    let beyond = around(*key);
                    // after this one along x, y, z
                    let beyond = [14, 16, 22].map(|slot| beyond[slot].and_then(|key| last.blocks.get(key)));
                    let mut near = Vec::new();
                    for place in 0..NODES {
                        let node = node_at(&first, place);
                        let value = block.values[place];
                        let is_crossed = (0..3).any(|axis| {
                            let stride = 1 << (3 * axis);
                            let next = match (place / stride) & 7 {
                                7 => beyond[axis].map(|block| block.values[place - 7 * stride]),
                                _ => Some(block.values[place + stride]),
                            };
                            next.is_some_and(|next| (next < 0.0) != (value < 0.0))
                        });
                        if is_crossed {
                            push_around(&node, &mut near);
                        }
                    }
                    near.sort_unstable();
                    near.dedup();
                    near
                })
                .collect();
            found.into_iter().flatten().collect()
        }
        None => {
            let mut near = Vec::new();
            coarse.for_each_crossed(|node| push_around(&node, &mut near));
            debug_assert_eq!(coarse.step, 2 * step);
            near
        }
    }
}

/// The blocks of the next level around a cell of the last.
fn push_around(node: &[i32; 3], near: &mut Vec<BlockKey>) {
    let low: [i32; 3] = node.map(|x| ((2 * x - 4) >> 3).max(0));
    let high = node.map(|x| (2 * x + 6) >> 3);
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                near.push(super::grid::key([x, y, z]));
            }
        }
    }
}

/// A block's values before anything is relaxed.
fn begin(field: &Field, levels: &[Level], coarse: &Dense, step: i32, key: BlockKey, is_free: &IsFree) -> LevelBlock {
    let first = first_node(key);
    let mut values = Box::new([0.0f32; NODES]);
    let mut is_known = Box::new([false; NODES]);
    let (mut data, mut above) = (Finder::new(field), Above::new(levels, coarse));
    for place in 0..NODES {
        let node = node_at(&first, place).map(|x| x * step);
        let data = data.get(block_of(&node)).map(|block| {
            let at = place_of(&node);
            (block.values[at], block.weights[at])
        });
        match data {
            Some((value, weight)) if weight > 0.0 => {
                (values[place], is_known[place]) = (value.clamp(-FAR, FAR), true);
            }
            _ => {
                values[place] = above.at(&node);
                // what is far outside already is not asked for
                if values[place] < FAR && is_free(&node.map(|x| x as f32)) {
                    (values[place], is_known[place]) = (values[place].max(JUST_OUTSIDE), true);
                }
            }
        }
    }
    LevelBlock { values, is_known }
}

/// Each unknown value becomes the mean of its neighbours.
fn relax(level: &mut Level) {
    let next: Vec<Option<Box<[f32; NODES]>>> = level
        .blocks
        .keys()
        .par_iter()
        .zip(&level.blocks.values)
        .map(|(key, block)| {
            if block.is_known.iter().all(|known| *known) {
                return None;
            }
            let near = around(*key);
            // below, above along z, y, x
            let beside = [4, 22, 10, 16, 12, 14].map(|k| near[k].and_then(|key| level.blocks.get(key)));
            let mut values = block.values.clone();
            for place in (0..NODES).filter(|place| !block.is_known[*place]) {
                let own = block.values[place];
                let mut sum = 0.0;
                for (axis, stride) in [(2, 64), (1, 8), (0, 1)] {
                    let at = (place / stride) & 7;
                    let side = 2 * (2 - axis);
                    sum += match at {
                        0 => beside[side].map_or(own, |b| b.values[place + 7 * stride]),
                        _ => block.values[place - stride],
                    };
                    sum += match at {
                        7 => beside[side + 1].map_or(own, |b| b.values[place - 7 * stride]),
                        _ => block.values[place + stride],
                    };
                }
                values[place] = sum / 6.0;
            }
            Some(values)
        })
        .collect();
    for (block, values) in level.blocks.values.iter_mut().zip(next) {
        if let Some(values) = values {
            block.values = values;
        }
    }
}
