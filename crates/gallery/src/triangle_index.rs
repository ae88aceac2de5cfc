//! The triangles of many models as points of Kendall's sphere in one static tree, searched exactly.
//!
//! Twelve bytes a triangle: its place on the sphere to 1.5e-5, and whose it is. The tree is balanced and lies in two
//! flat arrays. A search meets every triangle that may lie within its reach: distances are bounded from below by what
//! rounding may have moved a point ([`SLACK`]), so whoever measures those it meets from their corners gets exactly
//! what measuring all would give.

use bytemuck::{Pod, Zeroable};

use super::column::Column;
use super::columns::stored;
use visage_shape::faces::Shape;

/// Steps of the grid that places are rounded to, along one axis of the sphere of radius 1/2.
const STEPS: f64 = 65_534.0;
/// How far rounding may move a point, in steps: half the diagonal of a cell, and a little for the arithmetic.
const SLACK: f64 = 0.87;
/// A leaf holds at most this many triangles.
const LEAF: usize = 32;
/// From this many on, both halves are built at the same time.
const SHARED: usize = 1 << 16;

type Place = [i16; 3];

/// A triangle by its rounded place on the sphere.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Entry {
    place: Place,
    number: u16,
    model: u32,
}

/// The corners of the box around a node's triangles.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Cell {
    low: Place,
    high: Place,
}

/// The triangles of a fixed list of models. A model is known here by its place in that list, a triangle by its
/// number among its model's.
#[derive(Debug, Default)]
pub struct TriangleIndex {
    /// Leaf by leaf.
    entries: Column<Entry>,
    /// A node, all below its first half, all below its second half; the halves are those of the entries.
    cells: Column<Cell>,
    /// Levels below the root.
    depth: u32,
}

stored!(TriangleIndex { entries, cells, depth });

impl TriangleIndex {
    /// An index over triangles, each given by model, number and shape. Runs inside the caller's rayon pool.
    pub fn build(triangles: impl Iterator<Item = (u32, u16, Shape)>) -> TriangleIndex {
        let entry = |(model, number, shape): (u32, u16, Shape)| Entry {
            place: shape.coordinates().map(|x| (x * STEPS).round() as i16),
            number,
            model,
        };
        let mut entries: Vec<Entry> = triangles.map(entry).collect();
        entries.shrink_to_fit();
        let leaves = entries.len().div_ceil(LEAF).next_power_of_two();
        let mut cells = vec![Cell { low: [0; 3], high: [0; 3] }; 2 * leaves - 1];
        let depth = leaves.trailing_zeros();
        split(&mut entries, &mut cells, depth);
        TriangleIndex { entries: entries.into(), cells: cells.into(), depth }
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether the tree has as many nodes as levels.
    pub(super) fn is_sound(&self) -> bool {
        let leaves = 1usize.checked_shl(self.depth).filter(|_| self.depth < u32::BITS);
        leaves.is_some_and(|leaves| self.cells.len() == 2 * leaves - 1)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Meets every triangle that may lie within `reach` (a chord, the bound included) of `shape`, near ones rather
    /// early. `meet` is told the model and the triangle's number and returns the reach from then on, which may only shrink.
    pub fn visit(&self, shape: &Shape, reach: f64, meet: &mut impl FnMut(u32, u16) -> f64) {
        if !self.is_empty() {
            let mut visit = Visit { query: shape.coordinates().map(|x| x * STEPS), limit2: limit2(reach), meet };
            visit.node(&self.entries, &self.cells, self.depth);
        }
    }
}

/// Orders the entries so that each half of each half lies together, and boxes them.
fn split(entries: &mut [Entry], cells: &mut [Cell], depth: u32) {
    let Some((cell, below)) = cells.split_first_mut() else { return };
    *cell = around(entries);
    if depth == 0 {
        return;
    }
    let widest = (0..3).max_by_key(|&axis| i32::from(cell.high[axis]) - i32::from(cell.low[axis])).unwrap_or(0);
    let middle = entries.len() / 2;
    if middle > 0 {
        entries.select_nth_unstable_by_key(middle, |entry| entry.place[widest]);
    }
    let many = entries.len() >= SHARED;
    let (low, high) = entries.split_at_mut(middle);
    let (low_cells, high_cells) = below.split_at_mut(below.len() / 2);
    if many {
        rayon::join(|| split(low, low_cells, depth - 1), || split(high, high_cells, depth - 1));
    } else {
        split(low, low_cells, depth - 1);
        split(high, high_cells, depth - 1);
    }
}

/// An empty box is inside out: nothing is near it.
fn around(entries: &[Entry]) -> Cell {
    let empty = Cell { low: [i16::MAX; 3], high: [i16::MIN; 3] };
    entries.iter().fold(empty, |cell, entry| Cell {
        low: std::array::from_fn(|axis| cell.low[axis].min(entry.place[axis])),
        high: std::array::from_fn(|axis| cell.high[axis].max(entry.place[axis])),
    })
}

/// The square of the greatest rounded distance, in steps, that a triangle within reach may have.
fn limit2(reach: f64) -> f64 {
    (reach * STEPS + SLACK).powi(2)
}

struct Visit<'a, M> {
    query: [f64; 3],
    limit2: f64,
    meet: &'a mut M,
}

impl<M: FnMut(u32, u16) -> f64> Visit<'_, M> {
    fn node(&mut self, entries: &[Entry], cells: &[Cell], depth: u32) {
        if depth == 0 {
            return self.leaf(entries);
        }
        let (low, high) = entries.split_at(entries.len() / 2);
        let (low_cells, high_cells) = cells[1..].split_at(cells.len() / 2);
        let mut halves = [(low, low_cells), (high, high_cells)].map(|(e, c)| (self.least2(&c[0]), e, c));
        if halves[1].0 < halves[0].0 {
            halves.swap(0, 1);
        }
        for (least2, entries, cells) in halves {
            if least2 <= self.limit2 && !entries.is_empty() {
                self.node(entries, cells, depth - 1);
            }
        }
    }

