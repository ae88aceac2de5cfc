//! Text blocks: a line with the scan's name, then the 4 rows (or 3) of its matrix. Lines that begin with `#` are
//! comments.

use super::lines::{self, numbers};
use super::{Fault, LAST_ROW, PoseFile, matrices};
use crate::quote;
use visage_geometry::{Motion, PoseConvention};

/// Whether the first line is no line of numbers, so that it may be a name; or it is one, and rows follow.
pub(super) fn fits(text: &str) -> bool {
    let mut lines = lines::data(text);
    let Some((_, first)) = lines.next() else { return false };
    let follows = lines.next().and_then(|(_, line)| lines::count_numbers(line));
    lines::count_numbers(first).is_none_or(|count| count == 1 && follows == Some(LAST_ROW.len()))
}

/// Reads text blocks.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { other_conventions: &[PoseConvention::WorldToScan], ..PoseFile::default() };
    read_blocks(lines::data(text), &mut file)?;
    Ok(file)
}

/// Reads blocks up to the end of the lines.
pub(super) fn read_blocks<'a>(lines: impl Iterator<Item = (usize, &'a str)>, file: &mut PoseFile) -> Result<(), Fault> {
    let mut lines = lines.peekable();
    while let Some((name_index, name)) = lines.next() {
        if lines::count_numbers(name) == Some(LAST_ROW.len()) {
            let problem =
                format!("a row of a matrix, {}, stands where the name of its scan is expected", quote(name.as_bytes()));
            return Err(Fault::line(name_index, problem));
        }
        let mut rows = [LAST_ROW; 4];
        for (row, slot) in rows.iter_mut().enumerate() {
            let is_row = |line: &str| lines::count_numbers(line) == Some(LAST_ROW.len());
            // the last row may be missing, if there is a name or nothing instead
            if row == 3 && lines.peek().is_none_or(|(_, line)| !is_row(line) && lines::count_numbers(line).is_none()) {
                continue;
            }
            let (index, line) = lines.next().ok_or_else(|| {
                let problem = format!("the pose of {} has fewer than 3 rows", quote(name.as_bytes()));
                Fault::line(name_index, problem)
            })?;
            *slot = numbers(line).ok_or_else(|| {
                let problem = format!("a row of the pose of {} is not 4 numbers", quote(name.as_bytes()));
                Fault::line(index, problem)
            })?;
        }
        file.push_matrix(name, rows)?;
    }
    Ok(())
}

/// Writes the placed scans as blocks of a name and four rows; unplaced ones are left out.
pub fn write(poses: &[(String, Option<Motion>)]) -> String {
    let block =
        |(name, pose): &(String, Option<Motion>)| Some(format!("{name}\n{}", matrices::write_matrix(pose.as_ref()?)));
    poses.iter().filter_map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_with_comments_and_blank_lines_are_read() {
        let text = "# by hand\n\nscan 0.ply\r\n1 0 0 4\n0 1 0 0\n# the third row\n0 0 1 0\n0 0 0 1\n\nb\n\
                    1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let file = read(text).unwrap_or_else(|fault| panic!("{}", fault.problem));
        assert_eq!(file.poses[0], ("scan 0.ply".into(), Motion::translation(4.0, 0.0, 0.0)));
        assert_eq!(file.poses[1], ("b".into(), Motion::identity()));
    }

    #[test]
    fn three_rows_and_commas_are_read() {
        let text = "a, b.ply\n1, 0, 0, 4\n0, 1, 0, 0\n0, 0, 1, 0\nb\n1,0 0,0 0,0 2,5\n0,0 1,0 0,0 0,0\n0 0 1 0\n";
        let file = read(text).unwrap_or_else(|fault| panic!("{}", fault.problem));
        assert_eq!(file.poses[0], ("a, b.ply".into(), Motion::translation(4.0, 0.0, 0.0)));
        assert_eq!(file.poses[1], ("b".into(), Motion::translation(2.5, 0.0, 0.0)));
        let numbered = read("7\n1 0 0 4\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        assert!(numbered.is_ok_and(|file| file.poses[0].0 == "7"));
    }

    #[test]
    fn broken_blocks_name_line_and_scan() {
        let problem = |text: &str| read(text).err().map(|fault| format!("{}: {}", fault.place, fault.problem));
        let short = problem("a.ply\n1 0 0 0\n0 1 0 0\n");
        assert_eq!(short.as_deref(), Some("line 1: the pose of \"a.ply\" has fewer than 3 rows"));
        let narrow = problem("a.ply\n1 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        assert_eq!(narrow.as_deref(), Some("line 2: a row of the pose of \"a.ply\" is not 4 numbers"));
        let long = problem("a.ply\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 0 0 0\n");
        assert!(long.is_some_and(|p| p.starts_with("line 6: a row of a matrix, \"1 0 0 0\", stands where")));
        assert!(problem("this is\nno pose file\n").is_some_and(|problem| problem.starts_with("line 2:")));
    }
}
