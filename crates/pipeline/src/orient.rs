//! Clouds from elsewhere made ready for a surface: normals that point outward, and how dense a scan of them was.

use rayon::prelude::*;

use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals::{NEIGHBOURS, local_planes};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Cloud, Surface, Vector3};
use visage_shape::saliency::Side;
use visage_shape::saliency::orientation::oriented_cloud;

/// Cells in which normals are made to agree, in spacings: a cell holds a few points, and thin walls lie in two.
const CELL: f64 = 2.0;

/// Where the normals of a cloud come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NormalsFrom {
    /// Its file has them.
    File,
    /// They are estimated, and look towards the scanner, whose place the file says.
    Scanner,
    /// They are estimated and made to agree with each other; most of them look away from the middle.
    Estimated,
}

/// A cloud that is ready.
#[derive(Debug, Clone, PartialEq)]
pub struct Oriented {
    /// The points with their normals; those that have none are left out.
    pub cloud: Cloud,
    /// For each of them of which scan it is, if that is known.
    pub views: Option<Vec<u16>>,
    /// Where the normals come from.
    pub normals: NormalsFrom,
    /// The distance of neighbours: of a scan if it is known which points are of one, else of all.
    pub spacing: f64,
}

/// Makes a cloud ready. `views` says of which scan each point is, if that is known.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn orient(surface: &Surface, views: Option<&[u16]>, progress: &Progress) -> Result<Oriented, Canceled> {
    let center = surface.cloud.bounds().map_or(Vector3::zeros(), |bounds| bounds.center().coords);
    let local = |point: &visage_geometry::Point3| -> LocalPoint { (point.coords - center).cast::<f32>().into() };
    let points: Vec<LocalPoint> = surface.cloud.points.par_iter().map(local).collect();
    let of_scans = views.map(|views| scan_spacing(&points, views)).filter(|spacing| *spacing > 0.0);
    let indexed = IndexedPoints::new(points);
    let spacing = of_scans.unwrap_or_else(|| spacing(&indexed));
    progress.check()?;
    let (normals, from) = match &surface.cloud.normals {
        Some(normals) => (normals.clone(), NormalsFrom::File),
        None => estimated(surface, &indexed, spacing, progress)?,
    };
    let sound: Vec<bool> = normals.iter().map(|normal| normal.norm_squared() > 0.5).collect();
    let cloud = Cloud { normals: Some(normals), ..surface.cloud.clone() };
    let of_kept =
        |views: &[u16]| views.iter().zip(&sound).filter(|(_, sound)| **sound).map(|(view, _)| *view).collect();
    let views = views.map(of_kept);
    let cloud = if sound.iter().all(|sound| *sound) { cloud } else { cloud.kept(&sound) };
    Ok(Oriented { cloud, views, normals: from, spacing })
}

/// The median distance of a point from its nearest neighbour, of a few points: what registration calls spacing.
fn spacing(indexed: &IndexedPoints) -> f64 {
    const ASKED: usize = 2000;
    let step = indexed.points.len().div_ceil(ASKED).max(1);
    let mut found = Vec::new();
    let nearest = |point: &LocalPoint| {
        // the point itself is the first
        indexed.tree.k_nearest(point, 2, f32::INFINITY, &mut found);
        found.get(1).map(|other| f64::from(other.distance2).sqrt())
    };
    let mut distances: Vec<f64> = indexed.points.iter().step_by(step).filter_map(nearest).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or_default()
}

/// The median spacing of the scans.
fn scan_spacing(points: &[LocalPoint], views: &[u16]) -> f64 {
    let scans = usize::from(views.iter().copied().max().unwrap_or_default()) + 1;
    let mut of_scan: Vec<Vec<LocalPoint>> = vec![Vec::new(); scans];
    points.iter().zip(views).for_each(|(point, view)| of_scan[usize::from(*view)].push(*point));
    let found = |points: Vec<LocalPoint>| (points.len() > 1).then(|| spacing(&IndexedPoints::new(points)));
    let mut spacings: Vec<f64> = of_scan.into_par_iter().filter_map(found).collect();
    spacings.sort_unstable_by(f64::total_cmp);
    spacings.get(spacings.len() / 2).copied().unwrap_or_default()
}

