//! A scan made ready for registration: recentred, indexed, measured.

use rayon::prelude::*;

use crate::sensor::Sensor;
use crate::sensor::viewpoint::{self, PointShare};
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals;
use visage_geometry::thinning::representatives;
use visage_geometry::{Cloud, Motion, Point3, Surface, Vector3, organised};

/// A view in its local frame: the scan's own frame shifted so that the scan's centroid is the origin (with specks that
/// were left out since).
#[derive(Debug, Clone)]
pub struct View {
    /// Positions in the local frame, in the scan's order and unit, with their tree.
    pub indexed: IndexedPoints,
    /// The scan's centroid in the scan's frame: `p_scan = p_local + center`.
    pub center: Vector3,
    /// Spacing L_r: median distance of a point from its nearest distinct neighbour.
    pub spacing: f64,
    /// Range accuracy estimate: median residual of local planes, a length.
    pub range_accuracy: f64,
    /// Root mean square distance of the points from the centroid.
    pub radius: f64,
    /// What the scan's coordinates were multiplied by to get those here: 1 unless scanners disagree in unit.
    pub scale: f64,
    /// L_r of an organised scan: the distance of points seen by pixels side by side. Larger than `spacing`, for which
    /// the nearer of all neighbours counts.
    pub resolution: Option<f64>,
    /// Where the scanner stood (local frame): as the file says, or the origin of the scan's frame where the scan shows that
    /// it was taken from there.
    pub sensor: Option<Sensor>,
}

/// Why a scan can't be registered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum UnusableScan {
    /// Too few points to find correspondences with.
    #[error("it has {0} points, at least {MIN_POINTS} are needed")]
    TooFewPoints(usize),
    /// All points in one place or on one line.
    #[error("its points lie in one place or on one line, so no pose can be found for it")]
    NoExtent,
}

/// The least points of a scan.
pub const MIN_POINTS: usize = 50;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points at which spacing and noise are measured.
        samples: usize = 600,
        /// The largest share of a scan that is specks.
        specks: f64 = 0.01,
        /// Samples measured one after the other.
        chunk: usize = 150,
        /// The next sample's neighbours are sought within so many times the squared distance of this one's.
        guess: f32 = 1.4,
    }
}

impl View {
    /// Prepares a scan; points must be finite.
    pub fn new(cloud: &Cloud) -> Result<Self, UnusableScan> {
        if cloud.len() < MIN_POINTS {
            return Err(UnusableScan::TooFewPoints(cloud.len()));
        }
        let center = cloud.centroid().coords;
        let points: Vec<LocalPoint> = cloud.points.iter().map(|p| (p.coords - center).cast::<f32>().into()).collect();
        let (radius, second_spread) = spreads(&points);
        if second_spread <= radius * 1e-6 {
            return Err(UnusableScan::NoExtent);
        }
        let indexed = IndexedPoints::new(points);
        let samples = evenly_sampled(&indexed.points, TUNING.samples);
        let origin = -center;
        let Measured { mut distances2, mut residuals, shares } = neighbourhoods(&indexed, &samples, &origin);
        let spacing = f64::from(median(&mut distances2).ok_or(UnusableScan::NoExtent)?).sqrt();
        let range_accuracy = f64::from(median(&mut residuals).unwrap_or(0.0));
        let is_viewpoint = viewpoint::is_even(&shares) && viewpoint::is_single(&indexed.points, &origin);
        let sensor = is_viewpoint.then_some(Sensor::At(origin));
        Ok(View { indexed, center, spacing, range_accuracy, radius, scale: 1.0, resolution: None, sensor })
    }

    /// Prepares a scan with what its grid tells, if it has one.
    pub fn of(surface: &Surface) -> Result<Self, UnusableScan> {
        let resolution = surface.grid.as_ref().and_then(|grid| organised::resolution(grid, &surface.cloud));
        let view = View::new(&surface.cloud)?;
        let told = surface.sensor.map(|position| Sensor::At(position.coords - view.center));
        Ok(View { resolution, sensor: told.or(view.sensor), ..view })
    }

