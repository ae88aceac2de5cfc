//! Folders with a file of poses a scan.

use super::kinds::OF_ONE_SCAN;
use super::{Fault, Naming, PoseFile, parse};
use crate::FormatError;

/// Joins files with the pose of one scan each, whose names begin with those of their scans, as CloudCompare writes
/// `scan_01_REGISTRATION_MATRIX.txt` and 3DTK `scan000.frames` and `scan000.pose`. Other files are passed over; which, the
/// notes tell.
///
/// # Errors
/// [`FormatError::Malformed`] if none of the files holds one pose, or one is no rigid motion.
pub fn read_folder(files: &[(&str, &[u8])]) -> Result<PoseFile, FormatError> {
    let mut read = Vec::new();
    for (name, bytes) in files {
        let kind = of_one_scan(bytes);
        let file = kind.map(|_| parse(bytes).map_err(|fault| fault.of_file(name))).transpose()?;
        read.push((*name, kind, file));
    }
    let kind = OF_ONE_SCAN.into_iter().find(|kind| read.iter().any(|(_, found, _)| *found == Some(kind)));
    let Some(kind) = kind else {
        let problem = format!("none of its {} files holds the pose of one scan", files.len());
        return Err(Fault::file(problem).of_file("the folder of poses"));
    };
    let mut joined = PoseFile { kind, naming: Naming::Files, ..PoseFile::default() };
    let mut passed_over = Vec::new();
    for (name, found, file) in read {
        let Some(file) = file.filter(|_| found == Some(kind)) else {
            passed_over.push(name);
            continue;
        };
        joined.other_conventions = file.other_conventions;
        joined.poses.extend(file.poses.into_iter().map(|(_, pose)| (name.to_owned(), pose)));
        joined.scales.extend(file.scales.into_values().map(|scale| (name.to_owned(), scale)));
        joined.matrices.extend(file.matrices.into_values().map(|rows| (name.to_owned(), rows)));
        joined.rounded.extend(file.rounded.into_iter().map(|(_, distance)| (name.to_owned(), distance)));
    }
    if let Some(first) = passed_over.first() {
        let count = passed_over.len();
        joined.said.push(format!("{count} file(s) that hold no {kind} of one scan are passed over, such as {first}"));
    }
    Ok(joined)
}

/// The kind of a file that holds the pose of one scan.
fn of_one_scan(bytes: &[u8]) -> Option<&'static str> {
    let text = std::str::from_utf8(bytes).ok()?.trim_start_matches('\u{feff}');
    let kind = super::kinds::of_text(text)?;
    let is_one = match kind {
        // several matrices are several scans
        super::kinds::MATRICES => super::lines::data(text).nth(4).is_none(),
        _ => true,
    };
    OF_ONE_SCAN.into_iter().find(|one| is_one && *one == kind)
}

#[cfg(test)]
mod tests {
    use super::super::write_matrix;
    use super::*;
    use visage_geometry::Motion;

    const ROWS: &str = "1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n";

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
        assert_eq!(
            joined.said,
            ["2 file(s) that hold no bare matrices of one scan are passed over, such as scan_01.ply"]
        );
        let error = read_folder(&files[2..]).expect_err("none").to_string();
        assert!(error.contains("none of its 2 files holds the pose of one scan"), "{error}");
    }
}
