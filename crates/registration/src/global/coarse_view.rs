//! A scan reduced to what global registration needs of it: a few thousand oriented surfels, each described once.

use rayon::prelude::*;

use super::descriptor::{Descriptors, describe};
use crate::sensor::depth_image::DepthImage;
use crate::sensor::viewpoint;
use crate::sensor::{Facet, Sensor, outer_side, viewing_axis};
use crate::view::View;
use visage_geometry::Vector3;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals::{Patch, patch_within};
use visage_geometry::thinning::thin;

/// What is kept of a view, in its local frame.
#[derive(Debug, Clone)]
pub struct CoarseView {
    /// Surfel positions with their tree.
    pub indexed: IndexedPoints,
    /// Unit normals towards the scanner.
    pub normals: Vec<nalgebra::Vector3<f32>>,
    /// Whether the surface goes on all around.
    pub is_inner: Vec<bool>,
    /// The indices of the inner surfels, in order.
    pub inner: Vec<u32>,
    /// Where the scanner stood.
    pub sensor: Sensor,
    /// How clear the scanner's side is: 0 (a coin toss) to 1 (given by the file or plain to see).
    pub side_clarity: f64,
    /// The largest distance of a surfel from the view's centroid.
    pub radius: f64,
    /// What the surface looks like around each inner surfel.
    pub descriptors: Descriptors,
    /// What the scanner saw in each direction.
    pub depth_image: DepthImage,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Radius of a normal's neighbourhood, in edges.
        normal_reach: f64 = 1.2,
        /// A surfel lies on a rim if the mean of its neighbourhood is farther off than this share of its radius: half a disc
        /// has its mean at 0.42.
        rim_offset: f32 = 0.3,
        /// Side of the cells of a depth image, in edges.
        depth_cell: f64 = 1.3,
        /// Voxels with less than this share of the median number of points, or with a neighbourhood of less than the second
        /// share, are outliers.
        outlier_voxel: f64 = 0.1,
        /// or with this share of the median number of cells around.
        outlier_around: f64 = 0.2,
        /// Edge of the cells that a voxel's share of surface is counted in, in its own: nearer to its scanner a surface holds more
        /// points, but no more cells.
        cell: f64 = 0.25,
    }
}

impl CoarseView {
    /// Reduces a view with surfels of one voxel of edge `edge`; `sensor` if the file or the caller told it.
    pub fn new(view: &View, edge: f64, sensor: Option<Sensor>) -> Self {
        let reach = (TUNING.normal_reach * edge) as f32;
        let (centroids, fitted) = supported(view, edge, reach);
        let facets: Vec<Facet> = fitted.iter().filter(|f| f.is_inner).map(Fitted::facet).collect();
        let (mut normals, is_inner): (Vec<_>, Vec<bool>) = fitted.into_iter().map(|f| (f.normal, f.is_inner)).unzip();
        let (sensor, side_clarity) = match sensor {
            Some(sensor) => (sensor, 1.0),
            None => match viewpoint::find(&view.indexed, view.radius) {
                Some(eye) => (Sensor::At(eye), 1.0),
                None => own_side(&centroids, &normals, &facets),
            },
        };
        for (normal, point) in normals.iter_mut().zip(&centroids) {
            if normal.cast::<f64>().dot(&sensor.direction_from(point)) < 0.0 {
                *normal = -*normal;
            }
        }
        let inner: Vec<u32> = (0..is_inner.len() as u32).filter(|index| is_inner[*index as usize]).collect();
        let radius = centroids.iter().map(|c| nalgebra::Vector3::from(*c).norm()).fold(0.0f32, f32::max).into();
        let mut depth_image = DepthImage::new(&centroids, &sensor, TUNING.depth_cell * edge);
        // a scanner that looks all the way round has its picture end where its rays do, not where an object does
        if sensor.is_round(view.points()) {
            depth_image.crop();
        }
        let indexed = IndexedPoints::new(centroids);
        let descriptors = describe(&indexed, &normals, &inner, edge);
        CoarseView { indexed, normals, is_inner, inner, sensor, side_clarity, radius, descriptors, depth_image }
    }

    /// A surfel's position.
    pub fn position(&self, index: usize) -> nalgebra::Vector3<f32> {
        self.indexed.points[index].into()
    }
}

/// Sketches all views with one common edge, in parallel.
pub fn coarse_views_of(views: &[View], edge: f64, sensors: &[Option<Sensor>]) -> Vec<CoarseView> {
    views.par_iter().zip(sensors).with_max_len(1).map(|(view, sensor)| CoarseView::new(view, edge, *sensor)).collect()
}

/// The scanner's side, read off the scan alone: what a scanner sees of a body bulges towards it.
fn own_side(points: &[LocalPoint], normals: &[nalgebra::Vector3<f32>], facets: &[Facet]) -> (Sensor, f64) {
    let samples: Vec<(LocalPoint, [f32; 3])> = points.iter().zip(normals).map(|(p, n)| (*p, (*n).into())).collect();
    let sum: Vector3 = points.iter().map(|p| nalgebra::Vector3::from(*p).cast::<f64>()).sum();
    outer_side(viewing_axis(facets), &samples, &(sum / points.len().max(1) as f64))
}