    /// Leaves out the points for which `kept` does not hold, if they are a few specks: these change neither what was
    /// measured nor the frame. Otherwise nothing is done and the answer is false: the view is to be made anew.
    pub fn leave_specks_out(&mut self, kept: &[bool]) -> bool {
        let gone = kept.iter().filter(|kept| !**kept).count();
        let is_few = gone as f64 <= TUNING.specks * kept.len() as f64 && kept.len() - gone >= MIN_POINTS;
        if is_few {
            self.indexed.keep(kept);
        }
        is_few
    }

    /// Positions in the local frame, in the scan's order and unit.
    pub fn points(&self) -> &[LocalPoint] {
        &self.indexed.points
    }

    /// Points spread evenly over the surface: those nearest to the means of voxels of edge `edge`.
    pub fn sampled(&self, edge: f64) -> Vec<LocalPoint> {
        representatives(self.points(), edge as f32).iter().map(|index| self.points()[*index as usize]).collect()
    }

    /// The pose of the local frame that belongs to a pose of the (scaled) scan.
    pub fn local_pose(&self, pose_world: &Motion) -> Motion {
        pose_world * nalgebra::Translation3::from(self.center)
    }

    /// The pose of the (scaled) scan that belongs to a pose of the local frame.
    pub fn scan_pose(&self, local_pose_world: &Motion) -> Motion {
        local_pose_world * nalgebra::Translation3::from(-self.center)
    }

    /// The position of a point in the scan's own frame.
    pub fn in_scan_frame(&self, index: usize) -> Point3 {
        Point3::from((nalgebra::Vector3::from(self.points()[index]).cast::<f64>() + self.center) / self.scale)
    }

    /// The view with all its lengths multiplied by `factor`, about the origin of the scan's frame.
    pub fn scaled(self, factor: f64) -> View {
        if factor == 1.0 {
            return self;
        }
        let grown = |x: f32| (f64::from(x) * factor) as f32;
        View {
            indexed: IndexedPoints::new(self.points().iter().map(|p| p.map(grown)).collect()),
            center: self.center * factor,
            spacing: self.spacing * factor,
            range_accuracy: self.range_accuracy * factor,
            radius: self.radius * factor,
            scale: self.scale * factor,
            resolution: self.resolution.map(|resolution| resolution * factor),
            sensor: self.sensor.map(|sensor| match sensor {
                Sensor::At(position) => Sensor::At(position * factor),
                far => far,
            }),
        }
    }
}

/// `count` points spread evenly over the sequence.
fn evenly_sampled(points: &[LocalPoint], count: usize) -> Vec<LocalPoint> {
    let count = count.min(points.len());
    (0..count).map(|k| points[k * points.len() / count]).collect()
}

/// What is measured at some places of a scan.
struct Measured {
    /// Squared distances of the nearest neighbour that is no duplicate, where there is one.
    distances2: Vec<f32>,
    /// Residuals of the local planes.
    residuals: Vec<f32>,
    /// What a point stands for, seen from an eye.
    shares: Vec<PointShare>,
}

/// Measures the surroundings of samples: all from one search.
fn neighbourhoods(indexed: &IndexedPoints, samples: &[LocalPoint], eye: &Vector3) -> Measured {
    let measured: Vec<(Option<f32>, f32, Option<PointShare>)> = samples
        .par_chunks(TUNING.chunk)
        .flat_map_iter(|samples| {
            // most of a scan is about as dense: a good guess, the same for any threads
            let (mut found, mut guess2) = (Vec::new(), 0.0f32);
            samples.iter().map(move |sample| {
                indexed.tree.k_nearest_unordered(sample, normals::NEIGHBOURS, guess2, &mut found);
                let distances2 = || found.iter().map(|n| n.distance2);
                guess2 = TUNING.guess * distances2().fold(0.0, f32::max);
                let nearest2 = distances2().filter(|d| *d > 0.0).min_by(f32::total_cmp);
                let share = PointShare::of(&indexed.points, sample, &found, eye);
                (nearest2, normals::plane_through(&indexed.points, &found).rms, share)
            })
        })
        .collect();
    Measured {
        distances2: measured.iter().filter_map(|(nearest2, ..)| *nearest2).collect(),
        residuals: measured.iter().map(|(_, residual, _)| *residual).collect(),
        shares: measured.iter().filter_map(|(.., share)| *share).collect(),
    }
}

