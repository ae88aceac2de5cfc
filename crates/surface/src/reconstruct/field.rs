//! The signed distance near the data: the mean of the planes of the samples around, as far as they look the same way.
//!
//! Implicit moving least squares (Kolluri, "Provably good moving least squares", SODA 2005) on the nodes of a sparse grid. Of
//! thin walls each side is left to its own samples: what looks the other way than the sample nearest to a node has no
//! say there.

use rayon::prelude::*;

use super::grid::{BlockKey, Blocks, EDGE, NODES, around, corners, first_node};
use super::samples::{Sample, Samples};

/// How far a sample has a say, in cells.
pub const REACH: f32 = 2.6;

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
    let found: Vec<Option<(BlockKey, (FieldBlock, PackedLeading))>> =
        keys.into_par_iter().map(|key| Some((key, block(samples, key)?))).collect();
    let (keys, values): (Vec<BlockKey>, (Vec<FieldBlock>, Vec<PackedLeading>)) = found.into_iter().flatten().unzip();
    let (blocks, leading) = values;
    let mut field = Field::new(keys, blocks);
    correct(samples, &mut field, &leading);
    field
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

/// Nodes that are computed at once, beside each other along x: what a vector of the processor holds.
const LANES: usize = 4;

/// Calls `visit` for the nodes of a block that a sample reaches, [`LANES`] at a time: the place of the first, the offsets from
/// the sample along x of all, those along y and z, and the squared distances. Some may be out of reach.
#[inline]
fn for_each_reached(
    first: &[f32; 3],
    sample: &Sample,
    mut visit: impl FnMut(usize, [f32; LANES], [f32; 2], [f32; LANES]),
) {
    let at: [f32; 3] = std::array::from_fn(|axis| sample.place[axis] - first[axis]);
    // one more at either end does no harm: it weighs nothing
    let within =
        at.map(|at| ((at - REACH).max(0.0) as i32 as usize, ((at + REACH + 1.0).max(0.0) as i32).min(EDGE) as usize));
    let [(left, right), (front, back), (bottom, top)] = within;
    for z in bottom..top {
        let dz = z as f32 - at[2];
        for y in front..back {
            let dy = y as f32 - at[1];
            let rest = dz * dz + dy * dy;
            if rest >= REACH * REACH {
                continue;
            }
            for x in (left / LANES * LANES..right).step_by(LANES) {
                let dx: [f32; LANES] = std::array::from_fn(|k| (x + k) as f32 - at[0]);
                visit(z << 6 | y << 3 | x, dx, [dy, dz], dx.map(|dx| rest + dx * dx));
            }
        }
    }
}

/// The weight of a sample at a squared distance: 1 at its place, smoothly to 0 at [`REACH`].
#[inline]
pub(super) fn falloff(distance2: f32) -> f32 {
    let rest = (1.0 - distance2 * (1.0 / (REACH * REACH))).max(0.0);
    let square = rest * rest;
    square * square
}

#[inline]
fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// For each node of a block the way that the surface nearest to it looks, by axes: of the samples around those next to the
/// node count, and a few that strayed don't outweigh the many beside them.
struct Leading(Box<[[f32; NODES]; 3]>);

/// The same in little memory, in steps of 1 / [`STEPS`].
struct PackedLeading(Box<[[i16; NODES]; 3]>);

const STEPS: f32 = 32767.0;

impl Leading {
    fn of(samples: &Samples, first: &[f32; 3], near: &[u32]) -> PackedLeading {
        let mut sums = Box::new([[0.0f32; NODES]; 3]);
        for sample in near.iter().map(|index| &samples.samples[*index as usize]) {
            for_each_reached(first, sample, |place, _, _, distance2| {
                let weights = distance2.map(|distance2| sample.weight * falloff(distance2).powi(LEADING));
                for (sums, normal) in sums.iter_mut().zip(sample.normal) {
                    add(sums, place, &weights.map(|weight| weight * normal));
                }
            });
        }
        let mut packed = Box::new([[0i16; NODES]; 3]);
        for place in 0..NODES {
            let sum = [sums[0][place], sums[1][place], sums[2][place]];
            // far off weights are so small that their squares are 0
            let largest = sum.iter().fold(f32::MIN_POSITIVE, |largest, x| largest.max(x.abs()));
            let scaled = sum.map(|x| x / largest);
            let length = dot(&scaled, &scaled).sqrt();
            for axis in 0..3 {
                packed[axis][place] = if length >= 1.0 { (STEPS * scaled[axis] / length).round() as i16 } else { 0 };
            }
        }
        PackedLeading(packed)
    }

