//! Points far from the rest: specks in the air, bits of other things.
//!
//! Most of a scan needs no search: in the cells of a coarse grid that hold as many points as a large piece has, and in
//! those about them, nothing is far from anything. What lies elsewhere is looked at piece by piece.

use super::coarse_scan::CoarseScan;
use crate::neighbours::{IndexedPoints, LocalPoint, distance2};

/// Surfels within this many edges of each other hang together.
const LINK: f64 = 3.0;
/// A piece with this share of the points is no stray, however far off.
const PIECE: f64 = 0.002;
/// Nor is one that lies near the large pieces, since part of the object may be hidden between: speck by speck within the
/// first share of their extent, and almost as large as a piece within both together.
const NEAR: [f64; 2] = [0.1, 0.15];
/// A surfel with less than this share of the typical number of points about it holds nothing together.
const SPARSE: f64 = 0.12;
/// Points belong to the body within this many edges of its surfels,
const WITHIN: f64 = 2.0;
/// and within this share of its extent.
const BESIDE: f64 = 0.05;

/// Edge of the grid's cells, in the extent of the bulk of the points: two cells side by side reach no farther than
/// [`NEAR`]. At least an edge of a surfel.
const CELL: f64 = 0.028;
/// A cell holds the object together if it has this many times the points of a surfel, and those of a large piece.
const AMPLE: f64 = 1.5;
/// The bulk is without this share of the surfels at each end of each axis.
const ENDS: f64 = 0.02;
/// The grid goes beyond the bulk by this share of its extent.
const MARGIN: f64 = 0.25;

/// What is left of a scan without outliers.
pub struct Body {
    grid: Grid,
    indexed: IndexedPoints,
    within2: f32,
}

impl Body {
    /// Whether a point belongs to it.
    pub fn reaches(&self, point: &LocalPoint) -> bool {
        self.grid.is_sheltered(point) || self.indexed.tree.nearest(point, self.within2).is_some()
    }
}

/// The surfels of `rest` without outliers; `None` if there are none.
pub fn main_body(coarse: &CoarseScan, rest: &[usize]) -> Option<Body> {
    let total: f64 = rest.iter().map(|surfel| f64::from(coarse.counts[*surfel])).sum();
    let grid = Grid::new(coarse, rest, (PIECE * total).max(AMPLE * total / rest.len() as f64))?;
    let (mut body, suspects): (Vec<usize>, Vec<usize>) =
        rest.iter().partition(|surfel| grid.is_sheltered(&coarse.points[**surfel]));
    if suspects.is_empty() {
        return None;
    }
    let at = |surfels: &[usize]| -> Vec<LocalPoint> { surfels.iter().map(|k| coarse.points[*k]).collect() };
    let count = |piece: &[usize]| piece.iter().map(|k| f64::from(coarse.counts[*k])).sum::<f64>();
    let pieces = pieces(coarse, rest, &suspects);
    let (large, small): (Vec<_>, Vec<_>) = pieces.into_iter().partition(|piece| count(piece) >= PIECE * total);
    body.extend(large.into_iter().flatten());
    let trunk = IndexedPoints::new(at(&body));
    let extent = extent(&trunk.points);
    let is_near = |piece: &Vec<usize>| {
        let share = count(piece) / (PIECE * total);
        let near = ((NEAR[0] + NEAR[1] * share) * extent).max(LINK * coarse.edge);
        piece.iter().any(|k| trunk.tree.nearest(&coarse.points[*k], (near * near) as f32).is_some())
    };
    body.extend(small.into_iter().filter(is_near).flatten());
    let within = (WITHIN * coarse.edge).max(BESIDE * extent);
    let body = Body { grid, indexed: IndexedPoints::new(at(&body)), within2: within.powi(2) as f32 };
    (!suspects.iter().all(|surfel| body.reaches(&coarse.points[*surfel]))).then_some(body)
}