/// The lower median; `None` of nothing.
pub(crate) fn median(values: &mut [f32]) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let middle = (values.len() - 1) / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// The root mean square distance from the origin, and the spread along the second principal axis.
fn spreads(points: &[LocalPoint]) -> (f64, f64) {
    let mut scatter = nalgebra::Matrix3::<f64>::zeros();
    for point in points {
        let d = nalgebra::Vector3::from(*point).cast::<f64>();
        scatter += d * d.transpose();
    }
    scatter /= points.len() as f64;
    let mut eigenvalues: Vec<f64> = scatter.symmetric_eigenvalues().iter().copied().collect();
    eigenvalues.sort_by(f64::total_cmp);
    (scatter.trace().sqrt(), eigenvalues[1].max(0.0).sqrt())
}

/// The median spacing of the views: the length to which tolerances are tied.
pub fn common_spacing(views: &[View]) -> f64 {
    median_spacing(views)
}

/// The same of any views, such as those that are placed; 0 of none.
pub fn median_spacing<'a>(views: impl IntoIterator<Item = &'a View>) -> f64 {
    let mut spacings: Vec<f64> = views.into_iter().map(|view| view.spacing).collect();
    spacings.sort_by(f64::total_cmp);
    spacings.get(spacings.len() / 2).copied().unwrap_or(0.0)
}

/// The largest of the views' radii: turned into a length by it, a turn moves no typical point farther.
pub fn largest_radius(views: &[View]) -> f64 {
    views.iter().map(|view| view.radius).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(step: f64) -> Cloud {
        Cloud::from_points(
            (0..400).map(|i| Point3::new(1e4 + (i % 20) as f64 * step, (i / 20) as f64 * step, 7.0)).collect(),
        )
    }

    #[test]
    fn spacing_of_a_grid_is_its_step_and_duplicates_do_not_count() {
        let mut cloud = sheet(0.25);
        cloud.points.extend(cloud.points.clone());
        let view = View::new(&cloud).expect("a sheet can be used");
        assert!((view.spacing - 0.25).abs() < 1e-6);
        assert!(view.range_accuracy < 1e-6);
    }

    #[test]
    fn local_and_scan_poses_are_inverse() {
        let view = View::new(&sheet(1.0)).expect("a sheet can be used");
        let pose = Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.2, 0.3));
        let back = view.scan_pose(&view.local_pose(&pose));
        assert!((back.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-9);
        let local = view.local_pose(&pose) * Point3::from(nalgebra::Vector3::from(view.points()[5]).cast::<f64>());
        assert!((local - pose * sheet(1.0).points[5]).norm() < 1e-3);
    }

    #[test]
    fn lines_single_places_and_handfuls_are_refused() {
        let line = Cloud::from_points((0..100).map(|i| Point3::new(i as f64, 2.0 * i as f64, 0.0)).collect());
        assert_eq!(View::new(&line).err(), Some(UnusableScan::NoExtent));
        let place = Cloud::from_points(vec![Point3::new(1.0, 2.0, 3.0); 100]);
        assert_eq!(View::new(&place).err(), Some(UnusableScan::NoExtent));
        let few = Cloud::from_points(vec![Point3::origin(); 3]);
        assert_eq!(View::new(&few).err(), Some(UnusableScan::TooFewPoints(3)));
    }
}
