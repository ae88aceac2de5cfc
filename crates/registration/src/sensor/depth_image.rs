//! What a scanner saw in each direction: where it saw surface, nothing can stand in front.

use super::Sensor;
use crate::view::median;
use visage_geometry::neighbours::LocalPoint;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Cells along a side, at most: a stray point far away must not make a picture of gigabytes. What falls outside is not
        /// seen, so it speaks against nothing.
        most_cells: f32 = 1024.0,
    }
}

/// A depth image of a view: for each cell across the line of sight, how near the nearest surface is.
#[derive(Debug, Clone)]
pub struct DepthImage {
    /// Rows: across, upward, towards the scanner.
    frame: nalgebra::Matrix3<f32>,
    /// Where the scanner stood, if near enough to matter, and the typical distance of what it saw.
    eye: Option<(nalgebra::Vector3<f32>, f32)>,
    cell: f32,
    origin: [f32; 2],
    columns: usize,
    rows: usize,
    /// Whether the scanner's field of view ends somewhere on the surface: beyond the picture nothing is known.
    is_cropped: bool,
    /// Greatest height towards the scanner seen in the cell or one of its neighbours; -infinity where nothing was seen in
    /// any of them, not a number where only in a neighbour.
    nearest: Vec<f32>,
}

/// What a scanner saw in some direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seen {
    /// Surface; the point in question stands so far in front of it (negative: behind).
    Surface {
        /// Towards the scanner, a length.
        height: f32,
    },
    /// Nothing, but surface beside it.
    Rim,
    /// Nothing far and wide.
    Nothing,
    /// It did not look there, as far as is known.
    Unknown,
}

impl DepthImage {
    /// The picture that `points` make, in cells of side `cell`.
    pub fn new(points: &[LocalPoint], sensor: &Sensor, cell: f64) -> Self {
        let toward = sensor
            .direction_from(&[0.0; 3])
            .cast::<f32>()
            .try_normalize(f32::MIN_POSITIVE)
            .unwrap_or_else(nalgebra::Vector3::z);
        let mut least = nalgebra::Vector3::zeros();
        least[toward.iamin()] = 1.0;
        let across = toward.cross(&least).normalize();
        let upward = toward.cross(&across);
        let frame = nalgebra::Matrix3::from_rows(&[across.transpose(), upward.transpose(), toward.transpose()]);
        let eye = match sensor {
            Sensor::At(position) => {
                let eye = position.cast::<f32>();
                let mut distances: Vec<f32> =
                    points.iter().map(|p| (nalgebra::Vector3::from(*p) - eye).norm()).collect();
                Some((eye, median(&mut distances).unwrap_or(1.0)))
            }
            Sensor::Toward(_) => None,
        };
        let mut map = DepthImage {
            frame,
            eye,
            cell: cell as f32,
            origin: [0.0; 2],
            columns: 0,
            rows: 0,
            is_cropped: false,
            nearest: Vec::new(),
        };
        let seen: Vec<nalgebra::Vector3<f32>> = points.iter().map(|p| map.project(&(*p).into())).collect();
        let bound = |axis: usize, fold: fn(f32, f32) -> f32, start| seen.iter().map(|s| s[axis]).fold(start, fold);
        map.origin = [bound(0, f32::min, f32::INFINITY), bound(1, f32::min, f32::INFINITY)];
        let extent = |axis: usize| {
            let last = bound(axis, f32::max, f32::NEG_INFINITY);
            ((last - map.origin[axis]) / map.cell).clamp(0.0, TUNING.most_cells) as usize + 1
        };
        (map.columns, map.rows) = (extent(0), extent(1));
        let mut own = vec![f32::NEG_INFINITY; map.columns * map.rows];
        for place in &seen {
            if let Some(index) = map.index(place) {
                own[index] = own[index].max(place.z);
            }
        }
        map.nearest = map.widened(&own);
        map
    }

    /// Each cell's greatest value among itself and its eight neighbours; an empty cell beside a full one is not a number.
    fn widened(&self, own: &[f32]) -> Vec<f32> {
        let at = |column: usize, row: usize| own[row * self.columns + column];
        let mut wide = Vec::with_capacity(own.len());
        for row in 0..self.rows {
            for column in 0..self.columns {
                let mut value = f32::NEG_INFINITY;
                for r in row.saturating_sub(1)..(row + 2).min(self.rows) {
                    for c in column.saturating_sub(1)..(column + 2).min(self.columns) {
                        value = value.max(at(c, r));
                    }
                }
                let is_rim = at(column, row) == f32::NEG_INFINITY && value > f32::NEG_INFINITY;
                wide.push(if is_rim { f32::NAN } else { value });
            }
        }
        wide
    }

