//! Translations and quaternions in lines: TUM trajectories, and tables whose header says what the columns are.

use std::borrow::Cow;
use std::collections::BTreeSet;

use super::lines::{self, numbers_of};
use super::{Fault, Naming, PoseFile, pose_from_quaternion};
use visage_geometry::PoseConvention;

/// What the seven numbers of a pose may be called; the order is that of [`pose_from_quaternion`].
const COLUMNS: [&[&str]; 7] = [
    &["tx", "x", "px", "t_x", "p_x", "pos_x", "position_x", "translation_x", "position.x"],
    &["ty", "y", "py", "t_y", "p_y", "pos_y", "position_y", "translation_y", "position.y"],
    &["tz", "z", "pz", "t_z", "p_z", "pos_z", "position_z", "translation_z", "position.z"],
    &["qx", "q_x", "quat_x", "rotation_x", "orientation_x", "orientation.x"],
    &["qy", "q_y", "quat_y", "rotation_y", "orientation_y", "orientation.y"],
    &["qz", "q_z", "quat_z", "rotation_z", "orientation_z", "orientation.z"],
    &["qw", "q_w", "quat_w", "rotation_w", "orientation_w", "orientation.w"],
];
/// What the column with the names may be called;
const NAMES: &[&str] = &["name", "filename", "file_name", "file", "scan", "image", "path", "file_path", "image_name"];
/// that with the times or numbers of the scans.
const TIMES: &[&str] = &["timestamp", "time", "t", "stamp", "id", "index", "frame"];

fn new_file() -> PoseFile {
    PoseFile { other_conventions: &[PoseConvention::WorldToScan], naming: Naming::Order, ..PoseFile::default() }
}

/// Whether the first line is eight words, the last seven numbers.
pub(super) fn is_tum(text: &str) -> bool {
    lines::data(text).next().is_some_and(|(_, line)| {
        let words = lines::words(line);
        words.len() == 8 && words[1..].iter().all(|word| lines::is_number(word))
    })
}

/// `time tx ty tz qx qy qz qw`, or with the name of the scan.
pub(super) fn read_tum(text: &str) -> Result<PoseFile, Fault> {
    let mut lines = Lines::default();
    for (index, line) in lines::data(text) {
        let words = lines::words(line);
        let numbers = words.get(1..).and_then(numbers_of);
        let numbers = numbers.ok_or_else(|| Fault::line(index, "it is not `time tx ty tz qx qy qz qw`"))?;
        lines.push(index, Some(&words[0]), numbers)?;
    }
    Ok(lines.file())
}

/// Poses of lines that begin with a name or a time.
struct Lines {
    file: PoseFile,
    labels: Vec<String>,
}

impl Default for Lines {
    fn default() -> Self {
        Lines { file: new_file(), labels: Vec::new() }
    }
}

impl Lines {
    fn push(&mut self, index: usize, label: Option<&str>, numbers: [f64; 7]) -> Result<(), Fault> {
        let (pose, distance) = pose_from_quaternion(numbers).map_err(|problem| Fault::line(index, problem))?;
        self.labels.extend(label.map(str::to_owned));
        self.file.push(&self.file.next_label(), pose, distance);
        Ok(())
    }

    /// The poses by their names, or by their times if these are all different.
    fn file(mut self) -> PoseFile {
        let is_named = self.labels.iter().any(|label| !lines::is_number(label));
        let is_clear = self.labels.iter().collect::<BTreeSet<_>>().len() == self.file.poses.len();
        if is_named || is_clear {
            let names: Vec<String> = self.file.poses.iter().map(|(name, _)| name.clone()).collect();
            let new_name =
                |old: &str| names.iter().position(|name| name == old).and_then(|k| self.labels.get(k)).cloned();
            for (name, _) in &mut self.file.rounded {
                *name = new_name(name).unwrap_or_default();
            }
            for ((name, _), label) in self.file.poses.iter_mut().zip(self.labels) {
                *name = label;
            }
        }
        self.file.naming = if is_named { Naming::Scans } else { Naming::Order };
        self.file
    }
}

/// Whether there is a header that names the columns of a quaternion.
pub(super) fn is_table(text: &str) -> bool {
    header(text).is_some()
}

/// Where the seven numbers and the name of a scan stand.
struct Header {
    separator: Option<char>,
    columns: usize,
    numbers: [usize; 7],
    label: Option<usize>,
    /// Its place in the text, if it is no comment.
    line: Option<usize>,
}

/// The header is the first line, or the last comment before it if that has as many columns.
fn header(text: &str) -> Option<Header> {
    let (first, line) = lines::data(text).next()?;
    if let Some(header) = Header::of(line) {
        return Some(Header { line: Some(first), ..header });
    }
    let comment = text.lines().take(first).filter(|line| line.trim_start().starts_with('#')).last()?;
    let header = Header::of(comment.trim().trim_start_matches('#').trim())?;
    // a description in words may have commas where the data have blanks
    let separator = [header.separator, None].into_iter().find(|it| cells(line, *it).len() == header.columns)?;
    Some(Header { separator, ..header })
}