/// Sets of the `suspects` that hang together.
fn pieces(coarse: &CoarseScan, rest: &[usize], suspects: &[usize]) -> Vec<Vec<usize>> {
    let indexed = IndexedPoints::new(rest.iter().map(|surfel| coarse.points[*surfel]).collect());
    let reach2 = (1.5 * coarse.edge).powi(2) as f32;
    let around = |surfel: &usize| {
        let mut count = 0;
        indexed
            .tree
            .for_each_within(&coarse.points[*surfel], reach2, |n| count += coarse.counts[rest[n.index as usize]]);
        f64::from(count)
    };
    let mut sampled: Vec<f64> = rest.iter().step_by(rest.len().div_ceil(TYPICAL_OF)).map(around).collect();
    let middle = sampled.len() / 2;
    let typical = *sampled.select_nth_unstable_by(middle, f64::total_cmp).1;
    let mut waiting: Vec<usize> = suspects.iter().copied().filter(|k| around(k) >= SPARSE * typical).collect();
    let link2 = (LINK * coarse.edge).powi(2) as f32;
    let mut pieces = Vec::new();
    while let Some(first) = waiting.pop() {
        let mut piece = vec![first];
        let mut next = 0;
        while let Some(surfel) = piece.get(next).copied() {
            next += 1;
            let is_linked = |k: &mut usize| distance2(&coarse.points[*k], &coarse.points[surfel]) < link2;
            piece.extend(waiting.extract_if(.., is_linked));
        }
        pieces.push(piece);
    }
    pieces
}

/// Surfels that tell what is typical.
const TYPICAL_OF: usize = 250;

/// The diagonal of the box around the points.
fn extent(points: &[LocalPoint]) -> f64 {
    let side = |axis: usize| {
        let (least, most) = points.iter().fold((f32::MAX, f32::MIN), |(l, m), p| (l.min(p[axis]), m.max(p[axis])));
        most - least
    };
    f64::from(side(0).hypot(side(1)).hypot(side(2)))
}

/// A coarse grid over the bulk of a scan.
struct Grid {
    corner: LocalPoint,
    edge: f32,
    cells: [usize; 3],
    /// For each cell whether it or one about it is heavy.
    sheltered: Vec<bool>,
}

impl Grid {
    /// Over the surfels of `rest`; a cell of so many points is `heavy`. `None` if they have no extent.
    fn new(coarse: &CoarseScan, rest: &[usize], heavy: f64) -> Option<Self> {
        let ends = [0, 1, 2].map(|axis| {
            let mut along: Vec<f32> = rest.iter().map(|surfel| coarse.points[*surfel][axis]).collect();
            let end = (ENDS * along.len() as f64) as usize;
            let last = along.len().checked_sub(1 + end)?;
            let low = *along.select_nth_unstable_by(end, f32::total_cmp).1;
            Some((low, *along.select_nth_unstable_by(last, f32::total_cmp).1))
        });
        let [Some(x), Some(y), Some(z)] = ends else { return None };
        let ends = [x, y, z];
        let extent = ends.iter().map(|(low, high)| (high - low).powi(2)).sum::<f32>().sqrt();
        if extent <= 0.0 {
            return None;
        }
        let (edge, margin) = ((CELL as f32 * extent).max(coarse.edge as f32), MARGIN as f32 * extent);
        let corner = ends.map(|(low, _)| low - margin);
        let cells = ends.map(|(low, high)| ((high - low + 2.0 * margin) / edge).ceil() as usize);
        let mut grid = Grid { corner, edge, cells, sheltered: vec![false; cells[0] * cells[1] * cells[2]] };
        grid.shelter(coarse, rest, heavy);
        Some(grid)
    }

    fn shelter(&mut self, coarse: &CoarseScan, rest: &[usize], heavy: f64) {
        let mut counts = vec![0u32; self.sheltered.len()];
        let cell_of = |surfel: &usize| self.cell(&coarse.points[*surfel]).map(|cell| self.place(cell));
        for surfel in rest {
            if let Some(place) = cell_of(surfel) {
                counts[place] += coarse.counts[*surfel];
            }
        }
        let about = |k: usize, cells: usize| k.saturating_sub(1)..(k + 2).min(cells);
        for (place, _) in counts.iter().enumerate().filter(|(_, count)| f64::from(**count) >= heavy) {
            let [nx, ny, nz] = self.cells;
            let (x, y, z) = (place % nx, place / nx % ny, place / (nx * ny));
            for z in about(z, nz) {
                for y in about(y, ny) {
                    let row = self.place([0, y, z]);
                    about(x, nx).for_each(|x| self.sheltered[row + x] = true);
                }
            }
        }
    }

    fn cell(&self, point: &LocalPoint) -> Option<[usize; 3]> {
        let cell = [0, 1, 2].map(|axis| (point[axis] - self.corner[axis]) / self.edge);
        let is_inside = (0..3).all(|axis| cell[axis] >= 0.0 && cell[axis] < self.cells[axis] as f32);
        is_inside.then(|| cell.map(|k| k as usize))
    }

    fn place(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.cells[0] * (y + self.cells[1] * z)
    }

    fn is_sheltered(&self, point: &LocalPoint) -> bool {
        self.cell(point).is_some_and(|cell| self.sheltered[self.place(cell)])
    }
}