/// Normals of the planes about the points, on the side that a coarser cloud tells.
fn estimated(
    surface: &Surface,
    indexed: &IndexedPoints,
    spacing: f64,
    progress: &Progress,
) -> Result<(Vec<nalgebra::Vector3<f32>>, NormalsFrom), Canceled> {
    let planes = local_planes(indexed, &indexed.points, NEIGHBOURS);
    progress.check()?;
    let coarse = oriented_cloud(surface, CELL * spacing, progress)?;
    let center = surface.cloud.bounds().map_or(Vector3::zeros(), |bounds| bounds.center().coords);
    let away: f64 = coarse.points.iter().zip(&coarse.normals).map(|(p, n)| n.dot(&(p.coords - center))).sum();
    let sign = match coarse.side {
        Side::Outward => 1.0,
        Side::Inward => -1.0,
        Side::Unknown => away.signum(),
    };
    let guides = coarse.points.iter().map(|point| (point.coords - center).cast::<f32>().into()).collect();
    let guides = IndexedPoints::new(guides);
    let normal = |(point, plane): (&LocalPoint, &visage_geometry::normals::LocalPlane)| {
        let normal = nalgebra::Vector3::from(plane.normal);
        let guide = guides.tree.nearest(point, f32::INFINITY).map(|found| coarse.normals[found.index as usize]);
        let is_against = guide.is_some_and(|guide| sign * guide.dot(&normal.cast()) < 0.0);
        if is_against { -normal } else { normal }
    };
    let normals = indexed.points.par_iter().zip(&planes).with_min_len(256).map(normal).collect();
    Ok((normals, if coarse.side == Side::Outward { NormalsFrom::Scanner } else { NormalsFrom::Estimated }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Point3;

    fn sphere(count: usize) -> Surface {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let place = |k: usize| {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
            let (sine, cosine) = (golden * k as f64).sin_cos();
            let around = (1.0 - z * z).sqrt();
            Point3::new(500.0 + 10.0 * around * cosine, 10.0 * around * sine, 10.0 * z)
        };
        Surface { cloud: Cloud::from_points((0..count).map(place).collect()), ..Surface::default() }
    }

    #[test]
    fn estimated_normals_look_outward_and_say_that_they_are_estimated() {
        let surface = sphere(5000);
        let made = orient(&surface, None, &Progress::silent()).expect("not canceled");
        assert_eq!((made.normals, made.cloud.len()), (NormalsFrom::Estimated, 5000));
        let outward = |(point, normal): (&Point3, &nalgebra::Vector3<f32>)| {
            (point - Point3::new(500.0, 0.0, 0.0)).normalize().dot(&normal.cast()) > 0.95
        };
        assert!(made.cloud.points.iter().zip(made.cloud.normals.as_ref().expect("made")).all(outward));
        assert!((0.3..0.7).contains(&made.spacing), "{}", made.spacing);
    }

    #[test]
    fn the_spacing_is_that_of_a_scan_where_scans_are_known() {
        // four scans of one sphere, a little beside each other
        let mut surface = sphere(2000);
        let scan = surface.cloud.points.clone();
        for k in 1..4 {
            let beside = nalgebra::Vector3::new(0.03, 0.05, 0.02) * f64::from(k);
            surface.cloud.points.extend(scan.iter().map(|point| point + beside));
        }
        let views: Vec<u16> = (0..8000u16).map(|k| k / 2000).collect();
        let of = |views: Option<&[u16]>| orient(&surface, views, &Progress::silent()).expect("not canceled").spacing;
        let of_scan = orient(&sphere(2000), None, &Progress::silent()).expect("not canceled").spacing;
        assert!((of(Some(&views)) / of_scan - 1.0).abs() < 0.05 && of(None) < 0.3 * of_scan);
    }

    #[test]
    fn normals_of_a_file_are_believed_and_points_without_one_left_out() {
        let mut surface = sphere(100);
        let mut normals = vec![nalgebra::Vector3::z(); 100];
        normals[7] = nalgebra::Vector3::zeros();
        surface.cloud.normals = Some(normals);
        let made = orient(&surface, None, &Progress::silent()).expect("not canceled");
        assert_eq!((made.normals, made.cloud.len()), (NormalsFrom::File, 99));
    }
}