    fn leaf(&mut self, entries: &[Entry]) {
        for entry in entries {
            let distance2: f64 =
                entry.place.iter().zip(&self.query).map(|(place, query)| (f64::from(*place) - query).powi(2)).sum();
            if distance2 <= self.limit2 {
                self.limit2 = limit2((self.meet)(entry.model, entry.number));
            }
        }
    }

    /// The square of the least distance to a box, in steps.
    fn least2(&self, cell: &Cell) -> f64 {
        let outside = |axis: usize| {
            let query = self.query[axis];
            (f64::from(cell.low[axis]) - query).max(query - f64::from(cell.high[axis])).max(0.0)
        };
        (0..3).map(|axis| outside(axis).powi(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use visage_geometry::Vector3;

    fn shape(x: f64, y: f64, z: f64) -> Shape {
        let direction = Vector3::new(x, y, z.abs()).try_normalize(1e-9).unwrap_or_else(Vector3::z);
        Shape(direction * 0.5)
    }

    /// Every triangle that a search with a fixed reach meets.
    fn met(index: &TriangleIndex, query: &Shape, reach: f64) -> Vec<(u32, u16)> {
        let mut met = Vec::new();
        index.visit(query, reach, &mut |model, number| {
            met.push((model, number));
            reach
        });
        met.sort_unstable();
        met
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn all_within_reach_are_met_and_few_others(
            points in prop::collection::vec((-1.0..1.0, -1.0..1.0, 0.0..1.0), 0..400),
            copies in 1usize..4, reach in 0.0..0.3f64,
        ) {
            let shapes: Vec<Shape> = points.iter().cycle().take(points.len() * copies).map(|p| shape(p.0, p.1, p.2)).collect();
            let index = TriangleIndex::build(shapes.iter().enumerate().map(|(k, s)| (k as u32 / 7, k as u16 % 7, *s)));
            prop_assert_eq!(index.len(), shapes.len());
            for query in [shape(0.3, -0.2, 0.5), shape(-1.0, 0.1, 0.0), shapes.first().copied().unwrap_or(shape(1.0, 0.0, 0.0))] {
                let near = |most: f64| -> Vec<(u32, u16)> {
                    let near = (0..shapes.len()).filter(|&k| shapes[k].chord(&query) <= most);
                    near.map(|k| (k as u32 / 7, k as u16 % 7)).collect()
                };
                let met = met(&index, &query, reach);
                prop_assert!(near(reach).iter().all(|hit| met.binary_search(hit).is_ok()));
                let nearly = near(reach + 3e-5);
                prop_assert!(met.iter().all(|hit| nearly.binary_search(hit).is_ok()));
            }
        }
    }

    #[test]
    fn a_shrinking_reach_meets_fewer() {
        let shapes: Vec<Shape> =
            (0..5000).map(|k| shape(f64::from(k).sin(), (1.7 * f64::from(k)).cos(), 0.4)).collect();
        let index = TriangleIndex::build(shapes.iter().enumerate().map(|(k, s)| (k as u32, 0, *s)));
        let query = shape(0.2, 0.1, 0.4);
        let (mut nearest, mut meetings) = (f64::INFINITY, 0);
        index.visit(&query, nearest, &mut |model, _| {
            meetings += 1;
            nearest = shapes[model as usize].chord(&query).min(nearest);
            nearest
        });
        let brute = shapes.iter().map(|s| s.chord(&query)).fold(f64::INFINITY, f64::min);
        assert_eq!(nearest, brute);
        assert!(meetings < 500, "{meetings}");
    }

    #[test]
    fn an_empty_index_finds_nothing() {
        let index = TriangleIndex::build(std::iter::empty());
        assert!(index.is_empty() && met(&index, &shape(0.0, 0.0, 1.0), 1.0).is_empty());
    }
}
