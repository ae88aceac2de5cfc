//! Open3D's trajectories as text: for each scan three whole numbers and four rows. It has no names.

use super::lines::{self, numbers};
use super::{Fault, LAST_ROW, Naming, PoseFile, matrices};
use visage_geometry::{Motion, PoseConvention};

/// Whether the first line is three whole numbers, and a row follows.
pub(super) fn fits(text: &str) -> bool {
    let mut lines = lines::data(text).map(|(_, line)| line);
    let is_head = lines.next().is_some_and(is_head);
    is_head && lines.next().is_some_and(|line| lines::count_numbers(line) == Some(LAST_ROW.len()))
}

fn is_head(line: &str) -> bool {
    let words = lines::words(line);
    words.len() == 3 && words.iter().all(|word| lines::is_index(word.trim_start_matches('-')))
}

/// Reads a trajectory.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { other_conventions: &[PoseConvention::WorldToScan], ..PoseFile::default() };
    file.naming = Naming::Order;
    let mut lines = lines::data(text);
    while let Some((head_index, head)) = lines.next() {
        if !is_head(head) {
            return Err(Fault::line(
                head_index,
                "it is not the 3 whole numbers that begin a pose of a .log trajectory",
            ));
        }
        let mut rows = [LAST_ROW; 4];
        for row in &mut rows {
            let (index, line) =
                lines.next().ok_or_else(|| Fault::line(head_index, "its pose has fewer than 4 rows"))?;
            *row = numbers(line).ok_or_else(|| Fault::line(index, "it is no row of 4 numbers"))?;
        }
        file.push_matrix(&file.next_label(), rows)?;
    }
    Ok(file)
}

/// Writes the placed scans in the natural order of their names, which is how they are told apart without names. Where a
/// scan has no place, the file has a pose less than there are scans, and is of use only with the placed ones.
pub fn write(poses: &[(String, Option<Motion>)]) -> String {
    let mut placed: Vec<(&str, &Motion)> =
        poses.iter().filter_map(|(name, pose)| Some((name.as_str(), pose.as_ref()?))).collect();
    placed.sort_by(|a, b| natord::compare(a.0, b.0));
    let block = |(index, (_, pose)): (usize, &(&str, &Motion))| {
        format!("{index} {index} {}\n{}", index + 1, matrices::write_matrix(pose))
    };
    placed.iter().enumerate().map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;

    #[test]
    fn poses_go_to_the_scans_in_natural_order() {
        let pose = |x: f64| Some(Motion::translation(x, 0.0, 0.0));
        let text = write(&[("s10".into(), pose(10.0)), ("s9".into(), pose(9.0)), ("lost".into(), None)]);
        assert!(text.starts_with("0 0 1\n1 0 0 9\n"), "{text}");
        let file = read("a.log", text.as_bytes()).expect("sound");
        assert_eq!((file.kind, file.naming), ("Open3D trajectory", Naming::Order));
        let file = file.named_as(&["s10.ply", "s9.ply"]).expect("as many");
        assert_eq!(file.to_map()["s10.ply"].translation.x, 10.0);
    }

    #[test]
    fn broken_trajectories_name_the_line() {
        let row = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        for (text, place) in [
            (format!("0 0 1\n{row}a\n{row}"), "line 6"),
            (format!("0 0 1\n{}", &row[..24]), "line 1"),
            ("0 0 1\n1 0 0 0\n1 2 3\n".to_owned(), "line 3"),
        ] {
            let error = read("a.log", text.as_bytes()).expect_err("broken").to_string();
            assert!(error.starts_with(&format!("\"a.log\": {place}: ")), "{error}");
        }
    }
}
