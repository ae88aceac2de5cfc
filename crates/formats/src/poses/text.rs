//! Text blocks: a line with the scan's name, then the 4 rows of its matrix. Lines that begin with `#` are comments.

use super::{Fault, PoseFile};
use crate::quote;

/// Reads text blocks.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let lines = text.lines().enumerate().map(|(index, line)| (index, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let mut file = PoseFile::default();
    while let Some((name_index, name)) = lines.next() {
        if let Some(problem) = no_name(name) {
            return Err(Fault::line(name_index, problem));
        }
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

/// Why a line that stands where a name is expected is none: it begins a block of a program that names no scans.
fn no_name(line: &str) -> Option<String> {
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let words: Vec<&str> = line.split_whitespace().collect();
    let is_index = |word: &&str| word.bytes().all(|byte| byte.is_ascii_digit());
    match words.len() {
        3 if words.iter().all(is_index) => {
            Some(format!("{} begins a pose of a trajectory (.log), which names no scan", quote(line.as_bytes())))
        }
        4 if words.iter().all(|word| is_number(word)) => Some(format!(
            "a row of a matrix, {}, stands where the name of its scan is expected",
            quote(line.as_bytes())
        )),
        _ => None,
    }
}

fn numbers(line: &str) -> Option<[f64; 4]> {
    let values: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok()).collect();
    values?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Motion;

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
        let row = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let bare = problem(row);
        assert!(
            bare.is_some_and(|problem| problem.starts_with("line 1: a row of a matrix, \"1 0 0 0\", stands where"))
        );
        let log = problem(&format!("0 0 1\n{row}1 1 2\n{row}"));
        assert_eq!(log.as_deref(), Some("line 1: \"0 0 1\" begins a pose of a trajectory (.log), which names no scan"));
        assert!(problem("this is\nno pose file\n").is_some_and(|problem| problem.starts_with("line 2:")));
    }
}
