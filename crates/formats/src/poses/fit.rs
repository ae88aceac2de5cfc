//! Which pose belongs to which scan. A pose file may have been written on another machine, or by a program that names
//! scans by path or without their ending; where a plainer form of the names fits without doubt, it counts.

use std::collections::{BTreeMap, BTreeSet};

use unicode_normalization::UnicodeNormalization;

use super::{Naming, PoseFile};
use crate::FormatError;

/// Forms in which names are compared, each plainer than the one before.
const FORMS: [fn(&str) -> String; 4] = [str::to_owned, composed, plain, folded];

/// The same letters whether accents stand in or behind them (NFC, NFD).
fn composed(name: &str) -> String {
    name.nfc().collect()
}

/// Without folders, of any system.
fn plain(name: &str) -> String {
    let name = composed(name);
    name.rsplit(['/', '\\']).next().unwrap_or_default().to_owned()
}

/// Upper case as lower case.
fn folded(name: &str) -> String {
    plain(name).to_lowercase()
}

/// What is the same for two names that some system takes for one: accents may stand in letters or behind them, and many
/// disks don't tell upper case from lower case.
pub fn same_name(name: &str) -> String {
    composed(&composed(name).to_lowercase())
}

/// A folded name without its ending.
fn without_ending(name: &str) -> String {
    let name = folded(name);
    name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem).to_owned()
}

/// Endings of pictures: a pose of one is that of the scan made of it.
const PICTURES: &[&str] = &["png", "jpg", "jpeg", "tif", "tiff", "bmp", "exr", "pgm", "ppm", "webp", "heic"];

/// The folded name of a picture without its ending.
fn of_picture(name: &str) -> String {
    let name = folded(name);
    match name.rsplit_once('.') {
        Some((stem, ending)) if PICTURES.contains(&ending) => stem.to_owned(),
        _ => name,
    }
}

impl PoseFile {
    /// Names the poses as the scans are named, where there is no doubt which is meant: in the plainest form that is
    /// needed, one pose and one scan have this name. Poses for which there is no scan keep their names. The poses of a
    /// file without names are those of the scans in natural order, if there are as many.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] names the scans that a pose may belong to, or the numbers of poses and scans.
    pub fn named_as(mut self, scans: &[&str]) -> Result<PoseFile, FormatError> {
        if scans.is_empty() {
            return Ok(self);
        }
        let named: Vec<&str> = self.poses.iter().map(|(name, _)| name.as_str()).collect();
        let named: Vec<&str> = named.into_iter().chain(self.unplaced.iter().map(String::as_str)).collect();
        let names = match self.naming {
            Naming::Scans => unambiguous(&named, scans)?,
            Naming::Files => of_files(&named, scans)?,
            Naming::Order => match unambiguous(&named, scans) {
                Ok(names) if names.len() == named.len() => names,
                _ => {
                    let (names, said) = in_order(self.kind, &named, scans)?;
                    self.said.push(said);
                    self.take_names(&names);
                    return Ok(self);
                }
            },
        };
        let is_other = |(from, to): &(&String, &String)| composed(from) != composed(to);
        self.fitted = names.iter().filter(is_other).map(|(a, b)| (a.clone(), b.clone())).collect();
        self.take_names(&names);
        Ok(self)
    }

    fn take_names(&mut self, names: &BTreeMap<String, String>) {
        let renamed = |name: &String| names.get(name).cloned().unwrap_or_else(|| name.clone());
        self.poses.iter_mut().for_each(|(name, _)| *name = renamed(name));
        self.unplaced.iter_mut().for_each(|name| *name = renamed(name));
        self.rounded.iter_mut().for_each(|(name, _)| *name = renamed(name));
        self.scales = self.scales.iter().map(|(name, scale)| (renamed(name), *scale)).collect();
        self.matrices = self.matrices.iter().map(|(name, rows)| (renamed(name), *rows)).collect();
    }
}

/// The scan that each name belongs to, or which it may be where that is not clear.
fn unambiguous(named: &[&str], scans: &[&str]) -> Result<BTreeMap<String, String>, FormatError> {
    let found = fit(named, scans);
    let taken: BTreeSet<&str> = found.values().map(String::as_str).collect();
    let left: Vec<&str> = scans.iter().copied().filter(|scan| !taken.contains(scan)).collect();
    let groups = LAST_FORMS.map(|(_, of_scan)| grouped(&left, of_scan));
    let mut claims: BTreeMap<Vec<&str>, Vec<&str>> = BTreeMap::new();
    for pose in named.iter().filter(|pose| !found.contains_key(**pose)) {
        let candidates = groups.iter().zip(LAST_FORMS).find_map(|(groups, (of_pose, _))| groups.get(&of_pose(pose)));
        if let Some(candidates) = candidates {
            claims.entry(candidates.clone()).or_default().push(pose);
        }
    }
    match claims.into_iter().next() {
        None => Ok(found),
        Some((scans, poses)) => Err(ambiguous(&poses, &scans)),
    }
}

