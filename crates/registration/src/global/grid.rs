//! A view's surfels cell by cell, so that the nearest one is looked up instead of searched: about as near is near enough
//! where thousands of motions are tried.

use visage_geometry::neighbours::LocalPoint;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Cells along a side, at most: a stray surfel far away must not make a grid of gigabytes.
        most_cells: f32 = 128.0,
        /// Cells that a surfel is entered in, to either side.
        around: i32 = 2,
    }
}

/// For each cell the surfel nearest to its middle.
#[derive(Debug, Clone)]
pub struct NearGrid {
    origin: nalgebra::Vector3<f32>,
    inverse: f32,
    size: [i32; 3],
    nearest: Vec<u32>,
}

impl NearGrid {
    /// In cells of side `cell`.
    pub fn new(points: &[LocalPoint], cell: f32) -> Self {
        let bound = |axis: usize, fold: fn(f32, f32) -> f32, start| points.iter().map(|p| p[axis]).fold(start, fold);
        let low = [0, 1, 2].map(|axis| bound(axis, f32::min, f32::INFINITY));
        let origin = nalgebra::Vector3::from(low).map(|x| x - cell * TUNING.around as f32);
        let size = [0, 1, 2].map(|axis| {
            let extent = bound(axis, f32::max, f32::NEG_INFINITY) - low[axis];
            (extent / cell).clamp(0.0, TUNING.most_cells) as i32 + 1 + 2 * TUNING.around
        });
        let mut grid = NearGrid { origin, inverse: 1.0 / cell, size, nearest: Vec::new() };
        let cells = size.iter().map(|n| *n as usize).product();
        grid.nearest = vec![u32::MAX; cells];
        let mut distances2 = vec![f32::INFINITY; cells];
        for (index, point) in (0u32..).zip(points) {
            grid.enter(index, &(*point).into(), &mut distances2);
        }
        grid
    }

    fn enter(&mut self, surfel: u32, point: &nalgebra::Vector3<f32>, distances2: &mut [f32]) {
        let place = (point - self.origin) * self.inverse;
        let center = place.map(|x| x.floor().clamp(-TUNING.most_cells, 4.0 * TUNING.most_cells) as i32);
        for z in center.z - TUNING.around..=center.z + TUNING.around {
            for y in center.y - TUNING.around..=center.y + TUNING.around {
                for x in center.x - TUNING.around..=center.x + TUNING.around {
                    let Some(cell) = self.index([x, y, z]) else { continue };
                    let middle = nalgebra::Vector3::new(x as f32, y as f32, z as f32).add_scalar(0.5);
                    let distance2 = (middle - place).norm_squared();
                    if distance2 < distances2[cell] {
                        (distances2[cell], self.nearest[cell]) = (distance2, surfel);
                    }
                }
            }
        }
    }

    #[inline]
    fn index(&self, cell: [i32; 3]) -> Option<usize> {
        let inside = (0..3).all(|axis| (cell[axis] as u32) < self.size[axis] as u32);
        inside.then(|| ((cell[2] * self.size[1] + cell[1]) * self.size[0] + cell[0]) as usize)
    }

    /// A surfel about as near to `place` as any, if one is within two cells or so.
    #[inline]
    pub fn near(&self, place: &nalgebra::Vector3<f32>) -> Option<usize> {
        let cell = (place - self.origin) * self.inverse;
        let cell = self.index([cell.x.floor() as i32, cell.y.floor() as i32, cell.z.floor() as i32])?;
        let surfel = self.nearest[cell];
        (surfel != u32::MAX).then_some(surfel as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_looked_up_is_about_as_near_as_the_nearest() {
        let at = |k: usize| [(k % 20) as f32, (k / 20) as f32, ((k % 20) as f32 * 0.7).sin()];
        let points: Vec<LocalPoint> = (0..400).map(at).collect();
        let grid = NearGrid::new(&points, 1.0);
        let distance = |place: &nalgebra::Vector3<f32>, k: usize| (nalgebra::Vector3::from(points[k]) - place).norm();
        for point in &points {
            let place = nalgebra::Vector3::from(*point) + nalgebra::Vector3::new(0.3, -0.4, 0.5);
            let found = grid.near(&place).expect("there is a surfel within a cell");
            let nearest = (0..400).map(|k| distance(&place, k)).fold(f32::INFINITY, f32::min);
            assert!(distance(&place, found) < nearest + 0.9, "{place:?}");
        }
        assert_eq!(grid.near(&nalgebra::Vector3::new(10.0, 10.0, 6.0)), None);
    }

    #[test]
    fn a_stray_surfel_far_away_makes_no_great_grid() {
        let grid = NearGrid::new(&[[0.0; 3], [1e9, -1e9, 3.0]], 1.0);
        assert!(grid.nearest.len() < 1 << 22);
        assert_eq!(grid.near(&nalgebra::Vector3::new(1e9, -1e9, 3.0)), None);
        assert!(NearGrid::new(&[], 1.0).near(&nalgebra::Vector3::zeros()).is_none());
    }
}
