//! Poses and answers held against the truth.

use std::fmt;

use anyhow::Context;

use super::calls::Match;
use super::exhibits::Exhibit;
use crate::formats::poses::PoseFile;
use crate::geometry::{Motion, Point3};
use crate::synthetic::truth::{PoseError, pose_error};

/// Poses are right up to this: root mean square distance of the points from their true places, mm.
const MOST_POINTS_MM: f64 = 0.5;
/// And up to this turn of any view, degrees.
const MOST_ROTATION_DEG: f64 = 0.5;
/// A corner of the facial triangle is right up to this distance from its landmark, mm.
const MOST_CORNER_MM: f64 = 10.0;

/// The landmarks at the corners of the facial triangle, in the order of the answer.
const CORNERS: [&str; 3] = ["eye_r_inner", "eye_l_inner", "nose_tip"];

/// How far poses were from the truth before and after registration.
pub struct PoseFinding {
    before: PoseError,
    after: PoseError,
}

impl PoseFinding {
    /// Compares the poses that the service found with the true ones.
    pub fn new(exhibit: &Exhibit, found: &PoseFile) -> anyhow::Result<Self> {
        let found = found.to_map();
        let pose = |view: usize| {
            let name = Exhibit::file_name(view);
            found.get(&name).copied().with_context(|| format!("the {} is unplaced in {name}", exhibit.name))
        };
        let estimated = (0..exhibit.set.scans.len()).map(pose).collect::<anyhow::Result<Vec<Motion>>>()?;
        let points = exhibit.sample_points();
        let error = |poses: &[Motion]| pose_error(poses, &exhibit.set.poses, &points);
        Ok(PoseFinding { before: error(&exhibit.initial), after: error(&estimated) })
    }

    fn is_right(&self) -> bool {
        // written so that NaN is wrong
        self.after.points_rms <= MOST_POINTS_MM && self.after.rotation_deg_max <= MOST_ROTATION_DEG
    }
}

impl fmt::Display for PoseFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (before, after) = (&self.before, &self.after);
        write!(
            f,
            "{:.2} deg, {:.2} mm from the truth at first; now {:.3} deg (at most {:.3}), {:.3} mm",
            before.rotation_deg_mean,
            before.points_rms,
            after.rotation_deg_mean,
            after.rotation_deg_max,
            after.points_rms
        )
    }
}

/// What the service answered about one exhibit.
pub struct Finding {
    /// The exhibit's name.
    pub name: &'static str,
    /// The model that the service made of it.
    pub model_id: String,
    poses: PoseFinding,
    is_face: bool,
    /// True places of the triangle's corners, if it is a face.
    corners: Option<[Point3; 3]>,
    answer: Option<Match>,
}

impl Finding {
    /// An exhibit that is registered but not asked about yet.
    pub fn new(exhibit: &Exhibit, model_id: String, poses: PoseFinding) -> Self {
        let corner = |name: &str| exhibit.landmarks.get(name).copied();
        let corners = match CORNERS.map(corner) {
            [Some(right), Some(left), Some(nose)] => Some([right, left, nose]),
            _ => None,
        };
        Finding { name: exhibit.name, model_id, poses, is_face: exhibit.is_face, corners, answer: None }
    }

    /// Takes its answer from those of the query.
    pub fn answer(&mut self, matches: &[Match]) -> anyhow::Result<()> {
        let answer = matches.iter().find(|answer| answer.model_id == self.model_id);
        self.answer = Some(answer.with_context(|| format!("the query says nothing about the {}", self.name))?.clone());
        Ok(())
    }

    /// What is wrong with poses and answer, if anything.
    pub fn complaints(&self) -> Vec<String> {
        let mut complaints = Vec::new();
        if !self.poses.is_right() {
            complaints.push(format!("poses of the {} are off by {:.3} mm", self.name, self.poses.after.points_rms));
        }
        if self.answer.as_ref().map(|answer| answer.is_match) != Some(self.is_face) {
            complaints.push(format!(
                "the {} is taken for {}",
                self.name,
                if self.is_face { "no face" } else { "a face" }
            ));
        }
        let beside = |distance: &f64| distance.is_nan() || *distance > MOST_CORNER_MM;
        if let Some(distance) = self.corner_distance_mm().filter(beside) {
            complaints.push(format!("the face of the {} is found {distance:.1} mm beside its place", self.name));
        }
        complaints
    }

    /// The largest distance of a corner of the triangle found from its landmark; `None` if there is no face.
    fn corner_distance_mm(&self) -> Option<f64> {
        let found = self.answer.as_ref().filter(|answer| answer.is_match)?.triangle?;
        let distances = found.iter().zip(self.corners?).map(|(found, truth)| (Point3::from(*found) - truth).norm());
        Some(distances.fold(0.0, f64::max))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(answer) = &self.answer else { return write!(f, "{:<6} not asked", self.name) };
        let says = if answer.is_match { "a face" } else { "no face" };
        let judged = if answer.is_match == self.is_face { "right" } else { "WRONG" };
        write!(f, "{:<6} {says:<7} (score {:.2}): {judged}", self.name, answer.score)?;
        match self.corner_distance_mm() {
            Some(distance) => write!(f, "; eye corners and nose tip within {distance:.1} mm of the truth"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(points_rms: f64) -> PoseError {
        PoseError { rotation_deg_mean: 0.1, rotation_deg_max: 0.2, points_rms }
    }

    fn finding(points_rms: f64, is_face: bool, answer: Option<Match>) -> Finding {
        let corners = Some([Point3::origin(), Point3::new(30.0, 0.0, 0.0), Point3::new(15.0, -30.0, 20.0)]);
        Finding {
            name: "thing",
            model_id: "1".into(),
            poses: PoseFinding { before: error(7.0), after: error(points_rms) },
            is_face,
            corners: corners.filter(|_| is_face),
            answer,
        }
    }

    fn answer(is_match: bool, shift: f64) -> Option<Match> {
        let triangle = [[shift, 0.0, 0.0], [30.0, 0.0, 0.0], [15.0, -30.0, 20.0]];
        Some(Match { model_id: "1".into(), score: 0.5, is_match, triangle: Some(triangle) })
    }

    #[test]
    fn only_right_poses_and_answers_pass() {
        assert!(finding(0.1, true, answer(true, 3.0)).complaints().is_empty());
        assert!(finding(0.1, false, answer(false, 99.0)).complaints().is_empty());
        let complaint = |finding: Finding| finding.complaints().join("; ");
        assert_eq!(complaint(finding(0.9, true, answer(true, 0.0))), "poses of the thing are off by 0.900 mm");
        assert!(complaint(finding(f64::NAN, true, answer(true, 0.0))).contains("off by NaN"));
        assert_eq!(complaint(finding(0.1, false, answer(true, 0.0))), "the thing is taken for a face");
        assert_eq!(complaint(finding(0.1, true, answer(false, 0.0))), "the thing is taken for no face");
        assert_eq!(complaint(finding(0.1, true, None)), "the thing is taken for no face");
        assert!(complaint(finding(0.1, true, answer(true, 20.0))).contains("20.0 mm beside its place"));
    }
}
