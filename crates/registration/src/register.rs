//! Registration in one call, for programs that use this crate as a library. What a service does beside it, such as leaving
//! turntables and floors out, is not done here; see [`crate::cleaning`].

use rayon::prelude::*;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Motion, Surface, Vector3};

use crate::conclusion::Circumstances;
use crate::global::scan_set::{Registered, Set};
use crate::hinted::Hinted;
use crate::method::Method;
use crate::outcome::MethodOptions;
use crate::quality::Verdict;
use crate::sensor::Sensor;
use crate::view::{UnusableScan, View};

/// Scans that were registered with each other.
#[derive(Debug, Clone)]
pub struct Registration {
    /// For each scan its pose: the scan's frame to the world, which is that of most poses given, else the frame of the first
    /// placed scan; `None` where it has no place among the others.
    pub world_from_scan: Vec<Option<Motion>>,
    /// For each scan the probability that its pose is right, where poses were found by the scans alone.
    pub confidences: Option<Vec<f64>>,
    /// How good the poses are, and why they are not better.
    pub verdict: Verdict,
}

/// Why scans were not registered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegisterError {
    /// There is nothing to register.
    #[error("{0} scan(s) given, at least 2 are needed")]
    TooFewScans(usize),
    /// Poses were given for another number of scans.
    #[error("{poses} poses given for {scans} scans: give one a scan, `None` where it is not known")]
    OtherPoses {
        /// Poses given.
        poses: usize,
        /// Scans given.
        scans: usize,
    },
    /// A scan can't be used.
    #[error("scan {scan} can't be used: {reason}")]
    Unusable {
        /// Its place in the list.
        scan: usize,
        /// Why.
        reason: UnusableScan,
    },
    /// The caller asked for a stop.
    #[error(transparent)]
    Canceled(#[from] Canceled),
}

/// Registers scans, in one unit, whatever it is. `given` holds for each scan its pose, roughly (scan to world), or `None`;
/// where it is missing, or too far off, it is found by the scans' surface. Runs inside the caller's rayon pool; the same scans
/// give the same poses for any number of threads.
///
/// ```
/// use visage_geometry::{Cloud, Motion, Point3, Surface, Vector3, progress::Progress};
/// use visage_registration::{method::Method, register::register};
///
/// let hill = |x: f64, y: f64| (0.4 * x).sin() * (0.3 * y).cos() + 0.05 * x * y * (0.02 * x).cos();
/// let patch = |from: f64| {
///     let place = |k: usize| (from + 0.2 * (k % 80) as f64, 0.2 * (k / 80) as f64);
///     Cloud::from_points((0..6400).map(place).map(|(x, y)| Point3::new(x, y, hill(x, y))).collect())
/// };
/// let turn = Motion::new(Vector3::new(3.0, 1.0, 0.0), Vector3::new(0.1, 0.2, 0.0));
/// let scans = [patch(0.0), patch(4.0).moved(&turn)].map(|cloud| Surface { cloud, ..Surface::default() });
///
/// let roughly = [Some(Motion::identity()), Some(Motion::identity())];
/// let registered = register(&scans, &roughly, Method::Joint, &Progress::silent())?;
/// let pose = registered.world_from_scan[1].ok_or("it has a place")?;
/// assert!((pose * turn).translation.vector.norm() < 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`RegisterError`]: which scan can't be used, and why.
pub fn register(
    scans: &[Surface],
    given: &[Option<Motion>],
    method: Method,
    progress: &Progress,
) -> Result<Registration, RegisterError> {
    if scans.len() < 2 {
        return Err(RegisterError::TooFewScans(scans.len()));
    }
    if given.len() != scans.len() {
        return Err(RegisterError::OtherPoses { poses: given.len(), scans: scans.len() });
    }
    let prepared: Vec<Result<View, UnusableScan>> = scans.par_iter().with_max_len(1).map(View::of).collect();
    let mut views = Vec::with_capacity(scans.len());
    for (scan, view) in prepared.into_iter().enumerate() {
        views.push(view.map_err(|reason| RegisterError::Unusable { scan, reason })?);
    }
    let names: Vec<String> = (0..scans.len()).map(|scan| format!("scan {scan}")).collect();
    let sensors: Vec<Option<Sensor>> = views.iter().map(|view| view.sensor).collect();
    let given: Vec<Option<Motion>> =
        given.iter().zip(&views).map(|(pose, view)| Some(view.local_pose(pose.as_ref()?))).collect();
    let hinted = Hinted::default();
    let set = Set { names: &names, views: &views, given: &given, sensors: &sensors, hinted: &hinted, turning: None };
    let options = MethodOptions::default();
    let refine = |views: &[View], poses: &[Motion]| method.register(views, poses, &options, progress);
    let mut registered = set.register(&refine, progress)?;
    let positions: Vec<Option<Vector3>> =
        sensors.iter().map(|sensor| sensor.and_then(|sensor| sensor.position())).collect();
    let circumstances = Circumstances { positions: &positions, ..Circumstances::default() };
    let verdict = registered.conclude(&views, &names, &circumstances).verdict;
    let Registered { result, placement, .. } = registered;
    let poses = views.iter().zip(result.local_poses.iter().zip(&result.placed));
    Ok(Registration {
        world_from_scan: poses.map(|(view, (pose, placed))| placed.then(|| view.scan_pose(pose))).collect(),
        confidences: placement.confidences().map(<[f64]>::to_vec),
        verdict,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    fn scan(points: usize) -> Surface {
        let place = |k: usize| Point3::new((k % 10) as f64, (k / 10) as f64, ((k * k) % 7) as f64);
        Surface { cloud: Cloud::from_points((0..points).map(place).collect()), ..Surface::default() }
    }

    #[test]
    fn what_can_not_be_registered_is_named() {
        let register = |scans: &[Surface], poses: usize| {
            register(scans, &vec![None; poses], Method::Joint, &Progress::silent()).map(|_| ()).expect_err("refused")
        };
        assert_eq!(register(&[scan(100)], 1), RegisterError::TooFewScans(1));
        assert_eq!(register(&[scan(100), scan(100)], 1), RegisterError::OtherPoses { poses: 1, scans: 2 });
        let error = register(&[scan(100), scan(3)], 2);
        assert_eq!(error.to_string(), "scan 1 can't be used: it has 3 points, at least 50 are needed");
    }
}
