//! The poses that came with the scans: in a file of the archive, else in the files of the scans themselves.

use super::archives::Unpacked;
use super::{ArrivalError, Desk};
use visage_domain::PoseFile;
use visage_domain::asset::Asset;
use visage_formats::poses;
use visage_geometry::Motion;

const SEVERAL: &str = "holds poses, as another file does: send the one that is meant as the part `poses`";

/// The only file of the archives that holds poses of some of the scans; several are passed over, since nobody says which
/// is meant. Gives the archives back.
pub(super) async fn find(
    desk: &Desk,
    mut archives: Vec<Unpacked>,
    scans: Vec<String>,
) -> Result<(Vec<Unpacked>, Option<PoseFile>), ArrivalError> {
    if archives.is_empty() {
        return Ok((archives, None));
    }
    desk.work(move |desk| {
        let scans: Vec<&str> = scans.iter().map(String::as_str).collect();
        let mut found = Vec::new();
        for (place, archive) in archives.iter().enumerate() {
            for (name, staged) in archive.others() {
                if staged.bytes > desk.limits.pose_file_bytes as u64 {
                    continue;
                }
                let content = desk.objects.read_staged(staged)?;
                if holds_some(name, &content, &scans) {
                    found.push((place, PoseFile { name: name.clone(), content }));
                }
            }
        }
        if let [(place, file)] = found.as_slice() {
            archives[*place].take(&file.name);
            return Ok((archives, found.pop().map(|(_, file)| file)));
        }
        for (place, file) in found {
            archives[place].leave(&file.name, SEVERAL);
        }
        Ok((archives, None))
    })
    .await
}

/// Whether a file holds the pose of a scan.
fn holds_some(name: &str, content: &[u8], scans: &[&str]) -> bool {
    let file = poses::read_scaled(name, content).and_then(|file| file.named_as(scans));
    file.is_ok_and(|file| file.poses.iter().any(|(scan, _)| scans.contains(&scan.as_str())))
}

/// Poses that files of scans tell, as a pose file.
pub(super) fn of_files(told: &[(String, Motion)]) -> Option<PoseFile> {
    let content = poses::write_of_scan_files(told).into_bytes();
    (!told.is_empty()).then(|| PoseFile { name: Asset::Poses.name().into(), content })
}
