//! Stanford `.conf`: lines `bmesh FILE tx ty tz qx qy qz qw`.
//!
//! The format turns points with the transposed matrix of its quaternion: `p_world = R(q)^T p + t`. So the rotation
//! of the pose is the conjugate of what is printed, and the translation stays.

use super::{Fault, PoseFile, pose_from_quaternion};
use crate::checked_coordinate;
use visage_geometry::Motion;

/// Whether there is a `bmesh` line.
pub(super) fn fits(text: &str) -> bool {
    text.lines().any(|line| line.split_whitespace().next() == Some("bmesh"))
}

/// Reads the `bmesh` lines; `camera`, `mesh` and other lines are passed over.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile::default();
    for (index, line) in text.lines().enumerate() {
        if let Some(rest) = line.trim().strip_prefix("bmesh").filter(|rest| rest.starts_with([' ', '\t'])) {
            let (name, numbers) = split(rest).ok_or_else(|| {
                Fault::line(index, "a bmesh line is `bmesh FILE tx ty tz qx qy qz qw` with finite numbers")
            })?;
            let (pose, distance) = pose_from_quaternion(numbers).map_err(|problem| Fault::line(index, problem))?;
            let pose = Motion::from_parts(pose.translation, pose.rotation.conjugate());
            file.push(&name, pose, distance);
        }
    }
    Ok(file)
}

/// The name (which may hold blanks) and the seven numbers behind it.
fn split(rest: &str) -> Option<(String, [f64; 7])> {
    let mut rest = rest.trim();
    let mut numbers = [0.0; 7];
    for slot in numbers.iter_mut().rev() {
        let (before, word) = rest.rsplit_once(char::is_whitespace)?;
        *slot = checked_coordinate(word.parse().ok()?).ok()?;
        rest = before.trim_end();
    }
    (!rest.is_empty()).then(|| (rest.to_owned(), numbers))
}

/// Writes the placed scans as `bmesh` lines; unplaced ones are left out, since the format has no word for them.
pub fn write(poses: &[(String, Option<Motion>)]) -> String {
    let mut text = String::new();
    for (name, pose) in poses {
        let Some(pose) = pose else { continue };
        let t = pose.translation.vector;
        let q = pose.rotation.conjugate();
        text.push_str(&format!("bmesh {name} {} {} {} {} {} {} {}\n", t.x, t.y, t.z, q.i, q.j, q.k, q.w));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Point3, Vector3};

    #[test]
    fn the_quaternion_is_conjugated_and_the_translation_kept() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let text = format!("camera 1 2 3 4 5 6 7\nmesh x_cybcyl 0 0 0 0 0 0 1\nbmesh a.ply 5 0 0 0 0 {half} {half}\n");
        let file = read(&text).unwrap_or_else(|fault| panic!("{}", fault.problem));
        let [(name, pose)] = file.poses.as_slice() else { panic!("one bmesh line") };
        assert_eq!(name, "a.ply");
        // q turns x to y, so its transpose turns y to x
        assert!((pose * Point3::new(0.0, 1.0, 0.0) - Point3::new(6.0, 0.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn broken_lines_are_named() {
        let problem = |text: &str| read(text).err().map(|fault| format!("{}: {}", fault.place, fault.problem));
        assert_eq!(
            problem("\nbmesh a.ply 0 0 0 0 0 0 2").as_deref(),
            Some("line 2: the quaternion's norm is 2, not 1")
        );
        for text in ["bmesh a.ply 0 0 0 0 0 1", "bmesh 0 0 0 0 0 0 1", "bmesh a.ply 0 0 nan 0 0 0 1", "bmesh "] {
            let problem = problem(text).unwrap_or_default();
            assert!(problem.starts_with("line 1: a bmesh line is") || text == "bmesh ", "{text}: {problem}");
        }
    }

    #[test]
    fn unplaced_scans_are_left_out() {
        let pose = Motion::new(Vector3::x(), Vector3::zeros());
        assert_eq!(write(&[("a".into(), None), ("b".into(), Some(pose))]), "bmesh b 1 0 0 -0 -0 -0 1\n");
    }
}