fn ambiguous(poses: &[&str], scans: &[&str]) -> FormatError {
    let quoted = |names: &[&str]| names.iter().take(5).map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
    FormatError::malformed(
        format!("the pose(s) of {}", quoted(poses)),
        format!("it is not clear which scan is meant: {}", quoted(scans)),
        "name the poses exactly as the scans",
    )
}

/// Gives poses without names to the scans in natural order.
fn in_order(kind: &str, named: &[&str], scans: &[&str]) -> Result<(BTreeMap<String, String>, String), FormatError> {
    if named.len() != scans.len() {
        return Err(FormatError::malformed(
            format!("the pose file ({kind})"),
            format!("it has no names of scans, and {} pose(s) for {} scan(s)", named.len(), scans.len()),
            "give as many poses as scans, or name them: a line with the name of the scan, then the 4 rows of its matrix; \
             of files with one matrix each give the folder (--poses DIR)",
        ));
    }
    let mut scans = scans.to_vec();
    scans.sort_by(|a, b| natord::compare(a, b).then_with(|| a.cmp(b)));
    let said = format!(
        "the pose file ({kind}) has no names of scans: its {} poses are taken for the scans in natural order of their \
         names, from {:?} to {:?}",
        named.len(),
        scans.first().copied().unwrap_or_default(),
        scans.last().copied().unwrap_or_default()
    );
    let names = named.iter().zip(&scans).map(|(pose, scan)| ((*pose).to_owned(), (*scan).to_owned())).collect();
    Ok((names, said))
}

/// The scan that the name of each file begins with; of several the one with the longest name.
fn of_files(files: &[&str], scans: &[&str]) -> Result<BTreeMap<String, String>, FormatError> {
    let stems: Vec<(String, &str)> = scans.iter().map(|scan| (without_ending(scan), *scan)).collect();
    let mut found = BTreeMap::new();
    let mut claims: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for file in files {
        let name = folded(file);
        let begins = |stem: &str| {
            let rest = name.strip_prefix(stem).filter(|_| !stem.is_empty());
            rest.is_some_and(|rest| !rest.starts_with(char::is_alphanumeric))
        };
        let fitting = || stems.iter().filter(|(stem, _)| begins(stem));
        let Some(longest) = fitting().map(|(stem, _)| stem.len()).max() else { continue };
        let best: Vec<&str> = fitting().filter(|(stem, _)| stem.len() == longest).map(|(_, scan)| *scan).collect();
        match best.as_slice() {
            [scan] => {
                found.insert((*file).to_owned(), (*scan).to_owned());
                claims.entry(*scan).or_default().push(file);
            }
            several => return Err(ambiguous(&[file], several)),
        }
    }
    match claims.iter().find(|(_, files)| files.len() > 1) {
        Some((scan, files)) => Err(ambiguous(files, &[scan])),
        None => Ok(found),
    }
}

/// A form of a pose's name and one of a scan's that are held against each other.
type FormPair = (fn(&str) -> String, fn(&str) -> String);

/// The last forms: a name without its ending, or with that of a picture; one with another ending is another file.
const LAST_FORMS: [FormPair; 3] = [(folded, folded), (folded, without_ending), (of_picture, without_ending)];

/// The scan that each name belongs to; names without one are left out.
fn fit(named: &[&str], scans: &[&str]) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut left: (Vec<&str>, Vec<&str>) = (named.to_vec(), scans.to_vec());
    let forms = FORMS.iter().map(|form| (*form, *form)).chain(LAST_FORMS);
    for (of_pose, of_scan) in forms {
        let (poses, scans) = (grouped(&left.0, of_pose), grouped(&left.1, of_scan));
        let mut taken = BTreeSet::new();
        for (form, pose) in &poses {
            if let ([pose], Some([scan])) = (pose.as_slice(), scans.get(form).map(Vec::as_slice)) {
                found.insert((*pose).to_owned(), (*scan).to_owned());
                taken.insert(*scan);
            }
        }
        left.0.retain(|pose| !found.contains_key(*pose));
        left.1.retain(|scan| !taken.contains(scan));
    }
    found
}

