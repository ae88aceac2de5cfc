//! Folders of depth images, as cameras and phones leave them.

use std::path::Path;

use anyhow::{Context, bail, ensure};

use crate::formats::depth_image::{self, Frame, IntrinsicsOf, Layout};
use crate::formats::{ReadLimits, Reading};

/// More frames than this are a film: neighbours see the same, and all of them take long.
const MOST_FRAMES: usize = 200;

/// The depth images of a folder.
pub struct DepthFolder<'a> {
    path: &'a Path,
    layout: Layout,
}

impl<'a> DepthFolder<'a> {
    /// Looks for depth images in a folder and the folders in it.
    pub fn find(path: &'a Path) -> anyhow::Result<Option<Self>> {
        let mut names = Vec::new();
        for entry in listed(path)? {
            let name = entry.file_name().to_string_lossy().into_owned();
            if entry.path().is_dir() {
                let inner = listed(&entry.path())?;
                names.extend(inner.iter().map(|inner| format!("{name}/{}", inner.file_name().to_string_lossy())));
            } else {
                names.push(name);
            }
        }
        let names: Vec<&str> = names
            .iter()
            .map(String::as_str)
            .filter(|name| !name.split('/').any(|part| part.starts_with('.')))
            .collect();
        let folder = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let folder = folder.file_name().unwrap_or_default().to_string_lossy();
        Ok(depth_image::layout(&folder, &names).map(|layout| DepthFolder { path, layout }))
    }

    /// The images, in natural order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layout.frames.iter().map(|frame| frame.depth.as_str())
    }

    /// What is read, in words.
    pub fn note(&self) -> String {
        let Layout { name, per_metre, frames } = &self.layout;
        let colored = frames.iter().filter(|frame| frame.picture.is_some()).count();
        format!(
            "{} depth images ({name}: {per_metre} to a metre) are read as scans in metres, {colored} of them with colours",
            frames.len()
        )
    }

    /// Refuses a film of which nothing was chosen.
    pub fn check_count(&self) -> anyhow::Result<()> {
        let count = self.layout.frames.len();
        ensure!(
            count <= MOST_FRAMES,
            "{} holds {count} depth images, more than the {MOST_FRAMES} that are registered unasked: choose some that still \
             overlap, such as --scans '*0.png'",
            self.path.display()
        );
        Ok(())
    }

    /// Reads an image of this name.
    pub fn read(&self, name: &str) -> anyhow::Result<Reading> {
        let frame = self.layout.frames.iter().find(|frame| frame.depth == name);
        let Frame { depth, picture, intrinsics } = frame.with_context(|| format!("{name} is no depth image"))?;
        let read = |name: &str| {
            let path = self.path.join(name);
            std::fs::read(&path).with_context(|| format!("reading {}", path.display()))
        };
        let intrinsics = match intrinsics {
            IntrinsicsOf::File(file) => depth_image::read_intrinsics(file, &read(file)?)?,
            IntrinsicsOf::Known(intrinsics) => *intrinsics,
            IntrinsicsOf::Missing => bail!(
                "there are no intrinsics for {name}: put a camera_intrinsic.json with width, height, fx, fy, cx and cy into {}",
                self.path.display()
            ),
        };
        let picture = picture.as_deref().map(read).transpose()?;
        let limits = ReadLimits::default();
        depth_image::read(&read(depth)?, &intrinsics, self.layout.per_metre, picture.as_deref(), &limits)
            .with_context(|| format!("reading {}", self.path.join(name).display()))
    }
}

fn listed(path: &Path) -> anyhow::Result<Vec<std::fs::DirEntry>> {
    let entries = std::fs::read_dir(path).with_context(|| format!("reading the folder {}", path.display()))?;
    entries.map(|entry| entry.with_context(|| format!("reading the folder {}", path.display()))).collect()
}