/// The surface at a place.
struct Fitted {
    /// Its sign is arbitrary.
    normal: nalgebra::Vector3<f32>,
    /// Whether the surface goes on all around.
    is_inner: bool,
    /// Cells with surface within reach,
    cells: usize,
    /// and the points in them.
    points: u32,
}

impl Fitted {
    fn facet(&self) -> Facet {
        Facet { normal: self.normal, density: self.points as f32 }
    }
}

/// The means of the voxels with the surface there, outliers left out.
fn supported(view: &View, edge: f64, reach: f32) -> (Vec<LocalPoint>, Vec<Fitted>) {
    let cells = thin(view.points(), (TUNING.cell * edge) as f32);
    let voxels = thin(&cells.centroids, edge as f32);
    let indexed = IndexedPoints::new(cells.centroids);
    let least_in_voxel = least_in_voxel(&voxels.counts);
    let fitted: Vec<(LocalPoint, Fitted)> = voxels
        .centroids
        .into_iter()
        .zip(&voxels.counts)
        .filter(|(_, count)| f64::from(**count) >= least_in_voxel)
        .map(|(center, _)| (center, fit(&indexed, &cells.counts, &center, reach)))
        .collect();
    let around: Vec<u32> = fitted.iter().map(|f| f.1.cells as u32).collect();
    let least_around = TUNING.outlier_around * typical_count(&around);
    fitted.into_iter().filter(|(_, f)| f.cells as f64 >= least_around).unzip()
}

/// How many voxels of this edge hold more of a scan than outliers.
pub fn count_voxels(points: &[LocalPoint], edge: f64) -> usize {
    let counts = thin(points, edge as f32).counts;
    let least = least_in_voxel(&counts);
    counts.iter().filter(|count| f64::from(**count) >= least).count()
}

/// Voxels with fewer points are outliers.
fn least_in_voxel(counts: &[u32]) -> f64 {
    TUNING.outlier_voxel * typical_count(counts)
}

/// The count of the voxel that the median point lies in: voxels of outliers may be many, but hold few points.
fn typical_count(counts: &[u32]) -> f64 {
    let mut sorted = counts.to_vec();
    sorted.sort_unstable_by(|a, b| b.cmp(a));
    let half = sorted.iter().map(|n| u64::from(*n)).sum::<u64>() / 2;
    let mut sum = 0;
    let reached = sorted.iter().find(|n| {
        sum += u64::from(**n);
        sum >= half
    });
    reached.copied().unwrap_or(0).into()
}

/// Fits the surface at `center` to the cells around, which hold so many points each.
fn fit(cells: &IndexedPoints, counts: &[u32], center: &LocalPoint, reach: f32) -> Fitted {
    let Patch { count, mean, normal } = patch_within(cells, center, reach);
    let mut points = 0;
    cells.tree.for_each_within(center, reach * reach, |n| points += counts[n.index as usize]);
    let (normal, is_inner) = match normal {
        Some(normal) => (normal.cast::<f32>(), mean.norm() < TUNING.rim_offset * reach),
        None => (nalgebra::Vector3::z(), false),
    };
    Fitted { normal, is_inner, cells: count, points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    #[test]
    fn points_anywhere_in_the_box_are_no_surface_that_needs_voxels() {
        // a sheet of 200 x 200 points, and a tenth as many that lie anywhere in a cube about it
        let mut points: Vec<LocalPoint> = (0..40_000).map(|k| [(k % 200) as f32, (k / 200) as f32, 0.0]).collect();
        let of_sheet = count_voxels(&points, 5.0);
        let anywhere = |k: u32, prime: u32| (k * prime % 4_001) as f32 * 0.05;
        points.extend((1..4_001).map(|k| [anywhere(k, 1_231), anywhere(k, 2_111), anywhere(k, 3_137)]));
        let with_outliers = count_voxels(&points, 5.0);
        assert!(thin(&points, 5.0).counts.len() > 2 * of_sheet);
        assert!((0.9..1.05).contains(&(with_outliers as f64 / of_sheet as f64)), "{of_sheet} {with_outliers}");
    }

    fn view(points: impl IntoIterator<Item = Point3>) -> View {
        View::new(&Cloud::from_points(points.into_iter().collect())).expect("a scan that can be used")
    }

    /// A floor of 40 by 40, and a wire over it that is hardly thick.
    fn floor_and_wire() -> View {
        let floor = (0..6400).map(|k| Point3::new(f64::from(k % 80) * 0.5, f64::from(k / 80) * 0.5, 0.0));
        let wire = (0..800).map(|k| {
            let (sine, cosine) = (2.4 * f64::from(k)).sin_cos();
            Point3::new(f64::from(k) * 0.05, 20.0 + 0.05 * cosine, 12.0 + 0.05 * sine)
        });
        view(floor.chain(wire))
    }

    #[test]
    fn who_looks_all_round_saw_only_what_there_is_and_a_camera_missed_the_rest() {
        let view = floor_and_wire();
        let above = |height: f64| Sensor::At(Vector3::new(20.0, 20.0, height) - view.center);
        let is_cropped = |height: f64| CoarseView::new(&view, 2.0, Some(above(height))).depth_image.is_cropped();
        assert!(is_cropped(5.0));
        assert!(!is_cropped(100.0));
    }
}
