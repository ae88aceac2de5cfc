//! Standards made by users: one model of a class with named landmarks tells the others of its class. Pure.
//!
//! A class is judged as faces are ([`crate::faces`]): caps and pits of the surface make triangles, the cheapest of them
//! against the class's [`SelectiveTriangle`]s pose its dense region, and what that region's fit leaves decides. The
//! lengths in which the fit is measured are those of the face standard, so a class is scaled to it: "mm on the standard"
//! are such that its first triangle is as large as the face's.
//!
//! - [`corners`]: caps and pits as corners, candidates and what they cost
//! - `annotation`: from a surface with landmarks to a class
//! - `search`: the best place of a class on a surface
//! - [`limit`]: which residual is still of the class

mod annotation;
pub mod corners;
pub mod limit;
mod search;

use serde::{Deserialize, Serialize};

pub use annotation::{Annotation, CornerChoice, Landmark, StandardError};
pub use corners::{CornerKind, SelectiveTriangle};
pub use search::Found;

use crate::faces::similarity::Similarity;
use crate::faces::template::Template;
use crate::faces::{self, DescribeError};
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Point3, Surface, Unit, Vector3};

/// What a class is made of. Positions are in the frame of the standard: the axes of its file, the origin in the middle
/// of the dense region, scaled so that the first triangle has the size of the face standard's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Standard {
    /// The version of the operator that made it.
    pub version: u32,
    /// The unit of its file.
    pub unit: Unit,
    /// Units of the file in one mm on the standard.
    pub scale: f64,
    /// Where the origin lies in the file.
    pub origin: Point3,
    /// The length that curvatures are measured at, mm on the standard.
    pub expected_mm: f64,
    /// That length as a share of the diagonal of the standard's own bounding box along its principal axes.
    pub share_of_diagonal: f64,
    /// The triangles that its place is found by, the most telling first.
    pub triangles: Vec<SelectiveTriangle>,
    /// All landmarks by name.
    pub landmarks: Vec<(String, Point3)>,
    /// Points of its dense region, most telling spread first.
    pub points: Vec<Point3>,
    /// The outward unit normals there.
    pub normals: Vec<Vector3>,
}

impl Standard {
    /// The version of the operator; stored beside what it made.
    pub const VERSION: u32 = 2;

    /// Makes a class of a surface with landmarks. Runs inside the caller's rayon pool.
    pub fn annotated(
        surface: &Surface,
        unit: Unit,
        annotation: &Annotation,
        progress: &Progress,
    ) -> Result<Standard, StandardError> {
        annotation::annotated(surface, unit, annotation, progress)
    }

    /// Where on a surface the class's region fits best; `None` if no triangle of it was worth a closer look. Runs inside
    /// the caller's rayon pool.
    pub fn find(&self, surface: &Surface, unit: Unit, progress: &Progress) -> Result<Option<Found>, DescribeError> {
        Ok(Self::find_each(&[self], surface, unit, progress)?.pop().flatten())
    }

    /// [`Standard::find`] for several classes on one surface, which is made ready once; in their order.
    pub fn find_each(
        standards: &[&Standard],
        surface: &Surface,
        unit: Unit,
        progress: &Progress,
    ) -> Result<Vec<Option<Found>>, DescribeError> {
        progress.report(Stage::Describing, 0.0);
        let (surface, motion_file_own) = faces::in_own_frame(&faces::cleaned(surface, progress)?);
        let bounds = faces::checked_bounds(&surface)?;
        let prepared = faces::Prepared::new(&surface, bounds.diagonal(), progress)?;
        let oriented = prepared.oriented(bounds);
        let in_file = |found: Found| Found { pose: found.pose.moved(&motion_file_own), ..found };
        let found: Result<Vec<_>, Canceled> = standards
            .iter()
            .map(|standard| Ok(search::find(&oriented, unit, standard, progress)?.map(in_file)))
            .collect();
        Ok(found?)
    }

    /// The dense region as the fit wants it.
    fn template(&self) -> Template {
        Template::rigid(&self.points, &self.normals)
    }

    /// Millimetres in one mm on the standard, if its unit is known.
    fn true_scale(&self) -> Option<f64> {
        self.unit.in_mm().map(|mm| mm * self.scale)
    }

    /// A position of the standard's frame in its file.
    pub fn in_file(&self, place: &Point3) -> Point3 {
        self.origin + place.coords * self.scale
    }

