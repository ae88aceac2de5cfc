//! Points sorted into cubic cells: all neighbours within a radius, quickly and always in the same order.

use std::ops::Range;

use visage_geometry::{Bounds, Point3};

/// A dense grid of cells over the bounding box; the points of a cell lie side by side.
///
/// Made for many queries with one radius over points spread on a surface, where it beats a tree: a query
/// walks nine contiguous runs. The number of cells never exceeds a small multiple of the number of points.
#[derive(Debug, Clone)]
pub struct CellGrid {
    origin: Point3,
    per_length: f64,
    dims: [usize; 3],
    /// For each cell, where its run begins in `order`; one more entry at the end.
    starts: Vec<u32>,
    /// Indices of points, cell by cell, ascending within a cell.
    order: Vec<u32>,
    /// The positions in the order of `order`: all x, all y, all z.
    sorted: [Vec<f64>; 3],
}

/// So many near points wait before they are visited together.
const WAITING: usize = 32;

impl CellGrid {
    /// Sorts `points` into cells with an edge of `cell` (larger if the box would need too many of them).
    pub fn new(points: &[Point3], cell: f64) -> CellGrid {
        let bounds = Bounds::of(points).unwrap_or(Bounds { min: Point3::origin(), max: Point3::origin() });
        let extent = bounds.max - bounds.min;
        let most_cells = 8.0 * points.len() as f64 + 4096.0;
        let mut cell = if cell.is_finite() && cell > 0.0 { cell } else { 1.0 };
        // an extent that is no number, or beyond all of them, is one cell
        let along = |axis: usize, cell: f64| match (extent[axis] / cell).floor() {
            cells if cells.is_finite() => cells + 1.0,
            _ => 1.0,
        };
        let count_of = |cell: f64| (0..3).map(|axis| along(axis, cell)).product::<f64>();
        while count_of(cell) > most_cells {
            cell *= 1.26;
        }
        let dims = [0, 1, 2].map(|axis| along(axis, cell) as usize);
        let mut grid = CellGrid {
            origin: bounds.min,
            per_length: 1.0 / cell,
            dims,
            starts: vec![0; dims.iter().product::<usize>() + 1],
            order: vec![0; points.len()],
            sorted: [0, 1, 2].map(|_| Vec::with_capacity(points.len())),
        };
        grid.fill(points);
        grid
    }

    /// Counting sort: stable, so indices ascend within a cell.
    fn fill(&mut self, points: &[Point3]) {
        let cells: Vec<usize> = points.iter().map(|p| self.cell_index(self.cell_of(p))).collect();
        for &cell in &cells {
            self.starts[cell + 1] += 1;
        }
        for cell in 1..self.starts.len() {
            self.starts[cell] += self.starts[cell - 1];
        }
        let mut next = self.starts.clone();
        for (point, &cell) in cells.iter().enumerate() {
            self.order[next[cell] as usize] = point as u32;
            next[cell] += 1;
        }
        for (axis, sorted) in self.sorted.iter_mut().enumerate() {
            sorted.extend(self.order.iter().map(|&i| points[i as usize][axis]));
        }
    }

    /// The squared distances of the points of a run.
    #[inline(always)]
    fn distances2(&self, run: Range<usize>, center: &Point3) -> impl Iterator<Item = f64> {
        let [x, y, z] = self.sorted.each_ref().map(|sorted| &sorted[run.clone()]);
        let from = *center;
        x.iter().zip(y).zip(z).map(move |((x, y), z)| {
            let [x, y, z] = [x - from.x, y - from.y, z - from.z];
            x * x + y * y + z * z
        })
    }

    #[inline(always)]
    fn axis_cell(&self, axis: usize, coordinate: f64) -> usize {
        // the conversion cuts the fraction off; what lies before the first cell counts as in it
        let cell = (coordinate - self.origin[axis]) * self.per_length;
        (cell.max(0.0) as usize).min(self.dims[axis] - 1)
    }

    fn cell_of(&self, point: &Point3) -> [usize; 3] {
        [self.axis_cell(0, point.x), self.axis_cell(1, point.y), self.axis_cell(2, point.z)]
    }

