//! Pose files: which scan stands where. Stanford `.conf`, JSON and text blocks are told apart by their content.

mod conf;
mod fit;
mod json;
mod text;

use std::collections::{BTreeMap, BTreeSet};

use super::table::{Content, Format, Reader, Writers};
use super::{FormatError, checked_coordinate, quote};
use visage_geometry::Motion;
use visage_geometry::se3::{self, NearestMotion};

pub use conf::write as write_conf;
pub use json::{write as write_json, write_matrices};

/// JSON, `{"scan name": 4x4 row-major}`; what is written of a model.
pub const JSON: Format = Format {
    name: "JSON",
    endings: &["json"],
    media_type: "application/json",
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers { poses: Some(json::write), ..Writers::NONE },
};

/// Stanford's `.conf`.
pub const CONF: Format = Format {
    name: "Stanford `.conf`",
    endings: &["conf"],
    media_type: PLAIN_TEXT,
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers { poses: Some(conf::write), ..Writers::NONE },
};

/// Blocks of text: a line with the name of a scan, then four rows; files of it end as people like.
pub const TEXT: Format = Format {
    name: "text blocks",
    endings: &[],
    media_type: PLAIN_TEXT,
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers::NONE,
};

const PLAIN_TEXT: &str = "text/plain; charset=utf-8";

/// The poses of a file, in the order of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PoseFile {
    /// Scan name and `pose_world`, which maps the scan into the world frame.
    pub poses: Vec<(String, Motion)>,
    /// Scans that are named with `null` for a pose.
    pub unplaced: Vec<String>,
    /// The scales of those whose matrices hold one, `[s R, t]`; only [`read_scaled`] takes such matrices.
    pub scales: BTreeMap<String, f64>,
    /// The matrices as they stand in the file; `.conf` has none.
    pub matrices: BTreeMap<String, [[f64; 4]; 4]>,
    /// Names of the file that are those of a scan in another form, and the scan: see [`PoseFile::named_as`].
    pub fitted: Vec<(String, String)>,
    /// The poses that are rotations but for rounding, and how far off they are (Frobenius): the nearest are taken.
    pub rounded: Vec<(String, f64)>,
}

impl PoseFile {
    /// The poses by scan name.
    pub fn to_map(&self) -> BTreeMap<String, Motion> {
        self.poses.iter().cloned().collect()
    }

    /// What was done to make the file usable, in words: for people.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some((scan, worst)) = self.rounded.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            let count = self.rounded.len();
            notes.push(format!(
                "{count} pose(s) are rounded and no exact rotations, by up to {worst:.1e} ({scan}): the nearest rotations \
                 are taken"
            ));
        }
        if let Some((from, to)) = self.fitted.first() {
            let count = self.fitted.len();
            notes.push(format!(
                "{count} pose(s) are taken for scans of nearly the same name, such as {from:?} for {to:?}"
            ));
        }
        notes
    }

    /// Adds a pose given as a 4x4 row-major matrix.
    fn push_matrix(&mut self, scan: &str, rows: [[f64; 4]; 4]) -> Result<(), Fault> {
        let NearestMotion { motion, scale, distance } = pose_from_rows(scan, &rows)?;
        if distance > EXACT {
            self.rounded.push((scan.to_owned(), distance));
        }
        if scale != 1.0 {
            self.scales.insert(scan.to_owned(), scale);
        }
        self.poses.push((scan.to_owned(), motion));
        self.matrices.insert(scan.to_owned(), rows);
        Ok(())
    }
}

/// Reads a pose file: JSON if it begins with a brace, `.conf` if it has `bmesh` lines, else text blocks.
///
/// `name` serves messages only.
///
/// # Errors
/// [`FormatError::Malformed`] names the line or the scan: numbers that are missing or not finite, a matrix that is
/// no rigid motion, a scan named twice, a file without poses.
pub fn read(name: &str, bytes: &[u8]) -> Result<PoseFile, FormatError> {
    let rigid = parse(bytes).and_then(|file| match file.scales.iter().next() {
        None => Ok(file),
        Some((scan, scale)) => {
            Err(Fault::scan(scan, format!("the 3x3 block is no rotation: it holds a scale of {scale}")))
        }
    });
    rigid.map_err(|fault| fault.of_file(name))
}