impl Header {
    fn of(line: &str) -> Option<Header> {
        let separator = [';', '\t', ','].into_iter().find(|separator| line.contains(*separator));
        let names: Vec<String> = cells(line, separator).iter().map(|cell| cell.to_lowercase()).collect();
        let place = |known: &[&str]| names.iter().position(|name| known.contains(&name.as_str()));
        let mut numbers = [0; 7];
        for (slot, known) in numbers.iter_mut().zip(COLUMNS) {
            *slot = place(known)?;
        }
        let label = place(NAMES).or_else(|| place(TIMES));
        Some(Header { separator, columns: names.len(), numbers, label, line: None })
    }
}

/// The cells of a line, without the quotes round them.
fn cells(line: &str, separator: Option<char>) -> Vec<Cow<'_, str>> {
    match separator {
        None => lines::words(line),
        Some(separator) => line.split(separator).map(|cell| Cow::from(cell.trim().trim_matches('"').trim())).collect(),
    }
}

/// A table with a header.
pub(super) fn read_table(text: &str) -> Result<PoseFile, Fault> {
    let header = header(text).ok_or_else(|| Fault::file("it has no header that names tx ty tz qx qy qz qw"))?;
    let mut read = Lines::default();
    for (index, line) in lines::data(text).filter(|(index, _)| Some(*index) != header.line) {
        let cells = cells(line, header.separator);
        if cells.len() != header.columns {
            let problem = format!("it has {} columns, the header {}", cells.len(), header.columns);
            return Err(Fault::line(index, problem));
        }
        let mut numbers = [0.0; 7];
        for (slot, column) in numbers.iter_mut().zip(header.numbers) {
            let cell =
                if header.separator == Some(';') { cells[column].replace(',', ".") } else { cells[column].to_string() };
            *slot = cell
                .parse()
                .map_err(|_| Fault::line(index, format!("{cell:?} in column {} is no number", column + 1)))?;
        }
        read.push(index, header.label.map(|column| &*cells[column]), numbers)?;
    }
    Ok(read.file())
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;
    use visage_geometry::Motion;

    fn sound(text: &str) -> PoseFile {
        read("poses.txt", text.as_bytes()).expect(text)
    }

    #[test]
    fn tum_trajectories_are_read_by_name_time_or_order() {
        let file = sound("# timestamp tx ty tz qx qy qz qw\n1.50 1 2 3 0 0 0 1\n2.5 4 5 6 0 0 0 1\n");
        assert_eq!((file.kind, file.naming), ("quaternion table", Naming::Order));
        let file = sound("1.50 1 2 3 0 0 0 1\n2.5 4 5 6 0 0 0 1\n");
        assert_eq!((file.kind, file.naming), ("TUM trajectory", Naming::Order));
        assert_eq!(file.poses[1].1, Motion::translation(4.0, 5.0, 6.0));
        let by_time = file.clone().named_as(&["2.5.ply", "1.50.ply", "0.ply"]).expect("named after times");
        assert_eq!(by_time.to_map()["2.5.ply"].translation.x, 4.0);
        let by_order = file.named_as(&["s10.ply", "s9.ply"]).expect("as many");
        assert_eq!(by_order.to_map()["s10.ply"].translation.x, 4.0);
        assert_eq!(sound("1e9 1 2 3 0 0 0 1\n1e9 4 5 6 0 0 0 1\n").poses[1].0, "pose 2", "times that are rounded");
        let named = sound("b.ply 1 2 3 0 0 0 1.005\n");
        assert_eq!((named.naming, named.rounded[0].0.as_str()), (Naming::Scans, "b.ply"));
    }

    #[test]
    fn a_header_says_where_the_columns_are() {
        let text = "name,qw,qx,qy,qz,tx,ty,tz\n\"a.ply\",1,0,0,0,1,2,3\n";
        assert_eq!(sound(text).to_map()["a.ply"], Motion::translation(1.0, 2.0, 3.0));
        let text = "File;TX;TY;TZ;QX;QY;QZ;QW\nmy scan.ply;1,5;2;3;0;0;0;1\n";
        assert_eq!(sound(text).to_map()["my scan.ply"], Motion::translation(1.5, 2.0, 3.0));
        // the order of a comment counts, too: here the real part comes first
        let file = sound("# timestamp, tx, ty, tz, qw, qx, qy, qz\n0 1 2 3 1 0 0 0\n");
        assert_eq!(file.poses[0].1, Motion::translation(1.0, 2.0, 3.0));
        let file = sound("tx ty tz qx qy qz qw\n1 2 3 0 0 0 1\n");
        assert_eq!((file.naming, file.poses[0].0.as_str()), (Naming::Order, "pose 1"));
    }

    #[test]
    fn broken_lines_are_named() {
        for (text, problem) in [
            ("0 1 2 3 0 0 0 1\n0 1 2\n", "line 2: it is not `time tx"),
            ("0 1 2 3 0 0 0 3\n", "line 1: the quaternion's norm is 3, not 1"),
            ("0 1 2 nan 0 0 0 1\n", "line 1: a number is"),
            ("tx,ty,tz,qx,qy,qz,qw\n1,2,3\n", "line 2: it has 3 columns, the header 7"),
            ("tx,ty,tz,qx,qy,qz,qw\n1,2,a,0,0,0,1\n", "line 2: \"a\" in column 3 is no number"),
        ] {
            let error = read("p", text.as_bytes()).expect_err(text).to_string();
            assert!(error.starts_with(&format!("\"p\": {problem}")), "{error}");
        }
    }
}
