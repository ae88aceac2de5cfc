//! What of the files that are named goes to the service, and in which way.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use crate::formats::archive::{self, ZipWriter};
use crate::formats::{self, Format, Reader};

/// Scans to be sent, by name.
pub(super) enum Parcel {
    /// Scans of which each is a file: sent one by one, so that what was sent is sent.
    OneByOne { scans: BTreeMap<String, PathBuf>, passed_over: Vec<String> },
    /// One archive, which the service takes apart.
    Archive { name: String, path: PathBuf, _packed: Option<tempfile::TempPath> },
}

impl Parcel {
    /// Of the files and folders that are named. What needs more than one file to be understood (depth images, textures) and
    /// what holds several scans goes as an archive.
    pub(super) fn of(paths: &[PathBuf]) -> anyhow::Result<Parcel> {
        if let [path] = paths
            && path.is_file()
            && archive::is_archive(&file_name(path)?)
        {
            return Ok(Parcel::Archive { name: file_name(path)?, path: path.clone(), _packed: None });
        }
        let files = list(paths)?;
        let names: Vec<&str> = files.keys().map(String::as_str).collect();
        let is_scan = formats::scan_files(&names);
        let scans = || names.iter().zip(&is_scan).filter(|(_, is_scan)| **is_scan).map(|(name, _)| *name);
        let has_textures = names.iter().any(|name| formats::extension(name) == "mtl");
        let whole = |name: &str| {
            Format::of_ending(&formats::extension(name))
                .is_none_or(|format| matches!(format.reader, Reader::Surface(_)))
        };
        if scans().next().is_some()
            && !has_textures
            && scans().all(whole)
            && !names.iter().any(|n| archive::is_archive(n))
        {
            let chosen: Vec<String> = scans().map(str::to_owned).collect();
            let passed_over = names.iter().filter(|name| !chosen.iter().any(|scan| scan == *name));
            let passed_over = passed_over.map(|name| (*name).to_owned()).collect();
            let scans = files.into_iter().filter(|(name, _)| chosen.contains(name)).collect();
            return Ok(Parcel::OneByOne { scans, passed_over });
        }
        ensure!(!files.is_empty(), "there are no files in {}", shown(paths));
        let packed = pack(&files)?;
        Ok(Parcel::Archive { name: "scans.zip".to_owned(), path: packed.to_path_buf(), _packed: Some(packed) })
    }
}

/// All files by name: those of folders by their paths from the folder on. Hidden ones are left out.
fn list(paths: &[PathBuf]) -> anyhow::Result<BTreeMap<String, PathBuf>> {
    let mut files = BTreeMap::new();
    for path in paths {
        let found = if path.is_dir() { in_folder(path, "")? } else { vec![(file_name(path)?, path.clone())] };
        for (name, path) in found {
            if let Some(other) = files.insert(name.clone(), path.clone()) {
                bail!("{} and {} have one name, {name}: rename one", other.display(), path.display());
            }
        }
    }
    Ok(files)
}

fn in_folder(folder: &Path, prefix: &str) -> anyhow::Result<Vec<(String, PathBuf)>> {
    let mut files = Vec::new();
    let reading = || format!("reading the folder {}", folder.display());
    for entry in std::fs::read_dir(folder).with_context(reading)? {
        let entry = entry.with_context(reading)?;
        let path = entry.path();
        let name = file_name(&path)?;
        if name.starts_with('.') {
            continue;
        }
        let name = format!("{prefix}{name}");
        // a link to a folder may lead around in a circle
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            files.extend(in_folder(&path, &format!("{name}/"))?);
        } else if path.is_file() {
            files.push((name, path));
        }
    }
    Ok(files)
}

fn file_name(path: &Path) -> anyhow::Result<String> {
    let name = path.file_name().with_context(|| format!("{} is no file", path.display()))?;
    let name = name.to_str().with_context(|| format!("the name of {} is not UTF-8: rename it", path.display()))?;
    Ok(name.to_owned())
}

fn shown(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Packs files into an archive beside other temporary files; it goes with what is given back.
fn pack(files: &BTreeMap<String, PathBuf>) -> anyhow::Result<tempfile::TempPath> {
    let place = tempfile::NamedTempFile::new().context("making a file for the archive")?;
    let (file, path) = place.into_parts();
    let mut zip = ZipWriter::new(std::io::BufWriter::new(file));
    for (name, path) in files {
        let content = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
        zip.add(name, &content).with_context(|| format!("packing {name}"))?;
    }
    let file: File = zip.finish()?.into_inner().map_err(|error| error.into_error())?;
    drop(file);
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for name in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, name).expect("written");
        }
        folder
    }

    fn parcel(files: &[&str]) -> (tempfile::TempDir, Parcel) {
        let folder = folder(files);
        let parcel = Parcel::of(&[folder.path().to_owned()]).expect("listed");
        (folder, parcel)
    }

    #[test]
    fn plain_scans_go_one_by_one_and_what_is_left_is_named() {
        let (_folder, parcel) = parcel(&["b.ply", "front/a.ply", "notes.doc", ".hidden.ply"]);
        let Parcel::OneByOne { scans, passed_over } = parcel else { panic!("an archive") };
        assert_eq!(scans.keys().collect::<Vec<_>>(), ["b.ply", "front/a.ply"]);
        assert_eq!(passed_over, ["notes.doc"]);
    }

    #[test]
    fn files_that_need_each_other_go_as_one_archive() {
        for files in [&["room.e57"][..], &["a.obj", "a.mtl"], &["depth/0001.png", "camera_intrinsic.json"]] {
            let (_folder, parcel) = parcel(files);
            let Parcel::Archive { path, .. } = &parcel else { panic!("{files:?}: one by one") };
            let bytes = std::fs::read(path).expect("packed");
            let limits = archive::ArchiveLimits::of(&formats::ReadLimits::default());
            assert_eq!(archive::entries("scans.zip", &bytes, &limits).expect("sound").entries.len(), files.len());
            let path = path.clone();
            drop(parcel);
            assert!(!path.exists(), "it goes when it is sent");
        }
    }

    #[test]
    fn two_files_of_one_name_are_refused() {
        let (a, b) = (folder(&["s.ply"]), folder(&["s.ply"]));
        let error = Parcel::of(&[a.path().to_owned(), b.path().to_owned()]).err().expect("refused");
        assert!(error.to_string().contains("have one name, s.ply: rename one"), "{error}");
    }
}