    /// The first and last cell along each axis that a ball's box reaches.
    #[inline(always)]
    fn cells_around(&self, center: &Point3, radius: f64) -> ([usize; 3], [usize; 3]) {
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            low[axis] = self.axis_cell(axis, center[axis] - radius);
            high[axis] = self.axis_cell(axis, center[axis] + radius);
        }
        (low, high)
    }

    fn cell_index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// The rows of cells that a ball's box reaches, each as a range of `sorted` and `order`.
    #[inline(always)]
    fn runs(&self, center: &Point3, radius: f64) -> impl Iterator<Item = Range<usize>> {
        let (low, high) = self.cells_around(center, radius);
        let rows = (low[2]..=high[2]).flat_map(move |z| (low[1]..=high[1]).map(move |y| (y, z)));
        rows.map(move |(y, z)| self.run(low[0], high[0], y, z))
    }

    /// The points of the cells from `first` to `last` of a row, as a range of `sorted` and `order`.
    #[inline(always)]
    fn run(&self, first: usize, last: usize, y: usize, z: usize) -> Range<usize> {
        let start = self.starts[self.cell_index([first, y, z])] as usize;
        start..self.starts[self.cell_index([last, y, z]) + 1] as usize
    }

    /// Calls `visit(index, squared distance)` for every point nearer to `center` than `radius`.
    pub fn for_each_within(&self, center: &Point3, radius: f64, mut visit: impl FnMut(usize, f64)) {
        let radius2 = radius * radius;
        let mut near = [(0, 0.0); 2 * WAITING];
        let mut distances2 = [0.0; WAITING];
        let mut count = 0;
        for run in self.runs(center, radius) {
            for start in run.clone().step_by(WAITING) {
                let part = start..run.end.min(start + WAITING);
                distances2.iter_mut().zip(self.distances2(part.clone(), center)).for_each(|(slot, d)| *slot = d);
                // whether a point is near can't be foretold, so nothing branches on it: one that isn't is written over
                for (&distance2, &index) in distances2.iter().zip(&self.order[part]) {
                    near[count] = (index, distance2);
                    count += usize::from(distance2 < radius2);
                }
                if count >= WAITING {
                    near[..count].iter().for_each(|&(index, distance2)| visit(index as usize, distance2));
                    count = 0;
                }
            }
        }
        near[..count].iter().for_each(|&(index, distance2)| visit(index as usize, distance2));
    }

    /// Whether `accept(index)` holds for a point nearer to `center` than `radius`; asks no further than the first.
    pub fn any_within(&self, center: &Point3, radius: f64, accept: impl Fn(usize) -> bool) -> bool {
        let radius2 = radius * radius;
        let holds = |run: Range<usize>| {
            let mut points = self.distances2(run.clone(), center).zip(&self.order[run]);
            points.any(|(distance2, &index)| distance2 < radius2 && accept(index as usize))
        };
        // mostly it holds for one close by
        let (low, high) = self.cells_around(center, radius);
        let [_, y, z] = self.cell_of(center);
        holds(self.run(low[0], high[0], y, z)) || self.runs(center, radius).any(holds)
    }

    /// The nearest of the points that `accept(index)` takes and that lie nearer to `center` than `radius`, with its
    /// squared distance; ties by the order of visiting, which is always the same.
    pub fn nearest_where(&self, center: &Point3, radius: f64, accept: impl Fn(usize) -> bool) -> Option<(usize, f64)> {
        // mostly it is near, and a ball of one cell reaches only a few rows
        let close = radius.min(0.5 / self.per_length);
        self.search_outward(center, close, &accept).or_else(|| self.search_outward(center, radius, &accept))
    }

    /// [`CellGrid::nearest_where`]: rows of cells are visited from the middle outward and left out when they can hold
    /// nothing nearer.
    fn search_outward(&self, center: &Point3, radius: f64, accept: &impl Fn(usize) -> bool) -> Option<(usize, f64)> {
        let (low, high) = self.cells_around(center, radius);
        let middle = self.cell_of(center);
        let (mut least, mut nearest) = (radius * radius, None);
        for z in outward(middle[2], low[2], high[2]) {
            let away_z = self.distance_to_cell(2, z, center);
            if away_z * away_z >= least {
                continue;
            }
            for y in outward(middle[1], low[1], high[1]) {
                let away_y = self.distance_to_cell(1, y, center);
                if away_z * away_z + away_y * away_y >= least {
                    continue;
                }
                let run = self.run(low[0], high[0], y, z);
                for (distance2, &index) in self.distances2(run.clone(), center).zip(&self.order[run]) {
                    if distance2 < least && accept(index as usize) {
                        (least, nearest) = (distance2, Some((index as usize, distance2)));
                    }
                }
            }
        }
        nearest
    }

    /// How far `center` lies outside the slab of cells `cell` along `axis`; a hair less, for rounding. The outermost
    /// slabs reach to infinity.
    fn distance_to_cell(&self, axis: usize, cell: usize, center: &Point3) -> f64 {
        let from_low = (center[axis] - self.origin[axis]) * self.per_length - cell as f64;
        let outside = if from_low < 0.0 { -from_low } else { from_low - 1.0 };
        let is_outermost = cell == 0 || cell + 1 == self.dims[axis];
        if is_outermost { 0.0 } else { (outside - 1e-9).max(0.0) / self.per_length }
    }
}

