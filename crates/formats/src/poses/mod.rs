//! Pose files: which scan stands where. Kinds of files share their endings, so they are told apart by their content:
//! [`KINDS`] (`kinds.rs`) is the list of them. A new kind is a file here and an entry there; one with an ending of its own is also a
//! `Format` here, with its entry in `FORMATS`.

mod colmap;
mod conf;
mod fit;
mod folder;
mod json;
mod kinds;
pub(crate) mod lines;
mod log;
mod matrices;
mod meshlab;
pub(crate) mod node;
mod quaternions;
mod text;
mod uos;

use std::collections::{BTreeMap, BTreeSet};

use super::format::{Content, Format, Reader, Writers};
use super::{FormatError, checked_coordinate, quote};
use visage_geometry::se3::{self, NearestMotion};
use visage_geometry::{Motion, PoseConvention};

pub use conf::write as write_conf;
pub use fit::same_name;
pub use folder::read_folder;
pub use json::{write as write_json, write_matrices, write_of_scan_files};
pub use kinds::{KINDS, Kind, markdown, remedy};
pub use log::write as write_log;
pub use matrices::write_matrix;
pub use meshlab::{write_aln, write_mlp};
pub use text::write as write_text;

/// JSON; `{"scan name": 4x4 row-major}` is what is written of a model.
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

/// MeshLab's alignments.
pub const ALN: Format = Format {
    name: "MeshLab `.aln`",
    endings: &["aln"],
    media_type: PLAIN_TEXT,
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers { poses: Some(meshlab::write_aln), ..Writers::NONE },
};

/// MeshLab's projects.
pub const MLP: Format = Format {
    name: "MeshLab `.mlp`",
    endings: &["mlp"],
    media_type: "application/xml",
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers { poses: Some(meshlab::write_mlp), ..Writers::NONE },
};

/// Open3D's trajectories as text.
pub const LOG: Format = Format {
    name: "Open3D `.log`",
    endings: &["log"],
    media_type: PLAIN_TEXT,
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers { poses: Some(log::write), ..Writers::NONE },
};

/// 3DTK's poses of one scan.
pub const UOS: Format = Format {
    name: "3DTK poses",
    endings: &["frames", "pose"],
    media_type: PLAIN_TEXT,
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers::NONE,
};

/// Text of many kinds, which end as people like; written are blocks of a name and four rows.
pub const TEXT: Format = Format {
    name: "text",
    endings: &[],
    media_type: PLAIN_TEXT,
    holds: &[Content::Poses],
    reader: Reader::Poses(read_scaled),
    writers: Writers { poses: Some(text::write), ..Writers::NONE },
};

const PLAIN_TEXT: &str = "text/plain; charset=utf-8";

/// The poses of a file, in the order of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PoseFile {
    /// What kind of file it is, by its name in [`KINDS`].
    pub kind: &'static str,
    /// Scan name and `pose_world`, which maps the scan into the world frame.
    pub poses: Vec<(String, Motion)>,
    /// Scans that are named with `null` for a pose.
    pub unplaced: Vec<String>,
    /// The scales of those whose matrices hold one, `[s R, t]`; only [`read_scaled`] takes such matrices.
    pub scales: BTreeMap<String, f64>,
    /// The matrices as they stand in the file, where it holds matrices that map scans into the world.
    pub matrices: BTreeMap<String, [[f64; 4]; 4]>,
    /// What the names are: see [`PoseFile::named_as`].
    pub naming: Naming,
    /// How else the poses may be meant, since the kind of file leaves it open.
    pub other_conventions: &'static [PoseConvention],
    /// Names of the file that are those of a scan in another form, and the scan: see [`PoseFile::named_as`].
    pub fitted: Vec<(String, String)>,
    /// The poses that are rotations but for rounding, and how far off they are (Frobenius): the nearest are taken.
    pub rounded: Vec<(String, f64)>,
    /// What else was done to read the file, in words.
    pub said: Vec<String>,
    /// Whether the files of the scans tell these poses: each is in the unit of its scan's file, and maps the scan into the
    /// world for certain. See [`write_of_scan_files`].
    pub of_scan_files: bool,
}

/// What the names of a pose file are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Naming {
    /// The names of scans.
    #[default]
    Scans,
    /// Times or numbers: if they are no scans' names, the poses are those of the scans in their order.
    Order,
    /// The names of files that hold one matrix each, which begin with the names of their scans.
    Files,
}

impl PoseFile {
    /// The poses by scan name.
    pub fn to_map(&self) -> BTreeMap<String, Motion> {
        self.poses.iter().cloned().collect()
    }

    /// What was done to make the file usable, in words: for people.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.said.clone();
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