    /// The landmarks as a pose lays them into a model.
    pub fn posed_landmarks(&self, pose: &Similarity) -> Vec<(String, Point3)> {
        self.landmarks.iter().map(|(name, place)| (name.clone(), pose.point(place))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::tests::{height, mask};
    use crate::saliency::curvature::tests::sphere;
    use visage_geometry::{Cloud, Motion, Vector3};

    const PLACES: [(&str, f64, f64); 3] = [("right", -21.7, 33.0), ("left", 21.7, 33.0), ("nose", 0.0, 1.0)];

    fn place(x: f64, y: f64) -> Point3 {
        Point3::new(x, y, height(x, y))
    }

    fn annotation() -> Annotation {
        let landmark = |(name, x, y): &(&str, f64, f64)| Landmark { name: (*name).to_owned(), place: place(*x, *y) };
        Annotation { landmarks: PLACES.iter().map(landmark).collect(), triangle: None }
    }

    fn with_kinds(kinds: [CornerKind; 3]) -> Annotation {
        let choice = |k: usize| CornerChoice { name: PLACES[k].0.to_owned(), kind: Some(kinds[k]) };
        Annotation { triangle: Some([0, 1, 2].map(choice)), ..annotation() }
    }

    fn made(surface: &Surface, annotation: &Annotation) -> Result<Standard, StandardError> {
        Standard::annotated(surface, Unit::Mm, annotation, &Progress::silent())
    }

    fn moved(surface: &Surface, motion: &Motion, scale: f64) -> Surface {
        let mut moved = surface.moved(motion);
        for point in &mut moved.cloud.points {
            *point *= scale;
        }
        moved
    }

    fn inside_out(mut surface: Surface) -> Surface {
        for face in &mut surface.faces {
            face.swap(0, 1);
        }
        surface
    }

    #[test]
    fn a_class_finds_itself_turned_and_scaled_and_as_a_bare_cloud() {
        let standard = made(&mask(), &annotation()).expect("a sound annotation");
        let kinds = standard.triangles[0].corners.each_ref().map(|corner| corner.kind);
        assert_eq!(kinds, [CornerKind::Pit, CornerKind::Pit, CornerKind::Cap]);
        for (name, x, y) in PLACES {
            let (_, landmark) = standard.landmarks.iter().find(|(known, _)| known == name).expect("it was named");
            assert!((standard.in_file(landmark) - place(x, y)).norm() < 1e-9);
        }
        let motion = Motion::new(Vector3::new(50.0, -20.0, 7.0), Vector3::new(2.0, 1.0, -0.4));
        let bare = Surface { cloud: mask().cloud, ..Surface::default() };
        for surface in [moved(&mask(), &motion, 0.01), moved(&bare, &motion, 0.01)] {
            let found = standard.find(&surface, Unit::Unknown, &Progress::silent()).expect("a sound surface");
            let found = found.expect("it is there");
            assert!(found.residual_mm < 1.0 && found.observed > 0.95, "{found:?}");
            for ((name, landmark), (_, x, y)) in standard.posed_landmarks(&found.pose).iter().zip(PLACES) {
                let beside = (landmark - (motion * place(x, y)) * 0.01).norm();
                assert!(beside < 0.01 * 3.0, "{name} {beside}");
            }
        }
    }

    #[test]
    fn a_ball_is_not_of_the_class_nor_one_of_another_true_size() {
        let standard = made(&mask(), &annotation()).expect("a sound annotation");
        let mesh = sphere(90.0, 4);
        let ball = Surface { cloud: Cloud::from_points(mesh.vertices), faces: mesh.faces, ..Surface::default() };
        let found = standard.find(&ball, Unit::Unknown, &Progress::silent()).expect("a sound surface");
        assert!(found.is_none_or(|found| found.residual_mm > limit::DEFAULT_LIMIT_MM), "{found:?}");
        let large = standard.find(&mask(), Unit::Cm, &Progress::silent()).expect("a sound surface");
        assert!(large.is_none_or(|found| found.residual_mm > limit::DEFAULT_LIMIT_MM), "{large:?}");
    }

    #[test]
    fn kinds_settle_the_side_of_an_open_mesh() {
        use CornerKind::{Cap, Pit};
        let standard = made(&inside_out(mask()), &with_kinds([Pit, Pit, Cap])).expect("the other side fits");
        assert!(standard.normals.iter().all(|normal| normal.z > 0.0), "outward is up");
        assert!(matches!(made(&mask(), &with_kinds([Cap, Pit, Cap])), Err(StandardError::NoCharacter { .. })));
    }

    #[test]
    fn what_can_not_be_a_class_says_why() {
        let mut annotation = annotation();
        annotation.landmarks[2].place.z += 40.0;
        assert!(matches!(made(&mask(), &annotation), Err(StandardError::OffSurface { name, .. }) if name == "nose"));
        annotation.landmarks.truncate(2);
        assert_eq!(made(&mask(), &annotation), Err(StandardError::TooFewLandmarks(2)));
        let twice = Annotation { landmarks: super::tests::annotation().landmarks, ..with_kinds([CornerKind::Pit; 3]) };
        let twice =
            Annotation { triangle: twice.triangle.map(|[a, b, _]| [a.clone(), b, a]), landmarks: twice.landmarks };
        assert_eq!(made(&mask(), &twice), Err(StandardError::UnknownCorner("right".to_owned())));
        assert!(matches!(made(&Surface::default(), &super::tests::annotation()), Err(StandardError::Degenerate(_))));
    }

    #[test]
    fn a_class_and_its_place_are_the_same_for_any_number_of_threads() {
        let make = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                let standard = made(&mask(), &annotation()).expect("a sound annotation");
                let found = standard.find(&mask(), Unit::Unknown, &Progress::silent()).expect("a sound surface");
                serde_json::to_string(&(standard, found)).expect("plain data")
            })
        };
        let text = make(1);
        assert_eq!(text, make(3));
        let (stored, _): (Standard, Option<Found>) = serde_json::from_str(&text).expect("what was written");
        let standard = made(&mask(), &annotation()).expect("a sound annotation");
        assert_eq!(stored.points.len(), standard.points.len());
        assert!(stored.points.iter().zip(&standard.points).all(|(a, b)| (a - b).norm() < 1e-9));
    }
}
