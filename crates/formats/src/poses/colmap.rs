//! COLMAP's `images.txt`: for each image a line with its pose and name, and a line with its points. Poses map the world
//! into the image.

use super::lines;
use super::{Fault, PoseFile, pose_from_quaternion};

/// An id, a quaternion, a translation, a camera, a name.
const WORDS: usize = 10;

/// Whether the first line is that of an image. A name of several numbers is none: such a line is a matrix.
pub(super) fn fits(text: &str) -> bool {
    lines::data(text).next().is_some_and(|(_, line)| {
        image(line).is_some_and(|(_, name)| lines::count_numbers(name).is_none_or(|count| count == 1))
    })
}

/// Reads the poses, and turns them round.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let said = vec!["the poses of COLMAP map the world into the images: they are inverted".to_owned()];
    let mut file = PoseFile { said, ..PoseFile::default() };
    let mut lines = text.lines().enumerate().map(|(index, line)| (index, line.trim())).peekable();
    while let Some((index, line)) = lines.next() {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let problem = "it is not `ID qw qx qy qz tx ty tz CAMERA NAME`, the line of an image";
        let ([qw, qx, qy, qz, tx, ty, tz], name) = image(line).ok_or_else(|| Fault::line(index, problem))?;
        let (pose, distance) = pose_from_quaternion([tx, ty, tz, qx, qy, qz, qw])
            .map_err(|problem| Fault::line(index, format!("the pose of {name}: {problem}")))?;
        file.push(name, pose.inverse(), distance);
        // the points follow, `X Y ID` each; where programs left their line out, the next image does
        lines.next_if(|(_, line)| lines::count_numbers(line).is_some_and(|count| count % 3 == 0));
    }
    Ok(file)
}

/// The pose and the name (which may hold blanks) of an image.
fn image(line: &str) -> Option<([f64; 7], &str)> {
    let mut rest = line;
    let mut word = || {
        let (word, after) = rest.split_once(char::is_whitespace)?;
        rest = after.trim_start();
        Some(word)
    };
    word().filter(|id| lines::is_index(id))?;
    let mut pose = [0.0; WORDS - 3];
    for slot in &mut pose {
        *slot = word()?.parse().ok()?;
    }
    word().filter(|camera| lines::is_index(camera))?;
    (!rest.is_empty()).then_some((pose, rest))
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use visage_geometry::{Motion, Point3};

    #[test]
    fn images_are_read_inverted_with_and_without_their_points() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let text = format!(
            "# IMAGE_ID, QW, ...\n1 1 0 0 0 1 2 3 1 my scan.png\n\n2 {half} 0 0 {half} 5 0 0 1 b.png\n1.5 2.5 -1 3 4 7\n\
             3 1 0 0 0 0 0 0 1 c.png\n4 1 0 0 0 0 0 0 1 d.png"
        );
        let file = read("images.txt", text.as_bytes()).expect("sound");
        let names: Vec<&str> = file.poses.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!((file.kind, names), ("COLMAP `images.txt`", vec!["my scan.png", "b.png", "c.png", "d.png"]));
        assert_eq!(file.poses[0].1, Motion::translation(-1.0, -2.0, -3.0));
        // the world's origin is at x = 5 of image b
        assert!((file.poses[1].1 * Point3::new(5.0, 0.0, 0.0)).coords.norm() < 1e-12);
        // a picture of the same name stands for the scan
        let named = file.named_as(&["my scan.ply", "b.ply", "c.ply", "d.ply"]).expect("fits");
        assert_eq!(named.poses[1].0, "b.ply");
    }

    #[test]
    fn broken_lines_are_named() {
        for (line, problem) in [
            ("2 1 0 0 0 1 2", "line 3: it is not `ID qw"),
            ("2 2 0 0 0 1 2 3 1 b.png", "line 3: the pose of b.png: the quaternion's norm is 2"),
            ("2 nan 0 0 0 1 2 3 1 b.png", "line 3: the pose of b.png: a number is"),
        ] {
            let text = format!("1 1 0 0 0 1 2 3 1 a.png\n\n{line}\n");
            let error = read("x", text.as_bytes()).expect_err(line).to_string();
            assert!(error.starts_with(&format!("\"x\": {problem}")), "{error}");
        }
    }
}
