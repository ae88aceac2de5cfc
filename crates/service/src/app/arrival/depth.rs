//! Depth images with their intrinsics and pictures, as cameras leave them in an archive.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Desk;
use crate::storage::StagedFile;
use visage_formats::depth_image::{self, Frame, IntrinsicsOf};
use visage_formats::{FormatError, Reading};

/// A depth image that becomes a scan, with what belongs to it.
pub(super) struct DepthScan {
    frame: Frame,
    per_metre: f64,
    /// All files of the layout: intrinsics are shared.
    files: Arc<BTreeMap<String, StagedFile>>,
}

/// The depth images of an archive, if that is what it holds, named as scans; their files are taken out.
pub(super) fn of_archive(archive: &str, files: &mut BTreeMap<String, StagedFile>) -> Option<Vec<(String, DepthScan)>> {
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    let layout = depth_image::layout(archive, &names)?;
    let mut taken = BTreeMap::new();
    let mut take = |name: &String| {
        if let Some((name, file)) = files.remove_entry(name) {
            taken.insert(name, file);
        }
    };
    for Frame { depth, picture, intrinsics } in &layout.frames {
        take(depth);
        picture.iter().for_each(&mut take);
        if let IntrinsicsOf::File(name) = intrinsics {
            take(name);
        }
    }
    let (files, per_metre) = (Arc::new(taken), layout.per_metre);
    let scan = |frame: Frame| {
        // poses of depth images speak of the pictures: their names but for the ending
        let stem = frame.depth.rsplit_once('.').map_or(frame.depth.as_str(), |(stem, _)| stem);
        (format!("{stem}.e57"), DepthScan { files: files.clone(), per_metre, frame })
    };
    Some(layout.frames.into_iter().map(scan).collect())
}

impl DepthScan {
    /// Reads it. Blocks.
    pub fn read(&self, desk: &Desk) -> Result<Reading, super::ArrivalError> {
        let Frame { depth, picture, intrinsics } = &self.frame;
        let bytes = |name: &String| self.files.get(name).map(|file| desk.objects.read_staged(file)).transpose();
        let unreadable = |error| super::ArrivalError::Unreadable { file: depth.clone(), archive: None, error };
        let camera = match intrinsics {
            IntrinsicsOf::File(name) => {
                let text = bytes(name)?.unwrap_or_default();
                depth_image::read_intrinsics(name, &text).map_err(unreadable)?
            }
            IntrinsicsOf::Known(camera) => *camera,
            IntrinsicsOf::Missing => {
                return Err(unreadable(FormatError::Malformed {
                    place: "the archive".into(),
                    problem: "there are no intrinsics for the depth image".into(),
                    remedy: "pack a camera_intrinsic.json with width, height, fx, fy, cx and cy beside the images"
                        .into(),
                }));
            }
        };
        let image = bytes(depth)?.unwrap_or_default();
        let picture = picture.as_ref().map(bytes).transpose()?.flatten();
        let limits = desk.limits.read_limits();
        depth_image::read(&image, &camera, self.per_metre, picture.as_deref(), &limits).map_err(unreadable)
    }
}
