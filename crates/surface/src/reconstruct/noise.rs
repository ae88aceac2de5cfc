//! How far points lie from the surface that they are of: what the size of a cell depends on.

use rayon::prelude::*;

use super::grid::block_of;
use super::samples::{Frame, Samples};
use visage_geometry::{Cloud, Point3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// About so many points are looked at.
        looked_at: usize = 60_000,
        /// A cell with fewer points says nothing.
        least: f32 = 4.0,
    }
}
/// From the median of absolute deviations to the standard deviation of a normal distribution.
const NORMAL: f64 = 1.4826;

/// The standard deviation of the points from the mean planes of cells of the edge `cell`, a length; overlapping scans that
/// lie apart count as noise. `None` if no cell has enough points.
pub fn noise(frame: &Frame, cloud: &Cloud) -> Option<f64> {
    let normals = cloud.normals.as_ref()?;
    // whole blocks, so that their cells have all of their points
    let one_of = (cloud.points.len() / TUNING.looked_at).max(1) as u64;
    let is_chosen = |point: &Point3| {
        let block = block_of(&frame.local(point).map(|x| x as i32));
        // a multiplicative hash: blocks beside each other are in different parts
        (block.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32).is_multiple_of(one_of)
    };
    let (points, normals): (Vec<Point3>, Vec<nalgebra::Vector3<f32>>) = cloud
        .points
        .par_iter()
        .zip(normals)
        .filter(|(point, _)| is_chosen(point))
        .map(|(point, normal)| (*point, *normal))
        .unzip();
    let samples = Samples::of(frame, &points, &normals);
    let mut off: Vec<f64> = samples
        .of_points(frame, &points, &normals)
        .filter(|(sample, _)| sample.weight >= TUNING.least)
        .map(|(sample, point)| {
            let at = frame.local(&point);
            let away: f32 = (0..3).map(|k| sample.normal[k] * (at[k] - sample.place[k])).sum();
            // the mean was drawn along by the point itself
            f64::from(away.abs() * (sample.weight / (sample.weight - 1.0)).sqrt())
        })
        .collect();
    let middle = off.len() / 2;
    let (_, median, _) = (!off.is_empty()).then(|| off.select_nth_unstable_by(middle, f64::total_cmp))?;
    Some(NORMAL * *median * frame.cell)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Bounds;

    #[test]
    fn the_noise_of_a_plane_is_measured_whatever_its_slope() {
        let mut seed = 1u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) as f64 / f64::from(1u32 << 31)
        };
        let normal = nalgebra::Vector3::new(0.48, 0.6, 0.64);
        let (along, across) =
            (nalgebra::Vector3::new(0.8, -0.0, -0.6), normal.cross(&nalgebra::Vector3::new(0.8, 0.0, -0.6)));
        for wanted in [0.02, 0.2] {
            let points: Vec<Point3> = (0..20_000)
                .map(|_| {
                    // a sum of twelve has the variance 1
                    let off: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                    Point3::from(normal * off * wanted + along * (70.0 * uniform()) + across * (70.0 * uniform()))
                })
                .collect();
            let normals = Some(vec![normal.cast(); points.len()]);
            let frame = Frame::around(&Bounds::of(&points).expect("points"), 2.0);
            let cloud = Cloud { normals, ..Cloud::from_points(points) };
            let found = noise(&frame, &cloud).expect("cells with points");
            assert!((0.8..1.2).contains(&(found / wanted)), "{found} instead of {wanted}");
        }
        let frame = Frame { origin: Point3::origin(), cell: 1.0, size: [1; 3] };
        assert_eq!(noise(&frame, &Cloud::from_points(vec![Point3::origin()])), None);
    }
}
