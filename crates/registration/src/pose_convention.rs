//! How given poses are meant, where their file leaves it open: as the surfaces lie on each other.
//!
//! Programs differ in the direction of a pose and in the axes of a camera. Read rightly, the scans lie on each other,
//! roughly at least; read wrongly, they lie anywhere.

use rayon::prelude::*;

use crate::view::{View, common_spacing};
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Motion, PoseConvention};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points that are laid on the other scans: in all, and at least and at most of a scan.
        samples: usize = 3000,
        /// The widest distance at which a point may still lie by another scan's surface, in radii of a scan: initial poses are
        /// rough.
        reach: f64 = 0.1,
        /// Another reading is taken if by it so many times as much lies on other scans. Where both lie on each other about as
        /// well, the surfaces don't tell.
        clearly: f64 = 1.5,
    }
}

const PER_VIEW: (usize, usize) = (20, 300);

/// How poses are read, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The reading that is taken.
    pub read_as: PoseConvention,
    /// The readings that were tried, with the share of the points that lies by other scans, the mean over distances
    /// from the spacing to a tenth of a scan's radius. The first is as the poses stand.
    pub touching: Vec<(PoseConvention, f64)>,
}

/// Chooses between the poses as they stand and `others`. `poses` are scan to world, with `true` for those whose meaning
/// is certain; `None` where a scan has none. With less than two poses nothing can be told.
pub fn choose(
    views: &[View],
    poses: &[Option<(Motion, bool)>],
    others: &[PoseConvention],
    progress: &Progress,
) -> Result<Choice, Canceled> {
    let mut choice = Choice { read_as: PoseConvention::ScanToWorld, touching: Vec::new() };
    let posed: Vec<(&View, Motion, bool)> =
        views.iter().zip(poses).filter_map(|(view, pose)| pose.map(|(pose, certain)| (view, pose, certain))).collect();
    if posed.len() < 2 {
        return Ok(choice);
    }
    let (mut best, spacing) = (0.0, common_spacing(views));
    for convention in [PoseConvention::ScanToWorld].iter().chain(others) {
        // what lies well as it stands can't lie much better otherwise
        if best * TUNING.clearly > 1.0 {
            break;
        }
        let placed: Vec<Placed> = posed
            .iter()
            .map(|(view, pose, certain)| {
                let pose = if *certain { *pose } else { convention.world_from_scan(pose) };
                Placed::new(view, view.local_pose(&pose))
            })
            .collect();
        let share = touching(&placed, spacing, progress)?;
        if choice.touching.is_empty() || share > best * TUNING.clearly {
            (choice.read_as, best) = (*convention, share);
        }
        choice.touching.push((*convention, share));
    }
    Ok(choice)
}

/// A view at a pose.
struct Placed<'a> {
    view: &'a View,
    local_pose: Motion,
    /// How far from its origin a view reaches.
    extent: f64,
}

impl<'a> Placed<'a> {
    fn new(view: &'a View, local_pose: Motion) -> Self {
        let norm2 = |p: &LocalPoint| p.iter().map(|x| x * x).sum::<f32>();
        let extent = f64::from(view.points().iter().map(norm2).fold(0.0, f32::max)).sqrt();
        Placed { view, local_pose, extent }
    }
}

