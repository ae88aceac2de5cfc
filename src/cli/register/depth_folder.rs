//! Folders of depth images, as cameras and phones leave them.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use crate::formats::depth_image::{self, Frame, IntrinsicsOf, Layout};
use crate::formats::{ReadLimits, Reading};

/// More frames than this are a film: neighbours see the same, and all of them take long.
const MOST_FRAMES: usize = 200;

/// The depth images of a folder.
pub struct DepthFolder {
    path: PathBuf,
    layout: Layout,
}

impl DepthFolder {
    /// Looks for depth images in a folder and the folders in it.
    pub fn find(path: &Path) -> anyhow::Result<Option<Self>> {
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
        Ok(depth_image::layout(&folder, &names).map(|layout| DepthFolder { path: path.to_owned(), layout }))
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

#[cfg(test)]
mod tests {
    use super::super::folder::Folder;
    use super::*;

    /// A depth image of 8 x 6 pixels at a metre.
    fn depth_png() -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let data: Vec<u8> = (0..48).flat_map(|_| 1000u16.to_be_bytes()).collect();
        encoder.write_header().expect("a header").write_image_data(&data).expect("data");
        bytes
    }

    fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, content) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, content).expect("written");
        }
        folder
    }

    const CAMERA: &[u8] = b"{\"width\": 8, \"height\": 6, \"fx\": 8, \"fy\": 8, \"cx\": 3.5, \"cy\": 2.5}";

    #[test]
    fn depth_images_are_the_scans_of_a_folder_without_others() {
        let png = depth_png();
        let of = folder(&[("depth/10.png", &png), ("depth/9.png", &png), ("camera_intrinsic.json", CAMERA)]);
        let list = Folder::list(of.path()).expect("listed");
        assert_eq!(list.choose(None, None, None).expect("two"), ["depth/9.png", "depth/10.png"]);
        assert_eq!(list.choose(Some("*/9.png"), None, None).expect("a glob"), ["depth/9.png"]);
        assert!(list.depth().is_some_and(|depth| depth.note().starts_with("2 depth images (Open3D: 1000 to a metre)")));
        let reading = list.read("depth/9.png").expect("sound");
        assert_eq!((reading.surface.cloud.len(), reading.surface.cloud.points[0].z), (48, 1.0));
        let poses = crate::formats::poses::read("t.txt", b"0.5 0 0 0 0 0 0 1\n1.5 1 0 0 0 0 0 1\n").expect("sound");
        let poses = list.fit(None, poses).expect("as many");
        assert_eq!(list.choose(None, Some(&poses), None).expect("both"), ["depth/9.png", "depth/10.png"]);
        let with_scan = folder(&[("depth/9.png", &png), ("camera_intrinsic.json", CAMERA), ("a.ply", b"ply")]);
        assert!(Folder::list(with_scan.path()).expect("listed").depth().is_none());
    }

    #[test]
    fn missing_intrinsics_and_films_are_refused_with_the_remedy() {
        let png = depth_png();
        let of = folder(&[("depth/9.png", &png), ("depth.txt", b"9.0 depth/9.png\n")]);
        let error = Folder::list(of.path()).expect("listed").read("depth/9.png").expect_err("unknown").to_string();
        assert!(error.starts_with("there are no intrinsics for depth/9.png: put a camera_intrinsic.json"), "{error}");
        let names: Vec<String> = (0..=MOST_FRAMES).map(|k| format!("depth/{k}.png")).collect();
        let mut files: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
        files.push(("camera_intrinsic.json", CAMERA));
        let of = folder(&files);
        let list = Folder::list(of.path()).expect("listed");
        let error = list.choose(None, None, None).expect_err("too many").to_string();
        assert!(error.contains("holds 201 depth images, more than the 200"), "{error}");
        assert_eq!(list.choose(Some("*00.png"), None, None).expect("some").len(), 2);
    }
}