    /// Adds a pose given as a 4x4 row-major matrix that maps the scan into the world.
    fn push_matrix(&mut self, scan: &str, rows: [[f64; 4]; 4]) -> Result<(), Fault> {
        let NearestMotion { motion, scale, distance } = pose_from_rows(scan, &rows)?;
        if scale != 1.0 {
            self.scales.insert(scan.to_owned(), scale);
        }
        self.matrices.insert(scan.to_owned(), rows);
        self.push(scan, motion, distance);
        Ok(())
    }

    /// Adds a pose given as a 4x4 row-major matrix that maps the world into the scan; it holds no scale.
    fn push_inverse(&mut self, scan: &str, rows: [[f64; 4]; 4]) -> Result<(), Fault> {
        let NearestMotion { motion, scale, distance } = pose_from_rows(scan, &rows)?;
        if scale != 1.0 {
            return Err(Fault::scan(scan, format!("the 3x3 block is no rotation: it holds a scale of {scale}")));
        }
        self.push(scan, motion.inverse(), distance);
        Ok(())
    }

    /// Adds a pose that is `distance` from what stands in the file.
    fn push(&mut self, scan: &str, pose: Motion, distance: f64) {
        if distance > EXACT {
            self.rounded.push((scan.to_owned(), distance));
        }
        self.poses.push((scan.to_owned(), pose));
    }

    /// What the next pose is called in a file without names.
    fn next_label(&self) -> String {
        format!("pose {}", self.poses.len() + 1)
    }
}

/// Reads a pose file, whose kind is recognised by its content: see [`KINDS`].
///
/// `name` serves messages only.
///
/// # Errors
/// [`FormatError::Malformed`] names the line or the scan: numbers that are missing or not finite, a matrix that is
/// no rigid motion, a scan named twice, a file without poses. Of a file that is of no kind it says what was seen.
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

/// What is wrong and where, before the file's name is put in front.
pub(crate) struct Fault {
    place: String,
    problem: String,
    remedy: String,
}

impl Fault {
    fn line(index: usize, problem: impl Into<String>) -> Self {
        Fault { place: format!("line {}", index + 1), problem: problem.into(), remedy: kinds::remedy() }
    }

    fn scan(scan: &str, problem: impl Into<String>) -> Self {
        let remedy = "give a rotation and a translation, row-major, with 0 0 0 1 as the last row".to_owned();
        Fault { place: format!("the pose of {}", quote(scan.as_bytes())), problem: problem.into(), remedy }
    }

    fn of_file(self, name: &str) -> FormatError {
        FormatError::malformed(format!("{}: {}", quote(name.as_bytes()), self.place), self.problem, self.remedy)
    }

    fn file(problem: impl Into<String>) -> Self {
        Fault { place: "the whole file".into(), problem: problem.into(), remedy: kinds::remedy() }
    }
}

fn parse(bytes: &[u8]) -> Result<PoseFile, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::file("it is no text"))?;
    let file = kinds::read(text.trim_start_matches('\u{feff}'))?;
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
/// The rotations of a pose file may be rounded to two decimals, which moves them by up to this (Frobenius). They are
/// only where a registration starts.
const ROUNDED: f64 = 3.0 * 0.5e-2;
/// How far the norm of a quaternion printed with two decimals may be from 1.
const UNIT_TOLERANCE: f64 = 1e-2;
/// The last row of a matrix that is given without it.
const LAST_ROW: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

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

/// The pose of a translation and a quaternion, real part last, and how far that is from a rotation.
fn pose_from_quaternion([tx, ty, tz, qx, qy, qz, qw]: [f64; 7]) -> Result<(Motion, f64), String> {
    for coordinate in [tx, ty, tz, qx, qy, qz, qw] {
        checked_coordinate(coordinate).map_err(|problem| format!("a number {problem}"))?;
    }
    let printed = nalgebra::Quaternion::new(qw, qx, qy, qz);
    let norm = printed.norm();
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(format!("the quaternion's norm is {norm}, not 1"));
    }
    let rotation = nalgebra::UnitQuaternion::from_quaternion(printed);
    Ok((Motion::from_parts(nalgebra::Translation3::new(tx, ty, tz), rotation), (norm - 1.0).abs()))
}

/// 16 numbers as rows.
fn rows_of_16(numbers: &[f64; 16]) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]))
}

/// 12 numbers as the first three of four rows.
fn rows_of_12(numbers: &[f64; 12]) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| match row {
        3 => LAST_ROW,
        _ => std::array::from_fn(|column| numbers[4 * row + column]),
    })
}

fn transposed(rows: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| rows[column][row]))
}

#[cfg(test)]
mod tests;
