//! The pose file that came with the scans of an archive.

use std::path::Path;

use super::folder::Folder;
use crate::formats::poses::{self, PoseFile};

/// Larger files are no pose files.
const MOST_BYTES: u64 = 16 << 20;

/// The only file beside the scans that holds poses of some of them, and its name; if there are several, a note says so.
pub fn find(folder: &Folder, scans: &[String]) -> (Option<(String, PoseFile)>, Option<String>) {
    let scans: Vec<&str> = scans.iter().map(String::as_str).collect();
    let read = |(name, path): (&str, std::path::PathBuf)| Some((name.to_owned(), fitting(name, &path, &scans)?));
    let mut found: Vec<(String, PoseFile)> = folder.other_files().filter_map(read).collect();
    if found.len() > 1 {
        let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
        let names = names.join(", ");
        return (
            None,
            Some(format!("no poses are used, since several files hold some ({names}): give one with --poses")),
        );
    }
    (found.pop(), None)
}

/// The poses of a file, if it holds any of these scans.
fn fitting(name: &str, path: &Path, scans: &[&str]) -> Option<PoseFile> {
    let is_small = path.metadata().is_ok_and(|data| data.len() <= MOST_BYTES);
    let bytes = is_small.then(|| std::fs::read(path).ok()).flatten()?;
    let mut file = poses::read_scaled(name, &bytes).ok()?.named_as(scans).ok()?;
    // poses of scans that were not packed, too, are of no use
    let is_there = |scan: &String| scans.contains(&scan.as_str());
    file.poses.retain(|(scan, _)| is_there(scan));
    file.scales.retain(|scan, _| is_there(scan));
    (!file.poses.is_empty()).then_some(file)
}
