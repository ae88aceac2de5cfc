//! Fewer points, evenly spread: one for each occupied cell of a voxel grid.

use super::neighbours::LocalPoint;

/// The means of a grid's occupied voxels.
#[derive(Debug, Clone, Default)]
pub struct Thinned {
    /// The mean of each voxel's points.
    pub centroids: Vec<LocalPoint>,
    /// The number of points in each voxel.
    pub counts: Vec<u32>,
}

/// Cells along an axis that a packed key can tell apart.
const AXIS_CELLS: f32 = (1u32 << 21) as f32;

/// Groups `points` by voxels of edge `edge` (same unit) and returns their means in a spatial order that depends only on
/// the points. An `edge` so small that keys would run over is enlarged.
#[inline]
pub fn thin(points: &[LocalPoint], edge: f32) -> Thinned {
    let runs = sorted_runs(points, edge);
    let mut thinned = Thinned::default();
    for voxel in voxels(&runs) {
        let (centroid, count) = mean(points, voxel);
        thinned.centroids.push(centroid);
        thinned.counts.push(count);
    }
    thinned
}

/// Of each voxel the index of the point nearest to the mean; voxels and their order as by [`thin`].
#[inline]
pub fn representatives(points: &[LocalPoint], edge: f32) -> Vec<u32> {
    let runs = sorted_runs(points, edge);
    let representative = |voxel: &[Run]| {
        let (centroid, _) = mean(points, voxel);
        let members = voxel.iter().flat_map(|run| run.start..run.end);
        members
            .map(|index| (super::neighbours::distance2(&points[index as usize], &centroid), index))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(_, index)| index)
    };
    voxels(&runs).filter_map(representative).collect()
}

fn voxels(runs: &[Run]) -> impl Iterator<Item = &[Run]> {
    runs.chunk_by(|a, b| a.key == b.key)
}

/// The mean of a voxel's points, and how many they are.
fn mean(points: &[LocalPoint], voxel: &[Run]) -> (LocalPoint, u32) {
    let (mut sum, mut count) = ([0.0f64; 3], 0);
    for run in voxel {
        for point in &points[run.start as usize..run.end as usize] {
            for axis in 0..3 {
                sum[axis] += f64::from(point[axis]);
            }
        }
        count += run.end - run.start;
    }
    (sum.map(|s| (s / f64::from(count)) as f32), count)
}

fn sorted_runs(points: &[LocalPoint], edge: f32) -> Vec<Run> {
    let mut min = [f32::INFINITY; 3];
    let mut max = [f32::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            min[axis] = min[axis].min(point[axis]);
            max[axis] = max[axis].max(point[axis]);
        }
    }
    let extent = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f32::max);
    let inverse = 1.0 / edge.max(extent / (AXIS_CELLS - 2.0)).max(f32::MIN_POSITIVE);
    let mut runs = runs(points, |point| [0, 1, 2].map(|axis| ((point[axis] - min[axis]) * inverse) as u32));
    runs.sort_unstable_by_key(|run| (run.key, run.start));
    runs
}

/// Points that follow each other in one voxel: scanners write neighbours one after the other, so there are far fewer of
/// these to sort than points.
struct Run {
    /// The voxel's place on a space-filling curve.
    key: u64,
    /// The first point.
    start: u32,
    /// One past the last.
    end: u32,
}

fn runs(points: &[LocalPoint], cell: impl Fn(&LocalPoint) -> [u32; 3]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut last = None;
    for (index, point) in (0u32..).zip(points) {
        let cell = cell(point);
        match runs.last_mut() {
            Some(run) if last == Some(cell) => run.end = index + 1,
            _ => runs.push(Run { key: morton(cell), start: index, end: index + 1 }),
        }
        last = Some(cell);
    }
    runs
}

/// The place of a cell on the Z-order curve: cells that follow each other lie side by side, which keeps searches in
/// the cache.
fn morton(cell: [u32; 3]) -> u64 {
    fn spread(v: u32) -> u64 {
        let mut v = u64::from(v) & 0x1f_ffff;
        v = (v | v << 32) & 0x001f_0000_0000_ffff;
        v = (v | v << 16) & 0x001f_0000_ff00_00ff;
        v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
        v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
        (v | v << 2) & 0x1249_2492_4924_9249
    }
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_counted_once() {
        let points: Vec<LocalPoint> =
            (0..1000).map(|i| [(i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32]).collect();
        let thinned = thin(&points, 2.0);
        assert_eq!(thinned.centroids.len(), 125);
        assert!(thinned.counts.iter().all(|&count| count == 8));
        assert_eq!(thinned.centroids[0], [0.5, 0.5, 0.5]);
        assert_eq!(representatives(&points, 2.0)[0], 0);
    }

    #[test]
    fn the_order_of_the_points_does_not_matter() {
        let points: Vec<LocalPoint> = (0..500).map(|i| [(i * 37 % 101) as f32, (i * 53 % 97) as f32, 0.0]).collect();
        let mut reversed = points.clone();
        reversed.reverse();
        let (a, b) = (thin(&points, 7.0), thin(&reversed, 7.0));
        assert_eq!(a.counts, b.counts);
        assert_eq!(a.centroids.len(), b.centroids.len());
    }

    #[test]
    fn a_tiny_edge_keeps_all_points() {
        let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1000.0, 0.0, 0.0]];
        assert_eq!(thin(&points, 1e-30).centroids.len(), 3);
        assert!(thin(&[], 1.0).centroids.is_empty());
    }
}
