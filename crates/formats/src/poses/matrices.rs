//! Matrices without more around them: a matrix a line (KITTI), or rows alone, one file a scan (CloudCompare) or all in
//! one.

use super::lines::{self, numbers, numbers_of};
use super::{Fault, LAST_ROW, Naming, PoseFile, rows_of_12, rows_of_16};
use crate::FormatError;
use visage_geometry::{Motion, PoseConvention, se3};

/// Whether the first line is a whole matrix: 12 or 16 numbers, perhaps after a name or number.
pub(super) fn is_flat(text: &str) -> bool {
    let Some((_, line)) = lines::data(text).next() else { return false };
    let words = lines::words(line);
    let numbers = words.iter().rev().take_while(|word| lines::is_number(word)).count();
    matches!(words.len(), 12 | 16) && numbers == words.len()
        || matches!(words.len(), 13 | 17) && numbers + 1 >= words.len()
}

/// A matrix a line, row by row.
pub(super) fn read_flat(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { other_conventions: &[PoseConvention::WorldToScan], ..PoseFile::default() };
    file.naming = Naming::Order;
    for (index, line) in lines::data(text) {
        let words = lines::words(line);
        let has_name = matches!(words.len(), 13 | 17);
        let (name, numbers) = words.split_at(usize::from(has_name));
        let rows = numbers_of(numbers).map(|n| rows_of_12(&n)).or_else(|| numbers_of(numbers).map(|n| rows_of_16(&n)));
        let rows =
            rows.ok_or_else(|| Fault::line(index, "it is not 12 or 16 numbers, as the lines of KITTI poses are"))?;
        let name = name.first().map_or_else(|| file.next_label(), |name| name.to_string());
        if !lines::is_number(&name) && has_name {
            file.naming = Naming::Scans;
        }
        file.push_matrix(&name, rows)?;
    }
    Ok(file)
}

/// Whether the first line is a row of a matrix.
pub(super) fn is_bare(text: &str) -> bool {
    lines::data(text).next().is_some_and(|(_, line)| lines::count_numbers(line) == Some(LAST_ROW.len()))
}

/// Rows alone: a matrix ends with its row 0 0 0 1, or, if there are none, after three rows.
pub(super) fn read_bare(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { other_conventions: &[PoseConvention::WorldToScan], ..PoseFile::default() };
    file.naming = Naming::Order;
    let height = if lines::data(text).nth(3).is_some_and(|(_, line)| numbers(line) != Some(LAST_ROW)) { 3 } else { 4 };
    let height = if lines::data(text).nth(3).is_none() { 3 } else { height };
    let mut rows = [LAST_ROW; 4];
    let mut filled = 0;
    for (index, line) in lines::data(text) {
        rows[filled] =
            numbers(line).ok_or_else(|| Fault::line(index, "it is no row of 4 numbers, as those above it are"))?;
        filled += 1;
        if filled == height {
            file.push_matrix(&file.next_label(), rows)?;
            (rows, filled) = ([LAST_ROW; 4], 0);
        }
    }
    if filled > 0 {
        let problem = format!("the last of the matrices, which have {height} rows each, has {filled} rows");
        return Err(Fault::file(problem));
    }
    Ok(file)
}

/// Joins files with one bare matrix each, whose names begin with those of their scans, as CloudCompare writes
/// `scan_01_REGISTRATION_MATRIX.txt`. Other files are passed over; which, `said` tells.
///
/// # Errors
/// [`FormatError::Malformed`] if none of the files is a matrix, or one is no rigid motion.
pub fn read_folder(files: &[(&str, &[u8])]) -> Result<PoseFile, FormatError> {
    let mut joined = PoseFile { other_conventions: &[PoseConvention::WorldToScan], ..PoseFile::default() };
    (joined.kind, joined.naming) = ("bare matrices", Naming::Files);
    let mut passed_over = Vec::new();
    for (name, bytes) in files {
        let text = std::str::from_utf8(bytes).map(|text| text.trim_start_matches('\u{feff}')).unwrap_or_default();
        let is_one = is_bare(text) && lines::data(text).count() <= 4;
        if !is_one {
            passed_over.push(*name);
            continue;
        }
        let matrix = read_bare(text).map_err(|fault| fault.of_file(name))?;
        joined.poses.extend(matrix.poses.into_iter().map(|(_, pose)| ((*name).to_owned(), pose)));
        joined.scales.extend(matrix.scales.into_values().map(|scale| ((*name).to_owned(), scale)));
        joined.matrices.extend(matrix.matrices.into_values().map(|rows| ((*name).to_owned(), rows)));
        joined.rounded.extend(matrix.rounded.into_iter().map(|(_, distance)| ((*name).to_owned(), distance)));
    }
    if joined.poses.is_empty() {
        let problem = format!("none of its {} files is a matrix of 4 rows of 4 numbers", files.len());
        return Err(Fault::file(problem).of_file("the folder of poses"));
    }
    if let Some(first) = passed_over.first() {
        joined.said.push(format!("{} file(s) that hold no matrix are passed over, such as {first}", passed_over.len()));
    }
    Ok(joined)
}

