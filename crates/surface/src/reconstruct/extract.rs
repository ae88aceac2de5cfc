//! The surface where the field is zero, as triangles.

use rayon::prelude::*;

use super::cubes::{EDGES, MIDDLE, Pattern, patterns};
use super::field::FieldBlock;
use super::grid::{BlockKey, Blocks, EDGE, NODES, around, block_at, first_node, key, node_at, place_of};
use super::levels::{FAR, Volume};
use super::refine::refine;

/// A surface in cells of the grid.
#[derive(Debug, Clone, Default)]
pub struct Triangles {
    /// Positions.
    pub vertices: Vec<[f32; 3]>,
    /// For each vertex how much data stands for it: the field's weight there.
    pub support: Vec<f32>,
    /// Counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

/// A place with its support and the way that the surface looks there.
type Vertex = ([f32; 3], f32, [f32; 3]);

/// The triangles of a block's cells.
#[derive(Default)]
struct Cut {
    faces: Vec<[u32; 3]>,
    /// The middles of polygons that they need.
    middles: Vec<Vertex>,
    /// The vertices of cells in which sheets are near each other.
    folded: Vec<u32>,
}

/// A vertex is kept at least this far from the nodes of its edge, in cells: no triangle shrinks to nothing.
const LEAST: f32 = 0.03;

/// The surface of a volume, closed if [`close`] was called for it.
pub fn extract(volume: &Volume) -> Triangles {
    let blocks = &volume.blocks;
    let own: Vec<OwnVertices> =
        blocks.keys().par_iter().enumerate().map(|(index, _)| own_vertices(volume, index)).collect();
    let mut first = 0u32;
    let firsts: Vec<u32> = own
        .iter()
        .map(|own| {
            first += own.vertices.len() as u32;
            first - own.vertices.len() as u32
        })
        .collect();
    let patterns = patterns();
    let cut: Vec<Cut> =
        (0..own.len()).into_par_iter().map(|index| triangles(volume, index, &own, &firsts, &patterns)).collect();
    let mut found = Triangles::default();
    let mut normals: Vec<[f32; 3]> = Vec::new();
    for own in &own {
        found.vertices.extend(own.vertices.iter().map(|(place, ..)| *place));
        found.support.extend(own.vertices.iter().map(|(_, support, _)| *support));
        normals.extend(own.vertices.iter().map(|(.., normal)| *normal));
    }
    for Cut { faces, middles, folded } in cut {
        let base = found.vertices.len() as u32;
        found.vertices.extend(middles.iter().map(|(place, ..)| *place));
        found.support.extend(middles.iter().map(|(_, support, _)| *support));
        normals.extend(middles.iter().map(|(.., normal)| *normal));
        // middles are counted from the top
        let named = |v: u32| if v > u32::MAX / 2 { base + (u32::MAX - v) } else { v };
        found.faces.extend(faces.into_iter().map(|face| face.map(named)));
        // finer triangles might cross there
        folded.into_iter().for_each(|v| normals[named(v) as usize] = [0.0; 3]);
    }
    refine(found, &normals)
}

/// Adds blocks until all cells at edges whose ends differ in sign are in one: what the surface passes through beyond the
/// volume's own.
pub fn close(volume: &mut Volume) {
    close_around(volume, volume.blocks.keys().to_vec());
}

/// The same, after nodes changed in these blocks alone.
pub fn close_around(volume: &mut Volume, changed: Vec<BlockKey>) {
    let mut fresh = changed;
    loop {
        let missing: Vec<Vec<BlockKey>> = fresh.par_iter().map(|key| missing_around(volume, *key)).collect();
        let mut missing: Vec<BlockKey> = missing.into_iter().flatten().collect();
        missing.par_sort_unstable();
        missing.dedup();
        if missing.is_empty() {
            return;
        }
        let added: Vec<FieldBlock> = missing
            .par_iter()
            .map(|key| {
                let (first, mut beyond) = (first_node(*key), volume.beyond());
                let values: Vec<f32> = (0..NODES).map(|place| beyond.at(&node_at(&first, place))).collect();
                let mut block = FieldBlock { values: Box::new([0.0; NODES]), weights: Box::new([0.0; NODES]) };
                block.values.copy_from_slice(&values);
                block
            })
            .collect();
        let old = std::mem::replace(&mut volume.blocks, Blocks::new(Vec::new(), Vec::new()));
        let keys = old.keys().to_vec();
        let mut all: Vec<(BlockKey, FieldBlock)> =
            keys.into_iter().zip(old.values).chain(missing.iter().copied().zip(added)).collect();
        all.sort_unstable_by_key(|(key, _)| *key);
        let (keys, values) = all.into_iter().unzip();
        volume.blocks = Blocks::new(keys, values);
        fresh = missing;
    }
}

/// Blocks that aren't there and have a cell at an edge, of this block or beyond its border, whose ends differ in sign.
fn missing_around(volume: &Volume, of: BlockKey) -> Vec<BlockKey> {
    let keys = around(of);
    let blocks = keys.map(|key| key.and_then(|key| volume.blocks.get(key)));
    let is_missing = |slot: usize| keys[slot].is_some() && blocks[slot].is_none();
    if !(0..27).any(is_missing) {
        return Vec::new();
    }
    let (first, mut beyond) = (first_node(of), volume.beyond());
    let mut value = |local: &[i32; 3]| match blocks[slot_of(local)] {
        Some(block) => block.values[place_of(local)],
        None => beyond.at(&std::array::from_fn(|axis| first[axis] + local[axis])),
    };
    let mut missing = Vec::new();
    for place in 0..NODES {
        let node = node_at(&[0; 3], place);
        // all cells at the edges of a node inside are in the block itself
        if node.iter().all(|x| (1..EDGE - 1).contains(x)) {
            continue;
        }
        for axis in 0..3 {
            for direction in [-1, 1] {
                let mut next = node;
                next[axis] += direction;
                // the four cells around the edge, by their first nodes
                let start = if direction < 0 { next } else { node };
                let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                let slots: [usize; 4] = std::array::from_fn(|k| {
                    let mut cell = start;
                    cell[a] -= k as i32 & 1;
                    cell[b] -= k as i32 >> 1;
                    slot_of(&cell)
                });
                if slots.iter().any(|slot| is_missing(*slot)) && (value(&next) < 0.0) != (value(&node) < 0.0) {
                    missing.extend(slots.into_iter().filter(|slot| is_missing(*slot)).filter_map(|slot| keys[slot]));
                }
            }
        }
    }
    missing.sort_unstable();
    missing.dedup();
    missing
}

/// Which of the blocks around a block, in their order, holds a node by its offset from the block's first.
#[inline]
fn slot_of(local: &[i32; 3]) -> usize {
    let at = local.map(|x| (x + EDGE) >> 3);
    (at[2] * 9 + at[1] * 3 + at[0]) as usize
}

/// The vertices on the edges that begin at a block's nodes.
struct OwnVertices {
    vertices: Vec<Vertex>,
    /// For each node and axis the vertex on the edge that begins there.
    on_edge: Box<[u16]>,
}

const NONE: u16 = u16::MAX;

/// The nodes of a block and those one beyond it: values and weights.
struct Halo {
    values: [f32; 729],
    weights: [f32; 729],
}

impl Halo {
    fn of(volume: &Volume, of: BlockKey) -> Halo {
        let at = block_at(of);
        let near: [Option<&FieldBlock>; 8] = std::array::from_fn(|k| {
            let k = k as i32;
            volume.blocks.get(key([at[0] + (k & 1), at[1] + (k >> 1 & 1), at[2] + (k >> 2)]))
        });
        let (first, mut beyond) = (first_node(of), volume.beyond());
        let mut halo = Halo { values: [0.0; 729], weights: [0.0; 729] };
        for z in 0..9i32 {
            for y in 0..9i32 {
                for x in 0..9i32 {
                    let index = halo_index([x, y, z]);
                    let block = (x >> 3) | (y >> 3) << 1 | (z >> 3) << 2;
                    let place = ((z & 7) << 6 | (y & 7) << 3 | (x & 7)) as usize;
                    (halo.values[index], halo.weights[index]) = match near[block as usize] {
                        Some(block) => (block.values[place], block.weights[place]),
                        None => (beyond.at(&[first[0] + x, first[1] + y, first[2] + z]), 0.0),
                    };
                }
            }
        }
        halo
    }
}

#[inline]
fn halo_index(at: [i32; 3]) -> usize {
    (at[2] * 81 + at[1] * 9 + at[0]) as usize
}

fn unit(of: [f32; 3]) -> [f32; 3] {
    let length = of.iter().map(|x| x * x).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    of.map(|x| x / length)
}

/// A block with those around it.
struct Around<'a> {
    near: [Option<&'a FieldBlock>; 27],
}

impl Around<'_> {
    /// The value at a node, by its offset from the block's first, if data is near it.
    #[inline]
    fn known(&self, node: &[i32; 3]) -> Option<f32> {
        let block = self.near[slot_of(node)]?;
        let place = place_of(node);
        (block.weights[place] > 0.0 && block.values[place].abs() < FAR).then(|| block.values[place])
    }

