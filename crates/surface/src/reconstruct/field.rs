//! The signed distance near the data: the mean of the planes of the samples around, as far as they look the same way.
//!
//! Implicit moving least squares (Kolluri, "Provably good moving least squares", SODA 2005) on the nodes of a sparse grid. Of
//! thin walls each side is left to its own samples: what looks the other way than the sample nearest to a node has no
//! say there.

use rayon::prelude::*;

use super::grid::{BlockKey, Blocks, EDGE, NODES, around, corners, first_node};
use super::samples::{Sample, Samples};

/// How far a sample has a say, in cells.
pub const REACH: f32 = 2.4;

/// The power of the fall-off by which samples say which way the surface looks: how much more the nearest ones count.
const LEADING: i32 = 6;

/// The nodes of a block.
#[derive(Debug, Clone)]
pub struct FieldBlock {
    /// Signed distance in cells: positive outside. Meaningless where `weights` is 0.
    pub values: Box<[f32; NODES]>,
    /// Sum of the weights of the samples around.
    pub weights: Box<[f32; NODES]>,
}

impl FieldBlock {
    fn empty() -> Self {
        FieldBlock { values: Box::new([0.0; NODES]), weights: Box::new([0.0; NODES]) }
    }
}

/// What the grid takes for each block that holds samples (bytes): with those around about three blocks, of which each is kept
/// twice while levels are made.
pub const FIELD_BYTES: u64 = 3 * 2 * (NODES * 2 * size_of::<f32>()) as u64;

/// The field on all blocks that samples reach.
pub type Field = Blocks<FieldBlock>;

/// The field of samples.
pub fn field(samples: &Samples) -> Field {
    let mut keys: Vec<BlockKey> = samples.blocks.keys().iter().flat_map(|key| around(*key)).flatten().collect();
    keys.par_sort_unstable();
    keys.dedup();
    let found: Vec<(BlockKey, Option<FieldBlock>)> =
        keys.into_par_iter().map(|key| (key, block(samples, key))).collect();
    let (keys, values) = found.into_iter().filter_map(|(key, block)| Some((key, block?))).unzip();
    let field = Field::new(keys, values);
    corrected(samples, field)
}

/// The samples that reach a block.
fn near(samples: &Samples, key: BlockKey) -> Vec<u32> {
    let first = first_node(key).map(|x| x as f32);
    let reaches = |index: &u32| {
        (0..3).all(|axis| {
            let at = samples.samples[*index as usize].place[axis] - first[axis];
            at > -REACH && at < EDGE as f32 - 1.0 + REACH
        })
    };
    let ranges = around(key).into_iter().flatten().filter_map(|near| samples.blocks.get(near));
    ranges.flat_map(|range| range.clone()).filter(reaches).collect()
}

/// Calls `visit` with each node of a block that a sample reaches: its place, its offset from the sample, and the squared
/// distance.
#[inline]
fn for_each_reached(first: &[f32; 3], sample: &Sample, mut visit: impl FnMut(usize, [f32; 3], f32)) {
    let at: [f32; 3] = std::array::from_fn(|axis| sample.place[axis] - first[axis]);
    let low = at.map(|x| (x - REACH).ceil().max(0.0) as i32);
    let high = at.map(|x| (x + REACH).floor().min(EDGE as f32 - 1.0) as i32);
    for z in low[2]..=high[2] {
        let dz = z as f32 - at[2];
        for y in low[1]..=high[1] {
            let dy = y as f32 - at[1];
            let rest = dz * dz + dy * dy;
            for x in low[0]..=high[0] {
                let dx = x as f32 - at[0];
                let distance2 = rest + dx * dx;
                if distance2 < REACH * REACH {
                    visit((z << 6 | y << 3 | x) as usize, [dx, dy, dz], distance2);
                }
            }
        }
    }
}

/// The weight of a sample at a squared distance: 1 at its place, smoothly to 0 at [`REACH`].
#[inline]
pub(super) fn falloff(distance2: f32) -> f32 {
    let rest = 1.0 - distance2 * (1.0 / (REACH * REACH));
    let square = rest * rest;
    square * square
}