    /// How far a normal looks the same way as the surface at nodes: their cosines, at least 0.
    #[inline]
    fn agreement(&self, place: usize, normal: &[f32; 3]) -> [f32; LANES] {
        let [x, y, z] = &*self.0;
        let [x, y, z] = [lanes(x, place), lanes(y, place), lanes(z, place)];
        std::array::from_fn(|k| (normal[0] * x[k] + normal[1] * y[k] + normal[2] * z[k]).max(0.0))
    }
}

impl PackedLeading {
    fn unpacked(&self) -> Leading {
        let mut found = Box::new([[0.0f32; NODES]; 3]);
        for (to, from) in found.iter_mut().flatten().zip(self.0.iter().flatten()) {
            *to = f32::from(*from) / STEPS;
        }
        Leading(found)
    }
}

#[inline]
fn lanes(of: &[f32; NODES], place: usize) -> [f32; LANES] {
    std::array::from_fn(|k| of[(place + k) % NODES])
}

#[inline]
fn add(to: &mut [f32; NODES], place: usize, values: &[f32; LANES]) {
    to[place..place + LANES].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

/// The field on a block, `None` if no sample reaches it.
fn block(samples: &Samples, key: BlockKey) -> Option<(FieldBlock, PackedLeading)> {
    let first = first_node(key).map(|x| x as f32);
    let near = near(samples, key);
    if near.is_empty() {
        return None;
    }
    let packed = Leading::of(samples, &first, &near);
    let leading = packed.unpacked();
    let mut found = FieldBlock::empty();
    for sample in near.iter().map(|index| &samples.samples[*index as usize]) {
        for_each_reached(&first, sample, |place, dx, [dy, dz], distance2| {
            let agreement = leading.agreement(place, &sample.normal);
            let across = sample.normal[1] * dy + sample.normal[2] * dz;
            let weights: [f32; LANES] = std::array::from_fn(|k| sample.weight * falloff(distance2[k]) * agreement[k]);
            add(&mut found.values, place, &std::array::from_fn(|k| weights[k] * (sample.normal[0] * dx[k] + across)));
            add(&mut found.weights, place, &weights);
        });
    }
    for (value, weight) in found.values.iter_mut().zip(found.weights.iter()) {
        *value /= weight.max(f32::MIN_POSITIVE);
    }
    Some((found, packed))
}

/// A mean of planes lies inside of what bulges. What it misses at the samples is averaged in the same way and taken off.
fn correct(samples: &Samples, field: &mut Field, leading: &[PackedLeading]) {
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
    let keys = field.keys().to_vec();
    keys.par_iter()
        .zip(&mut field.values)
        .zip(leading)
        .for_each(|((key, block), leading)| correct_block(samples, &missed, *key, &leading.unpacked(), block));
}

fn correct_block(samples: &Samples, missed: &[f32], key: BlockKey, leading: &Leading, block: &mut FieldBlock) {
    let first = first_node(key).map(|x| x as f32);
    let mut sums = [0.0f32; NODES];
    for index in near(samples, key) {
        let (sample, missed) = (&samples.samples[index as usize], missed[index as usize]);
        for_each_reached(&first, sample, |place, _, _, distance2| {
            let agreement = leading.agreement(place, &sample.normal);
            let weight = sample.weight * missed;
            add(&mut sums, place, &std::array::from_fn(|k| weight * falloff(distance2[k]) * agreement[k]));
        });
    }
    for ((value, weight), sum) in block.values.iter_mut().zip(block.weights.iter()).zip(&sums) {
        *value -= sum / weight.max(f32::MIN_POSITIVE);
    }
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
