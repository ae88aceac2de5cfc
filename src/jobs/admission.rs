//! Which scan sets may become a job: refusing at the door is kinder than failing later.

use std::collections::BTreeSet;

use crate::formats::{FormatError, poses};
use crate::geometry::Motion;
use crate::pipeline::MIN_SCANS;
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
    /// No pose file was given.
    #[error("the scan set has no initial poses")]
    NoInitialPoses,
    /// The pose file can't be read.
    #[error(transparent)]
    Unreadable(#[from] FormatError),
    /// Scans without a pose.
    #[error("{} scan(s) have no initial pose: {}", scans.len(), listed(scans))]
    MissingPoses {
        /// Their names; at least one.
        scans: Vec<String>,
    },
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

/// Whether scans of these names with this pose file can be registered.
pub fn admit(scans: &[&str], file: Option<&PoseFile>) -> Result<PoseFit, AdmissionError> {
    if scans.len() < MIN_SCANS {
        return Err(AdmissionError::TooFewScans { count: scans.len() });
    }
    let fit = fit_poses(scans, file.ok_or(AdmissionError::NoInitialPoses)?)?;
    if fit.scans_without_pose.is_empty() {
        Ok(fit)
    } else {
        Err(AdmissionError::MissingPoses { scans: fit.scans_without_pose })
    }
}

/// The first few names, and how many more there are.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let mut text = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    text
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
    fn poses_are_asked_for() {
        assert_eq!(admit(&["a.ply", "b.ply"], None), Err(AdmissionError::NoInitialPoses));
    }

    #[test]
    fn scans_without_a_pose_are_named() {
        let refused = admit(&["a.ply", "b.ply"], Some(&poses(&["b.ply"]))).expect_err("a.ply has none");
        assert_eq!(refused, AdmissionError::MissingPoses { scans: vec!["a.ply".to_owned()] });
        assert!(refused.to_string().contains("a.ply"));
    }

    #[test]
    fn names_without_a_scan_are_ignored_but_told() {
        let fit = admit(&["a.ply", "b.ply"], Some(&poses(&["b.ply", "c.ply", "a.ply"]))).expect("all have one");
        assert_eq!(fit.unknown_scans, ["c.ply"]);
        let views: Vec<&str> = fit.poses.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(views, ["b.ply", "a.ply"], "the order of the file is the order of the views");
    }

    #[test]
    fn long_lists_are_cut() {
        let names: Vec<String> = (0..7).map(|i| format!("s{i}")).collect();
        assert_eq!(listed(&names), "s0, s1, s2, s3, s4 and 2 more");
    }
}