/// The share of the points that lies by another scan, the mean over the octaves of distance.
fn touching(placed: &[Placed], spacing: f64, progress: &Progress) -> Result<f64, Canceled> {
    let mut radii: Vec<f64> = placed.iter().map(|placed| placed.view.radius).collect();
    radii.sort_unstable_by(f64::total_cmp);
    let spacing = spacing.max(f64::MIN_POSITIVE);
    let widest = (TUNING.reach * radii[radii.len() / 2] / spacing).max(1.0).log2().floor();
    let reaches: Vec<f32> = (0..=widest as i32).map(|octave| (spacing * 2f64.powi(octave)) as f32).collect();
    let samples = (TUNING.samples / placed.len()).clamp(PER_VIEW.0, PER_VIEW.1);
    let counted: Vec<[usize; 2]> = (0..placed.len())
        .into_par_iter()
        .map(|i| {
            progress.check()?;
            Ok(touched(placed, i, samples, &reaches))
        })
        .collect::<Result<_, Canceled>>()?;
    let [touched, all] = counted.iter().fold([0, 0], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
    Ok(touched as f64 / all.max(1) as f64)
}

/// For the sampled points of view `i` and each of the reaches: how many lie within it of another view, and how many there are.
fn touched(placed: &[Placed], i: usize, samples: usize, reaches: &[f32]) -> [usize; 2] {
    let reach = reaches.last().copied().unwrap_or(0.0);
    let of = &placed[i];
    let others: Vec<(&View, nalgebra::Isometry3<f32>)> = placed
        .iter()
        .enumerate()
        .filter(|(j, other)| {
            let apart = (of.local_pose.translation.vector - other.local_pose.translation.vector).norm();
            *j != i && apart <= of.extent + other.extent + f64::from(reach)
        })
        .map(|(_, other)| (other.view, other.local_pose.inv_mul(&of.local_pose).cast::<f32>()))
        .collect();
    let points = of.view.points();
    let sampled = || points.iter().step_by(points.len().div_ceil(samples).max(1));
    let touched = sampled().map(|point| {
        // what is found is nearer than the widest reach, in the same precision: nothing found counts for no reach
        let nearest2 = others.iter().fold(reach * reach, |nearest2, (view, j_from_i)| {
            let moved = j_from_i * nalgebra::Point3::from(*point);
            view.indexed.tree.nearest(&moved.coords.into(), nearest2).map_or(nearest2, |found| found.distance2)
        });
        reaches.iter().filter(|reach| nearest2 < *reach * *reach).count()
    });
    [touched.sum(), sampled().count() * reaches.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3, Vector3};

    /// Four sides of a bumpy egg, each in its own frame, and their poses.
    fn sides() -> (Vec<View>, Vec<Motion>) {
        let bump = |a: f64, b: f64| 100.0 + 12.0 * (3.0 * a).sin() * (2.0 * b).cos() + 20.0 * b.sin();
        let point = |a: f64, b: f64| {
            Point3::new(
                bump(a, b) * a.cos() * b.cos(),
                0.8 * bump(a, b) * a.sin() * b.cos(),
                1.3 * bump(a, b) * b.sin(),
            )
        };
        let poses: Vec<Motion> = (0..4)
            .map(|k| Motion::new(Vector3::new(300.0, 40.0 * f64::from(k), -20.0), Vector3::z() * 1.3 * f64::from(k)))
            .collect();
        let view = |(k, pose): (usize, &Motion)| {
            let place = |i: usize| point(1.3 * k as f64 + 0.02 * (i % 100) as f64, -1.0 + 0.02 * (i / 100) as f64);
            let cloud = Cloud::from_points((0..10_000).map(|i| pose.inverse() * place(i)).collect());
            View::new(&cloud).expect("it can be used")
        };
        (poses.iter().enumerate().map(view).collect(), poses)
    }

    fn chosen(views: &[View], poses: &[Motion], others: &[PoseConvention]) -> Choice {
        let poses: Vec<_> = poses.iter().map(|pose| Some((*pose, false))).collect();
        choose(views, &poses, others, &Progress::silent()).expect("not canceled")
    }

    #[test]
    fn the_surfaces_say_which_way_poses_are_meant() {
        let (views, poses) = sides();
        let all = [PoseConvention::WorldToScan, PoseConvention::OpenGlCamera];
        assert_eq!(chosen(&views, &poses, &all).read_as, PoseConvention::ScanToWorld);
        let inverted: Vec<Motion> = poses.iter().map(Motion::inverse).collect();
        let choice = chosen(&views, &inverted, &all);
        assert_eq!(choice.read_as, PoseConvention::WorldToScan, "{choice:?}");
        // half a turn about x is its own inverse
        let cameras: Vec<Motion> = poses.iter().map(|p| PoseConvention::OpenGlCamera.world_from_scan(p)).collect();
        let choice = chosen(&views, &cameras, &all);
        assert_eq!(choice.read_as, PoseConvention::OpenGlCamera, "{choice:?}");
        assert_eq!(choice.touching.len(), 3);
    }

    #[test]
    fn rough_poses_are_read_as_they_are_meant() {
        let (views, poses) = sides();
        let turn =
            |k: f64| Motion::new(Vector3::new(4.0, -5.0, 3.0) * k.sin(), Vector3::new(0.03, 0.05, -0.04) * k.cos());
        let rough: Vec<Motion> = poses.iter().zip(0..).map(|(pose, k)| pose * turn(f64::from(k))).collect();
        let others = [PoseConvention::WorldToScan];
        assert_eq!(chosen(&views, &rough, &others).read_as, PoseConvention::ScanToWorld);
        let inverted: Vec<Motion> = rough.iter().map(Motion::inverse).collect();
        assert_eq!(chosen(&views, &inverted, &others).read_as, PoseConvention::WorldToScan);
    }

    #[test]
    fn scans_that_are_far_apart_touch_nowhere() {
        let (views, poses) = sides();
        let apart: Vec<Placed> = (0..4)
            .map(|k| {
                Placed::new(&views[k], Motion::translation(1e4 * k as f64, 0.0, 0.0) * views[k].local_pose(&poses[k]))
            })
            .collect();
        for step in 1..50 {
            let share = touching(&apart, 0.37 * f64::from(step), &Progress::silent()).expect("not canceled");
            assert_eq!(share, 0.0, "{step}");
        }
    }

    #[test]
    fn certain_poses_stay_and_one_pose_tells_nothing() {
        let (views, poses) = sides();
        let given: Vec<_> = poses
            .iter()
            .enumerate()
            .map(|(k, pose)| Some(if k < 2 { (*pose, true) } else { (pose.inverse(), false) }))
            .collect();
        let others = [PoseConvention::WorldToScan];
        let choice = choose(&views, &given, &others, &Progress::silent()).expect("not canceled");
        assert_eq!(choice.read_as, PoseConvention::WorldToScan);
        let one = [given[0], None, None, None];
        let choice = choose(&views, &one, &others, &Progress::silent()).expect("not canceled");
        assert_eq!((choice.read_as, choice.touching.len()), (PoseConvention::ScanToWorld, 0));
    }
}
