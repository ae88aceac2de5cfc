//! How salient a surface is at each of its points: what is shown of it. Queries go by the regions of a signature.

use rayon::prelude::*;

use super::{DescribeError, Prepared, checked_bounds, cleaned, in_own_frame};
use crate::saliency;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::progress::Progress;
use visage_geometry::{Point3, Surface};

/// A figure for each point of the surface, 0 to 1: that of the nearest place where saliency was measured. Runs inside the caller's
/// rayon pool.
///
/// # Errors
/// As [`describe`](super::describe).
pub fn point_saliency(surface: &Surface, progress: &Progress) -> Result<Vec<f64>, DescribeError> {
    let (own, motion_file_own) = in_own_frame(&cleaned(surface, progress)?);
    let bounds = checked_bounds(&own)?;
    let curved = Prepared::new(&own, bounds.diagonal(), progress)?.curved(progress)?;
    let map = saliency::saliency(&curved, curved.xi(), progress)?;
    let places: Vec<Point3> = curved.points.iter().map(|point| motion_file_own * point).collect();
    Ok(nearest(&surface.cloud.points, &places, &map))
}

/// For each point the figure of the nearest of some places.
fn nearest(points: &[Point3], places: &[Point3], figures: &[f64]) -> Vec<f64> {
    let Some(first) = places.first() else { return vec![f64::NAN; points.len()] };
    let local = |point: &Point3| LocalPoint::from((point - first).cast::<f32>());
    let indexed = IndexedPoints::new(places.iter().map(local).collect());
    let figure = |point: &Point3| {
        let nearest = indexed.tree.nearest(&local(point), f32::INFINITY);
        nearest.and_then(|nearest| figures.get(nearest.index as usize)).copied().unwrap_or(f64::NAN)
    };
    points.par_iter().with_min_len(1024).map(figure).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Cloud;

    #[test]
    fn what_stands_out_of_a_plane_has_the_largest_figures() {
        let place = |k: u32| {
            let [x, y] = [f64::from(k % 80) - 39.5, f64::from(k / 80) - 39.5];
            Point3::new(x, y, 12.0 * (-(x * x + y * y) / 40.0).exp())
        };
        let points: Vec<Point3> = (0..6400).map(place).collect();
        let surface = Surface { cloud: Cloud::from_points(points.clone()), ..Surface::default() };
        let figures = point_saliency(&surface, &Progress::silent()).expect("a surface");
        assert_eq!(figures.len(), points.len());
        let most = figures.iter().copied().fold(0.0, f64::max);
        let top = figures.iter().position(|figure| *figure == most).expect("there");
        let distance = points[top].coords.xy().norm();
        assert!(distance < 12.0, "the hill, not {}", points[top]);
        // far from the hill and from the rim there is nothing
        let flat = points.iter().zip(&figures).filter(|(point, _)| (25.0..30.0).contains(&point.coords.xy().norm()));
        assert!(flat.map(|(_, figure)| *figure).fold(0.0, f64::max) < 0.5 * most);
    }
}