/// The same, but poses may hold a scale: matrices `[s R, t]`, as a registration with scales writes them.
///
/// # Errors
/// As [`read`], but for the scale.
pub fn read_scaled(name: &str, bytes: &[u8]) -> Result<PoseFile, FormatError> {
    parse(bytes).map_err(|fault| fault.of_file(name))
}

/// How a pose file may look, for messages.
const REMEDY: &str =
    "send JSON {\"scan name\": 4x4 row-major}, Stanford .conf, or a name line and 4 rows for each scan";

/// What is wrong and where, before the file's name is put in front.
struct Fault {
    place: String,
    problem: String,
    remedy: &'static str,
}

impl Fault {
    fn line(index: usize, problem: impl Into<String>) -> Self {
        Fault { place: format!("line {}", index + 1), problem: problem.into(), remedy: REMEDY }
    }

    fn scan(scan: &str, problem: impl Into<String>) -> Self {
        let remedy = "give a rotation and a translation, row-major, with 0 0 0 1 as the last row";
        Fault { place: format!("the pose of {}", quote(scan.as_bytes())), problem: problem.into(), remedy }
    }

    fn of_file(self, name: &str) -> FormatError {
        FormatError::malformed(format!("{}: {}", quote(name.as_bytes()), self.place), self.problem, self.remedy)
    }

    fn file(problem: impl Into<String>) -> Self {
        Fault { place: "the whole file".into(), problem: problem.into(), remedy: REMEDY }
    }
}

fn parse(bytes: &[u8]) -> Result<PoseFile, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::file("it is no text"))?;
    let text = text.trim_start_matches('\u{feff}');
    let file = if text.trim_start().starts_with(['{', '[']) {
        json::read(text)?
    } else if text.lines().any(|line| line.split_whitespace().next() == Some("bmesh")) {
        conf::read(text)?
    } else {
        text::read(text)?
    };
    let mut seen = BTreeSet::new();
    let names = file.poses.iter().map(|(name, _)| name).chain(&file.unplaced);
    if let Some(twice) = names.into_iter().find(|name| !seen.insert(name.as_str())) {
        return Err(Fault::scan(twice, "the scan is named twice"));
    }
    if seen.is_empty() {
        return Err(Fault::file("there is no pose in it"));
    }
    Ok(file)
}

/// What is nearer to a rotation than this (Frobenius) is one: five printed digits.
const EXACT: f64 = 1e-5;
/// The rotations of a pose file may be rounded to two decimals, which moves them by up to this (Frobenius). They are only
/// where a registration starts.
const ROUNDED: f64 = 3.0 * 0.5e-2;

