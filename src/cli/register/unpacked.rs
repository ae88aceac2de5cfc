//! Archives of scans: they are unpacked, file by file, into a folder that goes when the scans are registered.

use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::formats::archive::{self, ArchiveLimits, Entry};
use crate::formats::{FormatError, ReadLimits};

/// An archive that was unpacked.
pub struct Unpacked {
    /// Goes with all that is in it when this goes.
    place: tempfile::TempDir,
    /// The folder within that holds all files.
    top: PathBuf,
    /// What was passed over, with why.
    passed_over: Vec<(String, &'static str)>,
}

/// What goes wrong while an archive is unpacked.
#[derive(Debug, thiserror::Error)]
enum UnpackError {
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error("writing a file of the archive to {0}: {1}")]
    Write(PathBuf, std::io::Error),
}

impl Unpacked {
    /// Unpacks an archive into a new folder in `beside`: the files may be more than memory holds.
    pub fn new(path: &Path, beside: &Path, limits: &ReadLimits) -> anyhow::Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
        let place = tempfile::Builder::new()
            .prefix(".unpacked")
            .tempdir_in(beside)
            .with_context(|| format!("making a folder in {}", beside.display()))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let mut folders: Option<Vec<String>> = None;
        let keep = |Entry { path, bytes }: Entry| {
            let parents: Vec<&str> = path.split('/').rev().skip(1).collect();
            let parents = parents.into_iter().rev();
            match &mut folders {
                None => folders = Some(parents.map(str::to_owned).collect()),
                Some(common) => {
                    let same = common.iter().zip(parents).take_while(|(a, b)| a == b).count();
                    common.truncate(same);
                }
            }
            write(&place.path().join(&path), &bytes)
        };
        let passed_over = archive::each(&name, &bytes, &ArchiveLimits::of(limits), keep)
            .with_context(|| format!("reading {}", path.display()))?;
        let top = folders.into_iter().flatten().fold(place.path().to_owned(), |top, folder| top.join(folder));
        Ok(Unpacked { place, top, passed_over })
    }

    /// The folder that holds all files.
    pub fn folder(&self) -> &Path {
        debug_assert!(self.top.starts_with(self.place.path()));
        &self.top
    }

    /// What of the archive was passed over, in words.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.passed_over.iter().map(|(path, why)| format!("{path:?} in the archive is passed over: it {why}"))
    }
}

/// Writes a file whose path was checked to be relative and plain.
fn write(path: &Path, bytes: &[u8]) -> Result<(), UnpackError> {
    let failed = |error| UnpackError::Write(path.to_owned(), error);
    path.parent().map_or(Ok(()), std::fs::create_dir_all).map_err(failed)?;
    // a path that is there already would be another file of the archive: not written over
    let mut file = std::fs::File::create_new(path).map_err(failed)?;
    std::io::Write::write_all(&mut file, bytes).map_err(failed)
}

#[cfg(test)]
pub mod testing {
    use std::io::Write;

    /// A zip archive of these files.
    pub fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, content) in files {
            writer.start_file(*name, zip::write::SimpleFileOptions::default()).expect("in memory");
            writer.write_all(content).expect("in memory");
        }
        writer.finish().expect("in memory").into_inner()
    }
}

#[cfg(test)]
mod tests {
    use super::testing::zip;
    use super::*;

    fn unpack(bytes: &[u8]) -> (tempfile::TempDir, anyhow::Result<Unpacked>) {
        let place = tempfile::tempdir().expect("a temporary folder");
        let path = place.path().join("set.zip");
        std::fs::write(&path, bytes).expect("written");
        let limits = ReadLimits { max_bytes: 1 << 20, ..ReadLimits::default() };
        let unpacked = Unpacked::new(&path, place.path(), &limits);
        (place, unpacked)
    }

    fn count(path: &Path) -> usize {
        std::fs::read_dir(path).expect("a folder").count()
    }

    #[test]
    fn files_are_unpacked_below_their_common_folder_and_go_again() {
        let bytes =
            zip(&[("set/a/1.ply", b"1"), ("set/b.json", b"2"), ("__MACOSX/set/._b.json", b"3"), ("set/.c", b"4")]);
        let (place, unpacked) = unpack(&bytes);
        let unpacked = unpacked.expect("sound");
        assert!(unpacked.folder().ends_with("set"));
        assert_eq!(std::fs::read(unpacked.folder().join("a/1.ply")).expect("there"), b"1");
        assert_eq!(count(unpacked.folder()), 2);
        let notes: Vec<String> = unpacked.notes().collect();
        assert_eq!(notes[1], "\"set/.c\" in the archive is passed over: it is hidden");
        drop(unpacked);
        assert_eq!(count(place.path()), 1, "only the archive is left");
    }

    #[test]
    fn hostile_archives_write_nothing_elsewhere_and_leave_nothing() {
        let (place, unpacked) = unpack(&zip(&[("../out.ply", b"1"), ("/abs.ply", b"2"), ("in.ply", b"3")]));
        let unpacked = unpacked.expect("one is sound");
        assert_eq!((count(unpacked.folder()), unpacked.notes().count()), (1, 2));
        drop(unpacked);
        assert_eq!(count(place.path()), 1);
        let large = vec![b' '; (1 << 20) + 1];
        let file = b"in the way".as_slice();
        for (files, expected) in [
            (vec![("a.ply", file), ("A.PLY", file)], "are named"),
            (vec![("a.ply", large.as_slice())], "more than the 1048576 that are allowed"),
            (vec![("a", file), ("a/b.ply", file)], "writing a file of the archive to"),
        ] {
            let (place, unpacked) = unpack(&zip(&files));
            let error = format!("{:#}", unpacked.err().expect(expected));
            assert!(error.contains(expected), "{error}");
            assert_eq!(count(place.path()), 1, "{error}");
        }
    }
}
