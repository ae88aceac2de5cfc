//! Files that hold several scans (E57, PTX): each is a scan of its own, with the pose that its file gives it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::formats::{self, ReadLimits, Reader, Reading, ScanReading};
use crate::geometry::Motion;

/// The scans of files that hold several, read and not asked for yet.
#[derive(Default)]
pub struct Unfolded {
    /// By name, until they are taken.
    readings: Mutex<BTreeMap<String, Reading>>,
    /// Scan and file.
    names: Vec<(String, String)>,
    /// By scan: where the file says that it is.
    poses: BTreeMap<String, Motion>,
}

impl Unfolded {
    /// Reads those of `files` that may hold several scans. One that can't be read is left: whoever wants it will see
    /// why. No scan gets the name of one of `others`.
    pub fn read(folder: &Path, files: &[String], others: &[&str]) -> Self {
        let read: Vec<(&String, Vec<ScanReading>)> = files
            .par_iter()
            .filter(|file| formats::check_name(file).is_ok_and(|format| matches!(format.reader, Reader::Scans(_))))
            .filter_map(|file| {
                let bytes = std::fs::read(folder.join(file)).ok()?;
                Some((file, formats::read_scans(file, &bytes, &ReadLimits::default()).ok()?))
            })
            .collect();
        Unfolded::of(read, others)
    }

    fn of(read: Vec<(&String, Vec<ScanReading>)>, others: &[&str]) -> Self {
        let own =
            |scans: &[ScanReading]| -> Vec<Option<String>> { scans.iter().map(|scan| scan.name.clone()).collect() };
        let own: Vec<Vec<Option<String>>> = read.iter().map(|(_, scans)| own(scans)).collect();
        let files: Vec<(&str, Vec<Option<&str>>)> = read
            .iter()
            .zip(&own)
            .map(|((file, _), own)| (file.as_str(), own.iter().map(Option::as_deref).collect()))
            .collect();
        let names = formats::scan_names(&files, others);
        let mut unfolded = Unfolded::default();
        let mut readings = BTreeMap::new();
        for ((file, scans), names) in read.into_iter().zip(names) {
            let is_one = scans.len() == 1;
            for (scan, name) in scans.into_iter().zip(names) {
                let ScanReading { mut reading, world_from_scan, .. } = scan;
                match world_from_scan {
                    // there is nothing in the file to which its place would matter
                    Some(motion) if is_one => reading.surface = reading.surface.moved(&motion),
                    Some(motion) => {
                        unfolded.poses.insert(name.clone(), motion);
                    }
                    None => {}
                }
                unfolded.names.push((name.clone(), file.clone()));
                readings.insert(name, reading);
            }
        }
        unfolded.readings = Mutex::new(readings);
        unfolded
    }

    /// Each scan and its file.
    pub fn names(&self) -> impl Iterator<Item = (&str, &str)> {
        self.names.iter().map(|(name, file)| (name.as_str(), file.as_str()))
    }

    /// A scan, the first time that it is asked for.
    pub fn take(&self, name: &str) -> Option<Reading> {
        self.readings.lock().unwrap_or_else(PoisonError::into_inner).remove(name)
    }

    /// Where the files say that these scans are.
    pub fn poses(&self, names: &[String]) -> BTreeMap<String, Motion> {
        names.iter().filter_map(|name| Some((name.clone(), *self.poses.get(name)?))).collect()
    }

    /// What the files are taken for, in words.
    pub fn notes(&self) -> Vec<String> {
        let mut by_file: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        self.names().for_each(|(name, file)| by_file.entry(file).or_default().push(name));
        let several = by_file.into_iter().filter(|(_, names)| names.len() > 1);
        several.map(|(file, names)| format!("{file} holds {} scans: {}", names.len(), names.join(", "))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::e57::{WrittenScan, write_scans};
    use crate::geometry::{Cloud, Point3};

    /// An E57 file of scans with these names, each a metre beside the one before.
    fn e57(names: &[&str]) -> Vec<u8> {
        let cloud = Cloud::from_points(vec![Point3::new(0.0, 0.0, 1.0), Point3::new(1.0, 0.0, 1.0)]);
        let poses: Vec<Motion> = (0..names.len()).map(|k| Motion::translation(k as f64, 0.0, 0.0)).collect();
        let scan = |(name, pose)| WrittenScan { name, cloud: &cloud, grid: None, world_from_scan: Some(pose) };
        write_scans(&names.iter().copied().zip(&poses).map(scan).collect::<Vec<_>>())
    }

    fn unfold(files: &[(&str, Vec<u8>)]) -> Unfolded {
        let folder = tempfile::tempdir().expect("a temporary folder");
        files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).expect("written"));
        let names: Vec<String> = files.iter().map(|(name, _)| (*name).to_owned()).collect();
        Unfolded::read(folder.path(), &names, &["taken.ply"])
    }

    #[test]
    fn scans_keep_sound_names_and_get_others_where_they_clash() {
        let unfolded = unfold(&[
            ("a.e57", e57(&["door", "../x", "twice", "taken.ply", "a.e57#1"])),
            ("b.e57", e57(&["twice", " wall"])),
            ("c.e57", e57(&["alone"])),
            ("d.e57", b"no E57".to_vec()),
            ("e.ply", Vec::new()),
        ]);
        let names: Vec<(&str, &str)> = unfolded.names().collect();
        let a = ["door", "a.e57#1#", "a.e57#2", "a.e57#3", "a.e57#1"].map(|name| (name, "a.e57"));
        let b = ["b.e57#0", "b.e57#1"].map(|name| (name, "b.e57"));
        assert_eq!(names, [&a[..], &b[..], &[("c.e57", "c.e57")]].concat());
        assert_eq!(unfolded.notes()[1], "b.e57 holds 2 scans: b.e57#0, b.e57#1");
        assert_eq!(unfolded.notes().len(), 2);
    }

    #[test]
    fn each_scan_is_read_in_its_own_frame_with_the_pose_of_its_file() {
        let unfolded = unfold(&[("a.e57", e57(&["p", "q"]))]);
        let poses = unfolded.poses(&["q".to_owned(), "other".to_owned()]);
        assert_eq!(poses.len(), 1);
        assert_eq!(poses["q"].translation.vector.x, 1.0);
        assert_eq!(unfolded.take("q").expect("read").surface.cloud.points[0], Point3::new(0.0, 0.0, 1.0));
        assert!(unfolded.take("q").is_none());
    }
}
