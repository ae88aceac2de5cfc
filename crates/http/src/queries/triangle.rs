//! A bare triangle as it is asked about.

use super::super::problem::{Code, Problem};
use super::views::{ToldTriangle, TriangleView};
use visage_geometry::{Point3, Unit, Vector3};
use visage_service::app::queries::TriangleProbe;
use visage_shape::faces::{FaceStandard, Triangle};

/// Corners nearer to one line than this share of the triangle's size are refused: which way they run is noise.
const LEAST_HEIGHT: f64 = 1e-6;

/// The triangle, if it is one.
pub fn triangle_probe(view: TriangleView) -> Result<TriangleProbe, Problem> {
    let told = match view {
        TriangleView::Corners(corners) => ToldTriangle { corners: Some(corners), ..ToldTriangle::default() },
        TriangleView::Told(told) => told,
    };
    let corners = match (told.corners, told.sides) {
        (Some(corners), None) => corners.map(Point3::from),
        (None, Some(_)) if told.outward.is_some() => {
            return Err(refused("has sides and an outward direction: sides have no frame"));
        }
        (None, Some(sides)) => of_sides(sides).ok_or_else(|| refused("has sides that don't close"))?,
        _ => return Err(refused("must have either corners or sides")),
    };
    let outward = told.outward.map(Vector3::from);
    let middle = corners.iter().map(|p| p.coords / 3.0).sum::<Vector3>();
    let size = Triangle::new(corners).size();
    if !size.is_normal() || !middle.iter().all(|x| x.is_finite()) {
        return Err(refused("has corners in one place, or too far away to compute with"));
    }
    let corners = corners.map(|p| Point3::from((p.coords - middle) / size));
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    if normal.norm() < LEAST_HEIGHT {
        return Err(refused("has its corners in one line"));
    }
    if outward.is_some_and(|outward| !(outward.norm().is_normal() && outward.dot(&normal) != 0.0)) {
        return Err(refused("has an outward direction that lies in its plane"));
    }
    let error_factor = Unit::from(told.unit).in_mm().map_or(1.0, |mm| size * mm / FaceStandard::face_size());
    Ok(TriangleProbe { corners, outward, error_factor })
}

fn refused(why: &str) -> Problem {
    let hint = "send [[x, y, z], [x, y, z], [x, y, z]], or {\"sides\": [a, b, c], \"unit\": \"mm\"}";
    Problem::new(Code::InvalidField, format!("the triangle {why}"), hint)
}

/// A triangle with these sides; `None` if there is none.
fn of_sides(sides: [f64; 3]) -> Option<[Point3; 3]> {
    let [a, b, c] = sides;
    if !sides.iter().all(|side| side.is_normal() && *side > 0.0) || a >= b + c || b >= a + c || c >= a + b {
        return None;
    }
    // relative to the first side, or squares could leave the range of numbers
    let (b, c) = (b / a, c / a);
    let x = (1.0 + c * c - b * b) / 2.0;
    let y = (c * c - x * x).max(0.0).sqrt();
    Some([[0.0, 0.0, 0.0], [a, 0.0, 0.0], [a * x, a * y, 0.0]].map(Point3::from))
}

#[cfg(test)]
mod tests {
    use super::super::super::scan_set_views::UnitView;
    use super::*;

    fn told(triangle: ToldTriangle) -> Result<TriangleProbe, Problem> {
        triangle_probe(TriangleView::Told(triangle))
    }

    #[test]
    fn sides_and_corners_tell_the_same_triangle() {
        let [a, b, c] = of_sides([3.0, 4.0, 5.0]).expect("they close");
        assert!(((b - a).norm() - 3.0).abs() < 1e-12);
        let mut others = [(c - b).norm(), (a - c).norm()];
        others.sort_by(f64::total_cmp);
        assert!((others[0] - 4.0).abs() < 1e-12 && (others[1] - 5.0).abs() < 1e-12);
    }

    #[test]
    fn errors_are_in_millimetres_of_the_triangle_if_its_unit_is_known() {
        let asked = |unit| told(ToldTriangle { sides: Some([3.0, 4.0, 5.0]), unit, ..ToldTriangle::default() });
        assert_eq!(asked(UnitView::Unknown).expect("a triangle").error_factor, 1.0);
        let (mm, cm) = (asked(UnitView::Mm).expect("a triangle"), asked(UnitView::Cm).expect("a triangle"));
        assert_eq!(mm.corners, cm.corners);
        assert!((cm.error_factor / mm.error_factor - 10.0).abs() < 1e-12);
        let size = Triangle::new(of_sides([3.0, 4.0, 5.0]).expect("they close")).size();
        assert!((mm.error_factor - size / FaceStandard::face_size()).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_triangle_is_refused() {
        let corners = |corners| ToldTriangle { corners: Some(corners), ..ToldTriangle::default() };
        let sides = |sides| ToldTriangle { sides: Some(sides), ..ToldTriangle::default() };
        let sound = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!(told(corners(sound)).is_ok());
        for wrong in [
            ToldTriangle::default(),
            ToldTriangle { sides: Some([3.0, 4.0, 5.0]), ..corners(sound) },
            ToldTriangle { outward: Some([0.0, 0.0, 1.0]), ..sides([3.0, 4.0, 5.0]) },
            ToldTriangle { outward: Some([1.0, 1.0, 0.0]), ..corners(sound) },
            corners([[1.0; 3]; 3]),
            corners([[0.0; 3], [1.0; 3], [2.0; 3]]),
            corners([[1e200; 3], [1e300, 0.0, 0.0], [0.0, 1e308, 0.0]]),
            sides([1.0, 2.0, 3.0]),
            sides([1.0, 2.0, -2.0]),
            sides([1e-320, 1e-320, 1e-320]),
        ] {
            assert!(told(wrong.clone()).is_err(), "{wrong:?}");
        }
    }
}
