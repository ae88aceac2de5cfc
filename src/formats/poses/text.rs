//! Text blocks: a line with the scan's name, then the 4 rows of its matrix. Lines that begin with `#` are comments.

use super::{Fault, PoseFile};
use crate::formats::quote;

/// Reads text blocks.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let lines = text.lines().enumerate().map(|(index, line)| (index, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let mut file = PoseFile::default();
    while let Some((name_index, name)) = lines.next() {
        let mut rows = [[0.0; 4]; 4];
        for row in &mut rows {
            let (index, line) = lines.next().ok_or_else(|| {
                let problem = format!("the pose of {} has fewer than 4 rows", quote(name.as_bytes()));
                Fault::line(name_index, problem)
            })?;
            *row = numbers(line).ok_or_else(|| {
                let problem = format!("a row of the pose of {} is not 4 numbers", quote(name.as_bytes()));
                Fault::line(index, problem)
            })?;
        }
        file.push_matrix(name, rows)?;
    }
    Ok(file)
}

fn numbers(line: &str) -> Option<[f64; 4]> {
    let values: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok()).collect();
    values?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Motion;

    #[test]
    fn blocks_with_comments_and_blank_lines_are_read() {
        let text = "# by hand\n\nscan 0.ply\r\n1 0 0 4\n0 1 0 0\n# the third row\n0 0 1 0\n0 0 0 1\n\nb\n\
                    1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let file = read(text).unwrap_or_else(|fault| panic!("{}", fault.problem));
        assert_eq!(file.poses[0], ("scan 0.ply".into(), Motion::translation(4.0, 0.0, 0.0)));
        assert_eq!(file.poses[1], ("b".into(), Motion::identity()));
    }

    #[test]
    fn broken_blocks_name_line_and_scan() {
        let problem = |text: &str| read(text).err().map(|fault| format!("{}: {}", fault.place, fault.problem));
        let short = problem("a.ply\n1 0 0 0\n0 1 0 0\n0 0 1 0\n");
        assert_eq!(short.as_deref(), Some("line 1: the pose of \"a.ply\" has fewer than 4 rows"));
        let narrow = problem("a.ply\n1 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        assert_eq!(narrow.as_deref(), Some("line 2: a row of the pose of \"a.ply\" is not 4 numbers"));
        assert!(problem("this is\nno pose file\n").is_some_and(|problem| problem.starts_with("line 2:")));
    }
}