    /// How the field grows at a node, as far as data is near; not normalised.
    fn gradient(&self, node: &[i32; 3]) -> [f32; 3] {
        let own = self.known(node);
        std::array::from_fn(|axis| {
            let beside = |by: i32| {
                let mut at = *node;
                at[axis] += by;
                self.known(&at)
            };
            match (beside(-1), own, beside(1)) {
                (Some(before), _, Some(after)) => (after - before) / 2.0,
                (Some(before), Some(own), None) => own - before,
                (None, Some(own), Some(after)) => after - own,
                _ => 0.0,
            }
        })
    }
}

fn own_vertices(volume: &Volume, index: usize) -> OwnVertices {
    let of = volume.blocks.keys()[index];
    let first = first_node(of);
    let halo = Halo::of(volume, of);
    let around = Around { near: around(of).map(|near| near.and_then(|near| volume.blocks.get(near))) };
    let mut own = OwnVertices { vertices: Vec::new(), on_edge: vec![NONE; 3 * NODES].into_boxed_slice() };
    for place in 0..NODES {
        let node = node_at(&[0; 3], place);
        let from = halo_index(node);
        for axis in 0..3 {
            let mut next = node;
            next[axis] += 1;
            let to = halo_index(next);
            let (a, b) = (halo.values[from], halo.values[to]);
            if (a < 0.0) == (b < 0.0) {
                continue;
            }
            let share = (a / (a - b)).clamp(LEAST, 1.0 - LEAST);
            let (from_gradient, to_gradient) = (around.gradient(&node), around.gradient(&next));
            let normal = unit(std::array::from_fn(|k| (1.0 - share) * from_gradient[k] + share * to_gradient[k]));
            let mut position: [f32; 3] = std::array::from_fn(|k| (first[k] + node[k]) as f32);
            position[axis] += share;
            let support = (1.0 - share) * halo.weights[from] + share * halo.weights[to];
            own.on_edge[3 * place + axis] = own.vertices.len() as u16;
            own.vertices.push((position, support, normal));
        }
    }
    own
}