/// Writes one pose as four rows, as CloudCompare reads them.
pub fn write_matrix(pose: &Motion) -> String {
    let row = |[a, b, c, d]: [f64; 4]| format!("{a} {b} {c} {d}\n");
    se3::to_rows(pose).map(row).concat()
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;

    const ROWS: &str = "1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n";

    fn sound(text: &str) -> PoseFile {
        read("poses.txt", text.as_bytes()).expect(text)
    }

    #[test]
    fn a_matrix_a_line_with_or_without_names() {
        let line = "1 0 0 4 0 1 0 5 0 0 1 6";
        let file = sound(&format!("{line}\n{line} 0 0 0 1\n"));
        assert_eq!((file.kind, file.naming, file.poses.len()), ("KITTI poses", Naming::Order, 2));
        assert_eq!(file.poses[1].1, Motion::translation(4.0, 5.0, 6.0));
        let file = sound(&format!("a.ply,{}\n", line.replace(' ', ",")));
        assert_eq!((file.naming, file.poses[0].0.as_str()), (Naming::Scans, "a.ply"));
        assert_eq!(sound(&format!("7 {line}\n")).naming, Naming::Order);
        let error = read("p", format!("{line}\n1 2 3\n").as_bytes()).expect_err("short").to_string();
        assert!(error.starts_with("\"p\": line 2: it is not 12 or 16 numbers"), "{error}");
    }

    #[test]
    fn rows_alone_are_one_matrix_or_several() {
        for (text, count) in
            [(ROWS.to_owned(), 1), (ROWS.repeat(3), 3), (ROWS[..24].to_owned(), 1), (ROWS[..24].repeat(2), 2)]
        {
            let file = sound(&text);
            assert_eq!((file.kind, file.naming, file.poses.len()), ("bare matrices", Naming::Order, count), "{text}");
            assert_eq!(file.poses[0].1, Motion::translation(4.0, 5.0, 6.0));
        }
        assert_eq!(sound("[[1. 0. 0. 4.]\n [0. 1. 0. 5.]\n [0. 0. 1. 6.]\n [0. 0. 0. 1.]]").poses.len(), 1);
        for cut in [&ROWS.repeat(2)[..40], "1 0 0 4\n", "1 0 0 4\n0 1 0 5\nx\n"] {
            assert!(read("p", cut.as_bytes()).is_err(), "{cut}");
        }
    }

    #[test]
    fn files_with_one_matrix_each_are_joined() {
        let motion = Motion::translation(1.0, 2.0, 3.5);
        let written = write_matrix(&motion);
        assert_eq!(written, "1 0 0 1\n0 1 0 2\n0 0 1 3.5\n0 0 0 1\n");
        let files: [(&str, &[u8]); 4] = [
            ("scan_01_REGISTRATION_MATRIX.txt", written.as_bytes()),
            ("scan_0.txt", ROWS.as_bytes()),
            ("scan_01.ply", b"ply\n"),
            ("both.txt", &ROWS.repeat(2).into_bytes()),
        ];
        let joined = read_folder(&files).expect("two matrices").named_as(&["scan_0.ply", "scan_01.ply", "scan_1.ply"]);
        let joined = joined.expect("both fit");
        assert_eq!(joined.to_map()["scan_01.ply"], motion);
        assert_eq!(joined.to_map()["scan_0.ply"], Motion::translation(4.0, 5.0, 6.0));
        assert_eq!(joined.said, ["2 file(s) that hold no matrix are passed over, such as scan_01.ply"]);
        let error = read_folder(&files[2..]).expect_err("none").to_string();
        assert!(error.contains("none of its 2 files is a matrix of 4 rows of 4 numbers"), "{error}");
    }
}
