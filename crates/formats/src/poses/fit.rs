//! Which pose belongs to which scan. A pose file may have been written on another machine, or by a program that names
//! scans by path or without their ending; where a plainer form of the names fits without doubt, it counts.

use std::collections::BTreeMap;

use unicode_normalization::UnicodeNormalization;

use super::PoseFile;

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

/// A folded name without its ending.
fn without_ending(name: &str) -> String {
    let name = folded(name);
    name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem).to_owned()
}

impl PoseFile {
    /// Names the poses as the scans are named, where there is no doubt which is meant: in the plainest form that is
    /// needed, one pose and one scan have this name. Other poses keep their names.
    pub fn named_as(mut self, scans: &[&str]) -> PoseFile {
        let named: Vec<&str> = self.poses.iter().map(|(name, _)| name.as_str()).collect();
        let named: Vec<&str> = named.into_iter().chain(self.unplaced.iter().map(String::as_str)).collect();
        let names = fit(&named, scans);
        let renamed = |name: &String| names.get(name).cloned().unwrap_or_else(|| name.clone());
        let is_other = |(from, to): &(&String, &String)| composed(from) != composed(to);
        self.fitted = names.iter().filter(is_other).map(|(a, b)| (a.clone(), b.clone())).collect();
        self.poses.iter_mut().for_each(|(name, _)| *name = renamed(name));
        self.unplaced.iter_mut().for_each(|name| *name = renamed(name));
        self.scales = self.scales.iter().map(|(name, scale)| (renamed(name), *scale)).collect();
        self.matrices = self.matrices.iter().map(|(name, rows)| (renamed(name), *rows)).collect();
        self
    }
}

/// The scan that each name belongs to; names without one are left out.
fn fit(named: &[&str], scans: &[&str]) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut left: (Vec<&str>, Vec<&str>) = (named.to_vec(), scans.to_vec());
    // last, a name without its ending; one with another ending is another file
    let forms = FORMS.iter().map(|form| (*form, *form)).chain([(folded as fn(&str) -> String, without_ending as _)]);
    for (of_pose, of_scan) in forms {
        let (poses, scans) = (grouped(&left.0, of_pose), grouped(&left.1, of_scan));
        for (form, pose) in &poses {
            if let ([pose], Some([scan])) = (pose.as_slice(), scans.get(form).map(Vec::as_slice)) {
                found.insert((*pose).to_owned(), (*scan).to_owned());
            }
        }
        let is_taken = |scan: &str| found.values().any(|taken| taken == scan);
        left = (
            left.0.into_iter().filter(|pose| !found.contains_key(*pose)).collect(),
            left.1.into_iter().filter(|scan| !is_taken(scan)).collect(),
        );
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
        let file = super::super::read_scaled("poses", text.as_bytes()).expect("sound").named_as(&["a.ply", "b.ply"]);
        assert_eq!(file.poses[0].0, "b.ply");
        assert_eq!((file.scales["b.ply"], file.matrices["b.ply"][0][3]), (2.0, 1.0));
        assert_eq!(file.fitted, [("./b.ply".to_owned(), "b.ply".to_owned())]);
    }
}