#[inline]
fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// For each node of a block the way that the surface nearest to it looks (not normalised): of the samples around those next
/// to the node count, and a few that strayed don't outweigh the many beside them.
fn leading_normals(samples: &Samples, first: &[f32; 3], near: &[u32]) -> Box<[[f32; 3]; NODES]> {
    let mut leading = Box::new([[0.0f32; 3]; NODES]);
    for sample in near.iter().map(|index| &samples.samples[*index as usize]) {
        for_each_reached(first, sample, |place, _, distance2| {
            let weight = sample.weight * falloff(distance2).powi(LEADING);
            for axis in 0..3 {
                leading[place][axis] += weight * sample.normal[axis];
            }
        });
    }
    for normal in leading.iter_mut() {
        // far off weights are so small that their squares are 0
        let largest = normal.iter().fold(f32::MIN_POSITIVE, |largest, x| largest.max(x.abs()));
        let scaled = normal.map(|x| x / largest);
        let length = dot(&scaled, &scaled).sqrt().max(f32::MIN_POSITIVE);
        *normal = scaled.map(|x| if length >= 1.0 { x / length } else { 0.0 });
    }
    leading
}

/// The field on a block, `None` if no sample reaches it.
fn block(samples: &Samples, key: BlockKey) -> Option<FieldBlock> {
    let first = first_node(key).map(|x| x as f32);
    let near = near(samples, key);
    if near.is_empty() {
        return None;
    }
    let leading = leading_normals(samples, &first, &near);
    let mut found = FieldBlock::empty();
    for sample in near.iter().map(|index| &samples.samples[*index as usize]) {
        for_each_reached(&first, sample, |place, offset, distance2| {
            let agreement = dot(&sample.normal, &leading[place]);
            if agreement > 0.0 {
                let weight = sample.weight * falloff(distance2) * agreement;
                found.values[place] += weight * dot(&sample.normal, &offset);
                found.weights[place] += weight;
            }
        });
    }
    for (value, weight) in found.values.iter_mut().zip(found.weights.iter()) {
        *value /= weight.max(f32::MIN_POSITIVE);
    }
    Some(found)
}

/// A mean of planes lies inside of what bulges. What it misses at the samples is averaged in the same way and taken off.
fn corrected(samples: &Samples, field: Field) -> Field {
    let missed: Vec<f32> = samples
        .blocks
        .keys()
        .par_iter()
        .zip(&samples.blocks.values)
        .flat_map_iter(|(key, range)| {
            let blocks = around(*key).map(|near| near.and_then(|near| field.get(near)));
            let first = first_node(*key);
            samples.samples[range.start as usize..range.end as usize]
                .iter()
                .map(move |sample| interpolated(&blocks, &first, &sample.place))
        })
        .collect();
    let values: Vec<FieldBlock> =
        field.keys().par_iter().zip(&field.values).map(|(key, block)| correct(samples, &missed, *key, block)).collect();
    Field::new(field.keys().to_vec(), values)
}

fn correct(samples: &Samples, missed: &[f32], key: BlockKey, block: &FieldBlock) -> FieldBlock {
    let first = first_node(key).map(|x| x as f32);
    let near = near(samples, key);
    let leading = leading_normals(samples, &first, &near);
    let mut sums = [0.0f32; NODES];
    for index in near {
        let (sample, missed) = (&samples.samples[index as usize], missed[index as usize]);
        for_each_reached(&first, sample, |place, _, distance2| {
            let agreement = dot(&sample.normal, &leading[place]);
            if agreement > 0.0 {
                sums[place] += sample.weight * falloff(distance2) * agreement * missed;
            }
        });
    }
    let mut corrected = block.clone();
    for ((value, weight), sum) in corrected.values.iter_mut().zip(block.weights.iter()).zip(&sums) {
        *value -= sum / weight.max(f32::MIN_POSITIVE);
    }
    corrected
}

/// The field at a place of the block that begins at `first`, whose surroundings are `blocks`.
fn interpolated(blocks: &[Option<&FieldBlock>; 27], first: &[i32; 3], place: &[f32; 3]) -> f32 {
    let low = place.map(|x| x.floor());
    let mut sum = 0.0;
    for (offset, weight) in corners(&std::array::from_fn(|axis| place[axis] - low[axis])) {
        let local: [i32; 3] = std::array::from_fn(|axis| low[axis] as i32 - first[axis] + offset[axis] as i32);
        let block = local.map(|x| (x >> 3) + 1);
        let at = (local[2] & 7) << 6 | (local[1] & 7) << 3 | (local[0] & 7);
        let value = blocks[(block[2] * 9 + block[1] * 3 + block[0]) as usize].map_or(0.0, |b| b.values[at as usize]);
        sum += weight * value;
    }
    sum
}
