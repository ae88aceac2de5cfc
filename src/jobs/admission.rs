//! Which scan sets may become a job: refusing at the door is kinder than failing later.

use std::collections::BTreeSet;

use crate::formats::{FormatError, poses};
use crate::geometry::Motion;
use crate::pipeline::{MIN_SCANS, Method};
use crate::store::PoseFile;

/// Why a scan set can't be registered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AdmissionError {
    /// One scan or none.
    #[error("the scan set holds {count} scan(s); registration needs at least {MIN_SCANS}")]
    TooFewScans {
        /// How many there are.
        count: usize,
    },
    /// A method for a fixed number of scans was given another.
    #[error("the scan set holds {count} scans; method {method} takes exactly {exact}")]
    WrongScanCount {
        /// How many there are.
        count: usize,
        /// The method.
        method: Method,
        /// How many it takes.
        exact: usize,
    },
    /// The pose file can't be read.
    #[error(transparent)]
    Unreadable(#[from] FormatError),
}

/// How a pose file and the scans of a set fit together.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFit {
    /// The poses of the scans that are there, in the order of the file: the order of the views.
    pub poses: Vec<(String, Motion)>,
    /// Names in the pose file for which there is no scan (yet).
    pub unknown_scans: Vec<String>,
    /// Scans that the pose file does not name.
    pub scans_without_pose: Vec<String>,
}

/// Reads a pose file and holds it against the scans.
pub fn fit_poses(scans: &[&str], file: &PoseFile) -> Result<PoseFit, FormatError> {
    let read = poses::read(&file.name, &file.content)?;
    let names: BTreeSet<&str> = scans.iter().copied().collect();
    let (poses, unknown): (Vec<_>, Vec<_>) =
        read.poses.into_iter().partition(|(name, _)| names.contains(name.as_str()));
    let posed: BTreeSet<&str> = poses.iter().map(|(name, _)| name.as_str()).collect();
    let without = scans.iter().filter(|name| !posed.contains(**name)).map(|name| (*name).to_owned()).collect();
    Ok(PoseFit {
        unknown_scans: unknown.into_iter().map(|(name, _)| name).collect(),
        scans_without_pose: without,
        poses,
    })
}

/// Whether a method takes so many scans.
pub fn admit_count(count: usize, method: Method) -> Result<(), AdmissionError> {
    match method.exact_scans() {
        Some(exact) if exact != count => Err(AdmissionError::WrongScanCount { count, method, exact }),
        _ => Ok(()),
    }
}

/// Whether scans of these names with this pose file can be registered. Scans without a pose are placed by their surface.
pub fn admit(scans: &[&str], file: Option<&PoseFile>) -> Result<PoseFit, AdmissionError> {
    if scans.len() < MIN_SCANS {
        return Err(AdmissionError::TooFewScans { count: scans.len() });
    }
    let mut fit = match file {
        Some(file) => fit_poses(scans, file)?,
        None => PoseFit {
            poses: Vec::new(),
            unknown_scans: Vec::new(),
            scans_without_pose: scans.iter().map(|name| (*name).to_owned()).collect(),
        },
    };
    fit.scans_without_pose.sort_by(|a, b| natord::compare(a, b));
    Ok(fit)
}

impl PoseFit {
    /// The scans in the order of the views: as the pose file names them, then the others in natural order.
    pub fn view_order(&self) -> impl Iterator<Item = &str> {
        self.poses.iter().map(|(name, _)| name.as_str()).chain(self.scans_without_pose.iter().map(String::as_str))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

    fn poses(names: &[&str]) -> PoseFile {
        let entries: Vec<String> = names.iter().map(|name| format!("\"{name}\": {IDENTITY}")).collect();
        PoseFile { name: "poses.json".to_owned(), content: format!("{{{}}}", entries.join(",")).into_bytes() }
    }

    #[test]
    fn one_scan_is_too_few_whatever_the_poses() {
        assert_eq!(admit(&[], None), Err(AdmissionError::TooFewScans { count: 0 }));
        assert_eq!(admit(&["a.ply"], Some(&poses(&["a.ply"]))), Err(AdmissionError::TooFewScans { count: 1 }));
    }

    #[test]
    fn scans_without_a_pose_come_last_in_natural_order() {
        let order = |file: Option<&PoseFile>| -> Vec<String> {
            let fit = admit(&["s10.ply", "a.ply", "s9.ply"], file).expect("no pose is needed");
            fit.view_order().map(str::to_owned).collect()
        };
        assert_eq!(order(None), ["a.ply", "s9.ply", "s10.ply"]);
        assert_eq!(order(Some(&poses(&["s10.ply"]))), ["s10.ply", "a.ply", "s9.ply"]);
    }

    #[test]
    fn names_without_a_scan_are_ignored_but_told() {
        let fit = admit(&["a.ply", "b.ply"], Some(&poses(&["b.ply", "c.ply", "a.ply"]))).expect("all have one");
        assert_eq!(fit.unknown_scans, ["c.ply"]);
        let views: Vec<&str> = fit.poses.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(views, ["b.ply", "a.ply"], "the order of the file is the order of the views");
    }
}