/// The triangles of a block's cells; a middle of a polygon is named by its number in the list, from the largest u32 down.
fn triangles(volume: &Volume, index: usize, own: &[OwnVertices], firsts: &[u32], patterns: &[Pattern]) -> Cut {
    let of = volume.blocks.keys()[index];
    let at = block_at(of);
    let near: [Option<usize>; 8] = std::array::from_fn(|k| {
        let k = k as i32;
        volume.blocks.index(key([at[0] + (k & 1), at[1] + (k >> 1 & 1), at[2] + (k >> 2)]))
    });
    let halo = Halo::of(volume, of);
    let mut cut = Cut::default();
    for place in 0..NODES {
        let node = node_at(&[0; 3], place);
        let corner = |c: i32| [node[0] + (c & 1), node[1] + (c >> 1 & 1), node[2] + (c >> 2)];
        let inside = (0..8).fold(0usize, |set, c| set | usize::from(halo.values[halo_index(corner(c))] < 0.0) << c);
        if inside == 0 || inside == 255 {
            continue;
        }
        let pattern = &patterns[inside];
        let vertex = |edge: u8| -> Option<(u32, Vertex)> {
            let [a, b] = EDGES[edge as usize];
            let axis = (a ^ b).trailing_zeros() as usize;
            let from = corner(a.into());
            let block = near[((from[0] >> 3) | (from[1] >> 3) << 1 | (from[2] >> 3) << 2) as usize]?;
            let local = own[block].on_edge[3 * place_of(&from) + axis];
            (local != NONE).then(|| (firsts[block] + u32::from(local), own[block].vertices[local as usize]))
        };
        let base = cut.middles.len() as u32;
        for polygon in &pattern.middles {
            let corners: Vec<Vertex> = polygon.iter().filter_map(|edge| Some(vertex(*edge)?.1)).collect();
            let count = corners.len().max(1) as f32;
            let place = std::array::from_fn(|k| corners.iter().map(|(place, ..)| place[k]).sum::<f32>() / count);
            let normal = unit(std::array::from_fn(|k| corners.iter().map(|(.., normal)| normal[k]).sum::<f32>()));
            cut.middles.push((place, corners.iter().map(|(_, support, _)| support).sum::<f32>() / count, normal));
        }
        for triangle in &pattern.triangles {
            let named = triangle.map(|at| match at {
                MIDDLE.. => Some(u32::MAX - base - u32::from(at - MIDDLE)),
                edge => vertex(edge).map(|(name, _)| name),
            });
            if let [Some(a), Some(b), Some(c)] = named {
                cut.faces.push([a, b, c]);
                if pattern.is_folded {
                    cut.folded.extend([a, b, c]);
                }
            }
        }
    }
    cut
}