/// The nearest pose to a 4x4 row-major matrix.
fn pose_from_rows(scan: &str, rows: &[[f64; 4]; 4]) -> Result<NearestMotion, Fault> {
    let nearest = se3::nearest_motion(rows, ROUNDED).map_err(|error| Fault::scan(scan, error.to_string()))?;
    let NearestMotion { motion, scale, .. } = nearest;
    for coordinate in motion.translation.vector.iter() {
        checked_coordinate(*coordinate).map_err(|problem| Fault::scan(scan, format!("the translation {problem}")))?;
    }
    checked_coordinate(scale).map_err(|problem| Fault::scan(scan, format!("the scale {problem}")))?;
    Ok(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Vector3;

    fn message(text: &str) -> String {
        read("poses.txt", text.as_bytes()).expect_err(text).to_string()
    }

    #[test]
    fn the_three_kinds_are_told_apart() {
        let kinds = [
            "camera 0 0 0 0 0 0 1\nbmesh a.ply 1 2 3 0 0 0 1\n",
            "# by hand\na.ply\n1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n",
            "\u{feff}\n{\"a.ply\": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}",
        ];
        for text in kinds {
            let poses = read("poses", text.as_bytes()).expect(text);
            assert_eq!(poses.to_map()["a.ply"], Motion::translation(1.0, 2.0, 3.0));
        }
    }

    #[test]
    fn a_file_without_poses_or_with_a_name_twice_is_refused() {
        assert!(message("").starts_with("\"poses.txt\": the whole file: there is no pose in it; send JSON"));
        assert!(message("{}").contains("there is no pose in it"));
        assert!(message("# nothing\n").contains("there is no pose in it"));
        let twice = message("bmesh a.ply 0 0 0 0 0 0 1\nbmesh a.ply 0 0 0 0 0 0 1\n");
        assert!(twice.starts_with("\"poses.txt\": the pose of \"a.ply\": the scan is named twice"), "{twice}");
        assert!(read("x", b"\xff\xfe").expect_err("no text").to_string().contains("it is no text"));
    }

    #[test]
    fn matrices_that_are_no_motion_name_the_scan() {
        let scaled = message("{\"a.ply\": null, \"b.ply\": [2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]}");
        assert!(scaled.starts_with("\"poses.txt\": the pose of \"b.ply\": the 3x3 block is no rotation"), "{scaled}");
        let far = message("a.ply\n1 0 0 1e300\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        assert!(far.contains("the pose of \"a.ply\": the translation is 1e300"), "{far}");
        let not_finite = message("a.ply\n1 0 0 nan\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        assert!(
            not_finite.contains("the pose of \"a.ply\": the matrix has a number that is not finite"),
            "{not_finite}"
        );
        let last = message("a.ply\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 0 0 1\n");
        assert!(last.contains("the last row must be 0 0 0 1"), "{last}");
    }

    #[test]
    fn scales_are_read_where_they_are_asked_for_and_matrices_are_kept_to_the_last_bit() {
        let turned = Motion::new(Vector3::new(0.1, -1e-9, 1e6), Vector3::new(0.3, 2.0, -0.7));
        let matrices = vec![
            ("a".to_owned(), Some(se3::to_scaled_rows(&turned, 1.1))),
            ("b".to_owned(), Some(se3::to_rows(&turned))),
        ];
        let text = write_matrices(&matrices);
        let file = read_scaled("poses.json", text.as_bytes()).expect("scaled poses");
        assert_eq!(file.scales.keys().collect::<Vec<_>>(), ["a"]);
        assert!((file.scales["a"] - 1.1).abs() < 1e-12);
        assert!((file.to_map()["a"].to_homogeneous() - turned.to_homogeneous()).norm() < 1e-9);
        assert_eq!(file.matrices["b"], se3::to_rows(&turned));
        let again: Vec<_> = file.matrices.into_iter().map(|(name, rows)| (name, Some(rows))).collect();
        assert_eq!(write_matrices(&again), text);
        assert!(message(&text).contains("the pose of \"a\": the 3x3 block is no rotation: it holds a scale of 1.1"));
    }

    #[test]
    fn what_is_written_is_read_back() {
        let poses: Vec<(String, Option<Motion>)> = vec![
            ("scan 1.ply".into(), Some(Motion::new(Vector3::new(0.1, -1e-9, 1e6), Vector3::new(0.3, 2.0, -0.7)))),
            ("lost \"one\".ply".into(), None),
            ("scan_0.ply".into(), Some(Motion::identity())),
        ];
        let json = read("poses.json", write_json(&poses).as_bytes()).expect("own JSON");
        assert_eq!(json.unplaced, ["lost \"one\".ply"]);
        let conf = read("poses.conf", write_conf(&poses).as_bytes()).expect("own .conf");
        for file in [json, conf] {
            assert_eq!(file.poses.len(), 2);
            assert_eq!((file.poses[0].0.as_str(), file.poses[1].0.as_str()), ("scan 1.ply", "scan_0.ply"));
            let error = file.poses[0].1.to_homogeneous() - poses[0].1.expect("posed").to_homogeneous();
            assert!(error.norm() < 1e-14, "{error}");
        }
    }
}
