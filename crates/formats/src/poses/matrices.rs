//! Matrices without more around them: a matrix a line (KITTI), or rows alone, one file a scan (CloudCompare) or all in
//! one.

use super::lines::{self, numbers, numbers_of};
use super::{Fault, LAST_ROW, Naming, PoseFile, rows_of_12, rows_of_16};
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
}