fn grouped<'a>(names: &[&'a str], form: fn(&str) -> String) -> BTreeMap<String, Vec<&'a str>> {
    let mut groups: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for name in names {
        groups.entry(form(name)).or_default().push(name);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted(poses: &[&str], scans: &[&str]) -> Vec<(String, String)> {
        fit(poses, scans).into_iter().collect()
    }

    #[test]
    fn names_fit_in_the_plainest_form_that_is_needed() {
        let scans = ["bu\u{308}ste.ply", "scan_00.ply"];
        for name in
            ["scan_00.ply", "./scan_00.ply", "C:\\scans\\head\\scan_00.ply", "scan_00", "SCAN_00.PLY", "a/Scan_00"]
        {
            assert_eq!(fitted(&[name], &scans), [(name.to_owned(), "scan_00.ply".to_owned())]);
        }
        assert_eq!(fitted(&["b\u{fc}ste.ply"], &scans)[0].1, scans[0]);
        for name in ["scan_0.ply", "scan_00.obj", "scan_00.ply.bak", ""] {
            assert_eq!(fitted(&[name], &scans), []);
        }
    }

    #[test]
    fn where_there_is_doubt_nothing_fits() {
        assert_eq!(fitted(&["a/scan.ply", "b/scan.ply"], &["scan.ply"]), []);
        assert_eq!(fitted(&["scan"], &["scan.ply", "scan.obj"]), []);
        // what fits exactly leaves no doubt, and is not there for others
        let exact = fitted(&["scan.ply", "b/scan.ply"], &["scan.ply"]);
        assert_eq!(exact, [("scan.ply".to_owned(), "scan.ply".to_owned())]);
        assert_eq!(fitted(&["A.ply", "a.ply"], &["A.ply", "a.ply"]).len(), 2);
    }

    #[test]
    fn everything_that_is_known_of_a_pose_is_renamed() {
        let text = "./b.ply\n2 0 0 1\n0 2 0 0\n0 0 2 0\n0 0 0 1\n";
        let file = super::super::read_scaled("poses", text.as_bytes()).expect("sound");
        let file = file.named_as(&["a.ply", "b.ply"]).expect("clear");
        assert_eq!(file.poses[0].0, "b.ply");
        assert_eq!((file.scales["b.ply"], file.matrices["b.ply"][0][3]), (2.0, 1.0));
        assert_eq!(file.fitted, [("./b.ply".to_owned(), "b.ply".to_owned())]);
    }

    fn named(text: &str, scans: &[&str]) -> Result<PoseFile, String> {
        super::super::read("poses", text.as_bytes()).expect("sound").named_as(scans).map_err(|error| error.to_string())
    }

    #[test]
    fn doubt_lists_the_candidates() {
        let rows = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let error = named(&format!("scan\n{rows}"), &["scan.ply", "scan.obj"]).expect_err("two scans");
        assert!(error.starts_with("the pose(s) of \"scan\": it is not clear which scan is meant: "), "{error}");
        assert!(error.contains("\"scan.ply\"") && error.contains("\"scan.obj\""), "{error}");
        let error = named(&format!("a/s.ply\n{rows}b/s.ply\n{rows}"), &["s.ply", "t.ply"]).expect_err("two poses");
        assert!(error.starts_with("the pose(s) of \"a/s.ply\", \"b/s.ply\": it is not clear"), "{error}");
        let other = named(&format!("u.ply\n{rows}"), &["s.ply"]).expect("another scan is no doubt");
        assert_eq!(other.poses[0].0, "u.ply");
        let picture = named(&format!("images/0001.png\n{rows}"), &["0001.ply"]).expect("the scan of the picture");
        assert_eq!(picture.poses[0].0, "0001.ply");
    }

    #[test]
    fn poses_without_names_need_as_many_scans() {
        let line = "1 0 0 4 0 1 0 5 0 0 1 6\n";
        let file = named(&line.repeat(2), &["s10.ply", "s9.ply"]).expect("as many");
        assert_eq!(file.poses[0].0, "s9.ply");
        assert!(file.said[0].ends_with("in natural order of their names, from \"s9.ply\" to \"s10.ply\""));
        let error = named(line, &["a.ply", "b.ply"]).expect_err("one pose");
        assert!(error.contains("it has no names of scans, and 1 pose(s) for 2 scan(s)"), "{error}");
        assert!(error.contains("give the folder (--poses DIR)"), "{error}");
    }
}
