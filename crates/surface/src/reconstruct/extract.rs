//! The surface where the field is zero, as triangles.

use rayon::prelude::*;

use super::cubes::{EDGES, MIDDLE, Pattern, patterns};
use super::field::FieldBlock;
use super::grid::{BlockKey, Blocks, NODES, around, block_at, block_of, first_node, key, node_at, place_of};
use super::levels::Volume;

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

/// A place with its support.
type Vertex = ([f32; 3], f32);

/// The triangles of a block's cells, and the middles of polygons that they need.
type Cut = (Vec<[u32; 3]>, Vec<Vertex>);

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
    for own in &own {
        found.vertices.extend(own.vertices.iter().map(|(place, _)| *place));
        found.support.extend(own.vertices.iter().map(|(_, support)| *support));
    }
    for (faces, middles) in cut {
        let base = found.vertices.len() as u32;
        found.vertices.extend(middles.iter().map(|(place, _)| *place));
        found.support.extend(middles.iter().map(|(_, support)| *support));
        // middles are counted from the top
        let named = |v: u32| if v > u32::MAX / 2 { base + (u32::MAX - v) } else { v };
        found.faces.extend(faces.into_iter().map(|face| face.map(named)));
    }
    found
}

/// Adds blocks until all cells at edges whose ends differ in sign are in one: what the surface passes through beyond the
/// volume's own.
pub fn close(volume: &mut Volume) {
    let mut fresh: Vec<BlockKey> = volume.blocks.keys().to_vec();
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
                let first = first_node(*key);
                let values: Vec<f32> = (0..NODES).map(|place| volume.beyond(&node_at(&first, place))).collect();
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
    let near = around(of);
    if near.iter().flatten().all(|key| volume.blocks.index(*key).is_some()) {
        return Vec::new();
    }
    let Some(block) = volume.blocks.get(of) else { return Vec::new() };
    let first = first_node(of);
    let mut missing = Vec::new();
    for place in 0..NODES {
        let node = node_at(&first, place);
        let is_inside = block.values[place] < 0.0;
        for axis in 0..3 {
            for direction in [-1, 1] {
                let mut next = node;
                next[axis] += direction;
                if next[axis] < 0 || (volume.value(&next) < 0.0) == is_inside {
                    continue;
                }
                // the four cells around the edge, by their first nodes
                let start = if direction < 0 { next } else { node };
                let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                for k in 0..4 {
                    let mut cell = start;
                    cell[a] -= k & 1;
                    cell[b] -= k >> 1;
                    if cell.iter().all(|x| *x >= 0) && volume.blocks.index(block_of(&cell)).is_none() {
                        missing.push(block_of(&cell));
                    }
                }
            }
        }
    }
    missing.sort_unstable();
    missing.dedup();
    missing
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
        let first = first_node(of);
        let mut halo = Halo { values: [0.0; 729], weights: [0.0; 729] };
        for z in 0..9i32 {
            for y in 0..9i32 {
                for x in 0..9i32 {
                    let index = halo_index([x, y, z]);
                    let block = (x >> 3) | (y >> 3) << 1 | (z >> 3) << 2;
                    let place = ((z & 7) << 6 | (y & 7) << 3 | (x & 7)) as usize;
                    (halo.values[index], halo.weights[index]) = match near[block as usize] {
                        Some(block) => (block.values[place], block.weights[place]),
                        None => (volume.beyond(&[first[0] + x, first[1] + y, first[2] + z]), 0.0),
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

fn own_vertices(volume: &Volume, index: usize) -> OwnVertices {
    let of = volume.blocks.keys()[index];
    let first = first_node(of);
    let halo = Halo::of(volume, of);
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
            let mut position: [f32; 3] = std::array::from_fn(|k| (first[k] + node[k]) as f32);
            position[axis] += share;
            let support = (1.0 - share) * halo.weights[from] + share * halo.weights[to];
            own.on_edge[3 * place + axis] = own.vertices.len() as u16;
            own.vertices.push((position, support));
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
    let (mut faces, mut middles) = (Vec::new(), Vec::new());
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
        let base = middles.len() as u32;
        for polygon in &pattern.middles {
            let corners: Vec<Vertex> = polygon.iter().filter_map(|edge| Some(vertex(*edge)?.1)).collect();
            let count = corners.len().max(1) as f32;
            let place = std::array::from_fn(|k| corners.iter().map(|(place, _)| place[k]).sum::<f32>() / count);
            middles.push((place, corners.iter().map(|(_, support)| support).sum::<f32>() / count));
        }
        for triangle in &pattern.triangles {
            let named = triangle.map(|at| match at {
                MIDDLE.. => Some(u32::MAX - base - u32::from(at - MIDDLE)),
                edge => vertex(edge).map(|(name, _)| name),
            });
            if let [Some(a), Some(b), Some(c)] = named {
                faces.push([a, b, c]);
            }
        }
    }
    (faces, middles)
}
