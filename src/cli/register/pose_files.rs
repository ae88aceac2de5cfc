//! Pose files: the one that came with the scans of an archive, and folders with a file for each scan.

use std::path::Path;

use anyhow::Context;

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

/// Files that hold the pose of one scan are smaller.
const POSE_BYTES: u64 = 1 << 20;

/// The poses of a folder with one file of poses a scan.
pub fn read_matrices(path: &Path) -> anyhow::Result<PoseFile> {
    let folder = Folder::list(path)?;
    let mut files = Vec::new();
    for name in folder.names().filter(|name| !name.starts_with('.')) {
        let file = path.join(name);
        if file.metadata().is_ok_and(|data| data.len() <= POSE_BYTES) {
            files.push((name, std::fs::read(&file).with_context(|| format!("reading {}", file.display()))?));
        }
    }
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (*name, bytes.as_slice())).collect();
    poses::read_folder(&files).with_context(|| format!("reading the folder {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_matrices_is_a_pose_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["a.ply", "b.ply", "._b.txt"] {
            std::fs::write(folder.path().join(name), "").expect("written");
        }
        std::fs::write(folder.path().join("b_MATRIX.txt"), "1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n").expect("written");
        let poses = read_matrices(folder.path()).expect("one matrix");
        let poses = Folder::list(folder.path()).expect("listed").fit(None, poses).expect("fits");
        assert_eq!(poses.poses[0].0, "b.ply");
        assert_eq!(poses.said, ["2 file(s) that hold no bare matrices of one scan are passed over, such as a.ply"]);
    }
}