    /// Across, upward, and height towards the scanner, of a point of the view's local frame. A scanner that is near sees
    /// all around: angles are scaled so that cells have their size at the typical distance.
    fn project(&self, point: &nalgebra::Vector3<f32>) -> nalgebra::Vector3<f32> {
        match self.eye {
            None => self.frame * point,
            Some((eye, typical)) => {
                let ray = self.frame * (point - eye);
                let distance = ray.norm().max(f32::MIN_POSITIVE);
                let (across, upward) = (ray.x.atan2(-ray.z), (ray.y / distance).clamp(-1.0, 1.0).asin());
                nalgebra::Vector3::new(across * typical, upward * typical, typical - distance)
            }
        }
    }

    fn index(&self, place: &nalgebra::Vector3<f32>) -> Option<usize> {
        let column = ((place.x - self.origin[0]) / self.cell).floor();
        let row = ((place.y - self.origin[1]) / self.cell).floor();
        let inside = column >= 0.0 && row >= 0.0 && (column as usize) < self.columns && (row as usize) < self.rows;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Takes it that the scanner looked only where it saw something.
    pub fn crop(&mut self) {
        self.is_cropped = true;
    }

    /// Whether the scanner is taken to have looked only where it saw something.
    pub fn is_cropped(&self) -> bool {
        self.is_cropped
    }

    /// How far a point stands in front of the surface that the scanner saw there; `None` but where the surface goes on all
    /// around.
    pub fn height_over_unbroken(&self, point: &nalgebra::Vector3<f32>) -> Option<f32> {
        let place = self.project(point);
        let index = self.index(&place)?;
        let (column, row) = (index % self.columns, index / self.columns);
        let inside = column > 0 && row > 0 && column + 1 < self.columns && row + 1 < self.rows;
        // a cell that is empty itself holds no height, whatever its neighbours do
        let is_full = |index: usize| self.nearest[index] > f32::NEG_INFINITY;
        let rows = inside.then(|| (row - 1..row + 2).map(|row| row * self.columns + column))?;
        rows.flat_map(|middle| middle - 1..middle + 2).all(is_full).then(|| place.z - self.nearest[index])
    }

    /// What the scanner saw in a point's direction.
    #[inline]
    pub fn look(&self, point: &nalgebra::Vector3<f32>) -> Seen {
        let place = self.project(point);
        match self.index(&place).map(|index| self.nearest[index]) {
            Some(nearest) if nearest > f32::NEG_INFINITY => Seen::Surface { height: place.z - nearest },
            Some(nearest) if nearest.is_nan() => Seen::Rim,
            _ if self.is_cropped => Seen::Unknown,
            _ => Seen::Nothing,
        }
    }

    /// The direction (not normalised) from a point to the scanner.
    #[inline]
    pub fn toward_scanner(&self, point: &nalgebra::Vector3<f32>) -> nalgebra::Vector3<f32> {
        self.eye.map_or_else(|| self.frame.row(2).transpose(), |(eye, _)| eye - point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Vector3;

    #[test]
    fn a_scanner_saw_surface_its_rim_and_nothing() {
        let sheet: Vec<LocalPoint> = (0..400).map(|k| [(k % 20) as f32 - 9.5, (k / 20) as f32 - 9.5, 0.0]).collect();
        for sensor in [Sensor::Toward(Vector3::z()), Sensor::At(Vector3::z() * 1e4)] {
            let map = DepthImage::new(&sheet, &sensor, 2.0);
            let look = |x: f32, z: f32| map.look(&nalgebra::Vector3::new(x, 0.0, z));
            for height in [3.0, -3.0] {
                assert!(matches!(look(0.0, height), Seen::Surface { height: h } if (h - height).abs() < 0.1));
            }
            assert_eq!(look(25.0, 0.0), Seen::Nothing);
        }
        // a hole wider than a cell: its middle is rim as long as a neighbour is full
        let holed: Vec<LocalPoint> = sheet.into_iter().filter(|p| p[0].hypot(p[1]) > 2.9).collect();
        let map = DepthImage::new(&holed, &Sensor::Toward(Vector3::z()), 2.0);
        assert_eq!(map.look(&nalgebra::Vector3::zeros()), Seen::Rim);
        let height = |x: f32| map.height_over_unbroken(&nalgebra::Vector3::new(x, 0.0, 3.0));
        assert_eq!([0.0, 2.6, 9.0, 25.0].map(height), [None; 4], "the hole, beside it, the border, outside");
        assert!(height(6.5).is_some_and(|height| (height - 3.0).abs() < 0.1));
    }
}
