//! The poses of 3DTK, a file a scan: `scan000.pose` says where a scan starts, `scan000.frames` how it moved while it was
//! registered. Both are in the frame of its scans, which is left-handed: rotations are the same numbers in either.

use super::lines::{self, numbers};
use super::{Fault, Naming, PoseFile, rows_of_16, transposed};
use visage_geometry::Motion;

/// Numbers of a line of `.frames`: a matrix and the state of the scan.
const FRAME: usize = 17;

/// Whether the file is two lines of three numbers: a place and angles.
pub(super) fn is_pose(text: &str) -> bool {
    let mut lines = lines::data(text).map(|(_, line)| lines::count_numbers(line));
    lines.next() == Some(Some(3)) && lines.next() == Some(Some(3)) && lines.next().is_none()
}

/// Reads a place and the angles about x, y and z in degrees, of which the last is turned by first.
pub(super) fn read_pose(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { naming: Naming::Order, ..PoseFile::default() };
    let values: Vec<[f64; 3]> = lines::data(text).filter_map(|(_, line)| numbers(line)).collect();
    let [place, angles] = values.as_slice() else { return Err(Fault::file("it is not a place and three angles")) };
    for value in place.iter().chain(angles) {
        crate::checked_coordinate(*value).map_err(|problem| Fault::file(format!("a number {problem}")))?;
    }
    let [x, y, z] = angles.map(f64::to_radians);
    let about =
        |axis: nalgebra::Unit<nalgebra::Vector3<f64>>, angle| nalgebra::UnitQuaternion::from_axis_angle(&axis, angle);
    let (x_axis, y_axis, z_axis) =
        (nalgebra::Vector3::x_axis(), nalgebra::Vector3::y_axis(), nalgebra::Vector3::z_axis());
    let rotation = about(x_axis, x) * about(y_axis, y) * about(z_axis, z);
    file.push(&file.next_label(), Motion::from_parts((*place).into(), rotation), 0.0);
    Ok(file)
}

/// Whether the first line is a matrix, column by column, and a small whole number. A matrix row by row behind the number
/// of a scan (KITTI) has its zeros elsewhere.
pub(super) fn is_frames(text: &str) -> bool {
    lines::data(text).next().is_some_and(|(_, line)| frame(line).is_some())
}

/// The matrix of a line.
fn frame(line: &str) -> Option<[[f64; 4]; 4]> {
    let words = lines::words(line);
    let (state, matrix) = words.split_last()?;
    let matrix: [f64; FRAME - 1] = lines::numbers_of(matrix)?;
    let last_row = [3, 7, 11, 15].map(|place| matrix[place]);
    (lines::is_index(state) && last_row == super::LAST_ROW).then(|| transposed(rows_of_16(&matrix)))
}

/// Reads how a scan moved: where it is in the end.
pub(super) fn read_frames(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { naming: Naming::Order, ..PoseFile::default() };
    let mut last = None;
    for (index, line) in lines::data(text) {
        let problem = "it is not 16 numbers of a matrix, column by column, and the state of the scan";
        last = Some(frame(line).ok_or_else(|| Fault::line(index, problem))?);
    }
    file.push_matrix(&file.next_label(), last.ok_or_else(|| Fault::file("there is no pose in it"))?)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::super::{read, read_folder};
    use super::*;
    use visage_geometry::{Point3, se3};

    /// 3DTK's matrix of angles, as its source has it.
    fn matrix([x, y, z]: [f64; 3], place: [f64; 3]) -> [f64; 16] {
        let ((sx, cx), (sy, cy), (sz, cz)) = (x.sin_cos(), y.sin_cos(), z.sin_cos());
        let first = [cy * cz, sx * sy * cz + cx * sz, -cx * sy * cz + sx * sz, 0.0];
        let second = [-cy * sz, -sx * sy * sz + cx * cz, cx * sy * sz + sx * cz, 0.0];
        let columns = [first, second, [sy, -sx * cy, cx * cy, 0.0], [place[0], place[1], place[2], 1.0]];
        columns.as_flattened().try_into().expect("16 numbers")
    }

    fn line(matrix: &[f64; 16], state: u8) -> String {
        matrix.iter().map(|x| format!("{x} ")).collect::<String>() + &state.to_string() + "\n"
    }

    #[test]
    fn a_start_and_its_frames_are_one_pose() {
        let (angles, place) = ([10.0f64, -20.0, 30.0], [100.5, -7.0, 3e4]);
        let frames = line(&matrix([0.0; 3], [0.0; 3]), 2) + &line(&matrix(angles.map(f64::to_radians), place), 1);
        let start = "100.5 -7 30000\n10 -20 30\n";
        let [frames, start] = [&*frames, start].map(|text| read("scan000", text.as_bytes()).expect(text));
        assert_eq!((frames.kind, start.kind), ("3DTK `.frames`", "3DTK `.pose`"));
        assert_eq!((frames.poses.len(), start.poses.len(), frames.naming), (1, 1, Naming::Order));
        let point = Point3::new(1.0, 2.0, 3.0);
        let [by_frames, by_start] = [&frames, &start].map(|file| file.poses[0].1 * point);
        assert!((by_frames - by_start).amax() < 1e-9, "{by_frames} is not {by_start}");
        let rows = transposed(rows_of_16(&matrix(angles.map(f64::to_radians), place)));
        let read = se3::to_rows(&start.poses[0].1);
        assert!(read.as_flattened().iter().zip(rows.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_folder_has_one_of_each_scan_and_the_end_counts() {
        let end = |x: f64| line(&matrix([0.0; 3], [x, 0.0, 0.0]), 1).repeat(3);
        let (first, second) = (end(1.0), end(2.0));
        let files: [(&str, &[u8]); 5] = [
            ("scan000.3d", b"2 x 1\n1 2 3\n4 5 6\n"),
            ("scan000.frames", first.as_bytes()),
            ("scan000.pose", b"0 0 0\n0 0 0\n"),
            ("scan001.frames", second.as_bytes()),
            ("scan001.pose", b"7 0 0\n0 0 0\n"),
        ];
        let joined = read_folder(&files).expect("two scans");
        assert_eq!((joined.kind, joined.naming, joined.poses.len()), ("3DTK `.frames`", Naming::Files, 2));
        let said = "3 file(s) that hold no 3DTK `.frames` of one scan are passed over, such as scan000.3d";
        assert_eq!(joined.said, [said]);
        let named = joined.named_as(&["scan000.3d", "scan001.3d"]).expect("both").to_map();
        assert_eq!((named["scan000.3d"].translation.x, named["scan001.3d"].translation.x), (1.0, 2.0));
        let starts = read_folder(&[files[2], files[4]]).expect("two starts").named_as(&["scan000.3d", "scan001.3d"]);
        assert_eq!(starts.expect("both").to_map()["scan001.3d"].translation.x, 7.0);
    }

    #[test]
    fn lines_that_are_none_are_named() {
        let text = line(&matrix([0.0; 3], [0.0; 3]), 2) + "1 2 3\n";
        let error = read("a.frames", text.as_bytes()).expect_err("short").to_string();
        assert!(error.starts_with("\"a.frames\": line 2: it is not 16 numbers of a matrix"), "{error}");
        assert!(read("a.pose", b"nan 0 0\n0 0 0\n").is_err() && read("a.pose", b"1 2 3\n4 5 6\n7 8 9\n").is_err());
        // a number and a matrix row by row
        let kitti = read("a.txt", b"1 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n").expect("a matrix");
        assert_eq!(kitti.kind, "KITTI poses");
    }
}