/// The numbers from `low` to `high`, beginning with the nearest to `middle`.
fn outward(middle: usize, low: usize, high: usize) -> impl Iterator<Item = usize> {
    let middle = middle.clamp(low, high);
    let reach = (middle - low).max(high - middle);
    (0..=reach).flat_map(move |step| {
        let below = (middle - low >= step).then(|| middle - step);
        let above = (step > 0 && high - middle >= step).then(|| middle + step);
        below.into_iter().chain(above)
    })
}

/// Pairs of neighbours that a sum over all points may look at. Surfaces have 15 million at the most that is asked for;
/// a cloud that fills space would have a hundred times as many.
pub const MOST_PAIRS: f64 = 6e7;

/// About how many pairs of points lie nearer to each other than `radius`.
pub fn pairs_within(points: &[Point3], radius: f64) -> f64 {
    /// A few hundred points tell.
    const PROBES: usize = 300;
    let grid = CellGrid::new(points, radius);
    let step = points.len().div_ceil(PROBES).max(1);
    let mut count = 0usize;
    for point in points.iter().step_by(step) {
        grid.for_each_within(point, radius, |_, _| count += 1);
    }
    count as f64 * step as f64
}

/// The smallest radius of the series `least, 1.3 least, ...` within which half of the points have at least `wanted`
/// neighbours (themselves counted): what a local fit needs on a cloud of unknown density. At most the whole box.
pub fn neighbour_radius(points: &[Point3], least: f64, wanted: usize) -> f64 {
    /// A few hundred points tell the median well enough.
    const PROBES: usize = 300;
    let most = Bounds::of(points).map_or(0.0, |b| b.diagonal());
    let step = points.len().div_ceil(PROBES).max(1);
    let mut radius = least;
    while radius < most {
        let grid = CellGrid::new(points, radius);
        let mut counts: Vec<usize> = points
            .iter()
            .step_by(step)
            .map(|point| {
                let mut count = 0;
                grid.for_each_within(point, radius, |_, _| count += 1);
                count
            })
            .collect();
        counts.sort_unstable();
        // where some points are crowded and others sparse a radius for these would be too much work at those
        let pairs = (counts.iter().sum::<usize>() * step) as f64;
        if counts[counts.len() / 2] >= wanted || pairs > MOST_PAIRS {
            break;
        }
        radius *= 1.3;
    }
    radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_what_brute_force_finds(
            coordinates in prop::collection::vec(prop::array::uniform3(-5.0..5.0f64), 0..120),
            center in prop::array::uniform3(-7.0..7.0f64), radius in 0.1..4.0f64, cell in 0.01..3.0f64,
        ) {
            let points: Vec<Point3> = coordinates.into_iter().map(Point3::from).collect();
            let center = Point3::from(center);
            let mut found = Vec::new();
            CellGrid::new(&points, cell).for_each_within(&center, radius, |i, _| found.push(i));
            found.sort_unstable();
            let expected: Vec<usize> =
                (0..points.len()).filter(|&i| (points[i] - center).norm_squared() < radius * radius).collect();
            prop_assert_eq!(&found, &expected);
            let beyond = |i: usize| i > 60;
            let any = CellGrid::new(&points, cell).any_within(&center, radius, beyond);
            prop_assert_eq!(any, expected.into_iter().any(beyond));
            let odd = |i: usize| i % 2 == 1;
            let nearest = CellGrid::new(&points, cell).nearest_where(&center, radius, odd).map(|(_, d)| d);
            let distances = (0..points.len()).filter(|&i| odd(i)).map(|i| (points[i] - center).norm_squared());
            let least = distances.filter(|d| *d < radius * radius).reduce(f64::min);
            prop_assert_eq!(nearest, least);
        }
    }

    #[test]
    fn the_radius_grows_until_there_are_neighbours() {
        let points: Vec<Point3> = (0..400).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        let radius = neighbour_radius(&points, 0.1, 13);
        assert!(radius > 2.0 && radius < 2.7, "13 points of a unit grid lie within 2: {radius}");
        assert_eq!(neighbour_radius(&points, 5.0, 13), 5.0);
        assert_eq!(neighbour_radius(&[], 1.0, 13), 1.0);
    }

    #[test]
    fn one_far_point_does_not_make_a_huge_grid() {
        let mut points = vec![Point3::origin(); 10];
        points.push(Point3::new(1e9, 1e9, 1e9));
        let grid = CellGrid::new(&points, 0.1);
        assert!(grid.starts.len() < 5000, "{} cells for 11 points", grid.starts.len());
        let mut found = 0;
        grid.for_each_within(&Point3::origin(), 0.5, |_, _| found += 1);
        assert_eq!(found, 10);
    }
}
