//! What the grid of an organised scan tells of its points.

use super::{Cloud, Point3, RangeGrid};

/// Pairs of pixels that are measured, at most about so many.
const SAMPLES: usize = 4000;

/// The horizontal resolution L_r of an organised scan: the median distance of points seen by pixels side by side.
///
/// `None` if the grid does not fit the cloud, or no two pixels side by side saw different points.
pub fn resolution(grid: &RangeGrid, cloud: &Cloud) -> Option<f64> {
    if grid.columns.checked_mul(grid.rows) != Some(grid.pixels.len()) {
        return None;
    }
    let seen: Vec<usize> = (0..grid.pixels.len()).filter(|pixel| grid.pixels[*pixel] != RangeGrid::EMPTY).collect();
    let mut distances: Vec<f64> = seen
        .iter()
        .step_by((2 * seen.len()).div_ceil(SAMPLES).max(1))
        .flat_map(|pixel| [right_of(grid, *pixel), below(grid, *pixel)].map(|other| (*pixel, other)))
        .filter_map(|(pixel, other)| Some((point(grid, cloud, pixel)? - point(grid, cloud, other?)?).norm()))
        .filter(|distance| *distance > 0.0)
        .collect();
    let middle = distances.len().checked_sub(1)? / 2;
    Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn right_of(grid: &RangeGrid, pixel: usize) -> Option<usize> {
    (pixel % grid.columns + 1 < grid.columns).then_some(pixel + 1)
}

fn below(grid: &RangeGrid, pixel: usize) -> Option<usize> {
    Some(pixel + grid.columns).filter(|pixel| *pixel < grid.pixels.len())
}

/// The point that a pixel saw.
fn point<'a>(grid: &RangeGrid, cloud: &'a Cloud, pixel: usize) -> Option<&'a Point3> {
    cloud.points.get(grid.pixels[pixel] as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 x 5 pixels 0.5 apart in each row and 0.5 from row to row, the right half 10 deeper; the last saw nothing.
    fn stair() -> (RangeGrid, Cloud) {
        let depth = |k: usize| if k % 8 < 4 { 0.0 } else { 10.0 };
        let points = (0..39).map(|k| Point3::new((k % 8) as f64 * 0.5, (k / 8) as f64 * 0.5, depth(k)));
        let mut pixels: Vec<u32> = (0..40).collect();
        pixels[39] = RangeGrid::EMPTY;
        (RangeGrid { columns: 8, rows: 5, pixels }, Cloud::from_points(points.collect()))
    }

    #[test]
    fn the_resolution_is_the_step_of_the_grid_whatever_jumps() {
        let (grid, cloud) = stair();
        assert_eq!(resolution(&grid, &cloud), Some(0.5));
    }

    #[test]
    fn a_grid_that_does_not_fit_is_none() {
        let (grid, cloud) = stair();
        assert_eq!(resolution(&RangeGrid { columns: 7, ..grid.clone() }, &cloud), None);
        assert_eq!(resolution(&RangeGrid { pixels: vec![RangeGrid::EMPTY; 40], ..grid.clone() }, &cloud), None);
        let pixels = grid.pixels.iter().map(|pixel| pixel.saturating_add(1_000_000)).collect();
        assert_eq!(resolution(&RangeGrid { pixels, ..grid }, &cloud), None);
        let empty = RangeGrid { columns: 0, rows: 0, pixels: Vec::new() };
        assert_eq!(resolution(&empty, &cloud), None);
    }
}
