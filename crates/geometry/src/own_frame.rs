//! A surface's own frame: what is done there does not depend on how the file is turned.

use nalgebra::Matrix3;

use super::{Motion, Surface, Vector3};

/// The motion from the file's frame to the surface's own: the centroid at the origin, the principal axes as axes, longest
/// first, the first two towards their larger third moments, right-handed.
///
/// Moments of a mesh are those of its area, exact for every triangle, so that subdivision does not change them; those of a
/// cloud are its points'. Where two variances agree, as a ball's do, rounding has its say. The identity for a surface
/// without extent, or one so large that its moments are no finite numbers.
pub fn motion_own_file(surface: &Surface) -> Motion {
    let origin = Vector3::zeros();
    let total: f64 = pieces(surface, origin).map(|piece| piece.weight).sum();
    let center = pieces(surface, origin).map(|piece| piece.first_moment()).sum::<Vector3>() / total;
    let scatter: Matrix3<f64> = pieces(surface, center).map(|piece| piece.second_moment()).sum();
    if !center.iter().chain(&scatter).all(|x| x.is_finite()) {
        return Motion::identity();
    }
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let [x, y] = [order[0], order[1]].map(|axis| {
        let direction = eigen.eigenvectors.column(axis).into_owned();
        let skew: f64 = pieces(surface, center).map(|piece| piece.third_moment(&direction)).sum();
        if skew < 0.0 { -direction } else { direction }
    });
    let axes = Matrix3::from_rows(&[x.transpose(), y.transpose(), x.cross(&y).transpose()]);
    let rotation = super::se3::nearest_rotation(&axes);
    Motion::from_parts((-(rotation * center)).into(), rotation)
}

/// A triangle with its area; a point is one whose corners coincide.
struct Piece {
    corners: [Vector3; 3],
    weight: f64,
}

/// What a surface is made of, about `center`. Made anew for each sum: stored, they would outweigh the surface.
fn pieces(surface: &Surface, center: Vector3) -> impl Iterator<Item = Piece> + '_ {
    let at = move |index: usize| surface.cloud.points[index].coords - center;
    let count = if surface.faces.is_empty() { surface.cloud.len() } else { surface.faces.len() };
    (0..count).map(move |index| match surface.faces.get(index) {
        None => Piece { corners: [at(index); 3], weight: 1.0 },
        Some(face) => {
            let [a, b, c] = face.map(|vertex| at(vertex as usize));
            Piece { corners: [a, b, c], weight: 0.5 * (b - a).cross(&(c - a)).norm() }
        }
    })
}

impl Piece {
    /// Of the positions: the integral of `p`.
    fn first_moment(&self) -> Vector3 {
        self.corners.iter().sum::<Vector3>() * (self.weight / 3.0)
    }

    /// Of the positions: the integral of `p pᵀ`.
    fn second_moment(&self) -> Matrix3<f64> {
        let sum: Vector3 = self.corners.iter().sum();
        let squares: Matrix3<f64> = self.corners.iter().map(|p| p * p.transpose()).sum();
        (squares + sum * sum.transpose()) * (self.weight / 12.0)
    }

    /// The integral of the third power of the coordinate along a direction.
    fn third_moment(&self, direction: &Vector3) -> f64 {
        let [a, b, c] = self.corners.map(|corner| corner.dot(direction));
        // all monomials of degree three, each with the same weight
        let monomials = a * a * (a + b + c) + b * b * (a + b + c) + c * c * (a + b + c) + a * b * c;
        0.1 * self.weight * monomials
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cloud, Point3};

    /// An irregular tetrahedron, far from the origin.
    fn tetrahedron() -> Surface {
        let corners = [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [1.0, 3.0, 0.0], [0.5, 0.7, 2.0]];
        let points = corners.map(|p| Point3::from(p) + Vector3::new(700.0, -300.0, 50.0)).to_vec();
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
    }

    fn points_in_own_frame(surface: &Surface) -> Vec<Point3> {
        surface.moved(&motion_own_file(surface)).cloud.points
    }

    fn agree(some: &[Point3], others: &[Point3]) -> bool {
        some.iter().zip(others).all(|(p, q)| (p - q).norm() < 1e-9)
    }

    #[test]
    fn no_turn_changes_a_surface_in_its_own_frame() {
        let motion = Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.4, -2.0, 0.9));
        let cloud = Surface { faces: Vec::new(), ..tetrahedron() };
        for surface in [tetrahedron(), cloud] {
            assert!(agree(&points_in_own_frame(&surface), &points_in_own_frame(&surface.moved(&motion))));
        }
    }

    #[test]
    fn moments_of_area_do_not_hang_on_how_it_is_cut() {
        let whole = tetrahedron();
        let mut cut = whole.clone();
        let [a, b, c] = cut.faces[3].map(|v| cut.cloud.points[v as usize].coords);
        cut.cloud.points.push(Point3::from(0.5 * a + 0.2 * b + 0.3 * c));
        let [a, b, c] = cut.faces[3];
        cut.faces.splice(3..4, [[a, b, 4], [b, c, 4], [c, a, 4]]);
        assert!(agree(&points_in_own_frame(&whole), &points_in_own_frame(&cut)));
    }

    #[test]
    fn axes_are_sorted_by_variance_and_centred() {
        let points = points_in_own_frame(&Surface { faces: Vec::new(), ..tetrahedron() });
        let mean = points.iter().map(|p| p.coords).sum::<Vector3>() / 4.0;
        let variances: Vec<f64> = (0..3).map(|axis| points.iter().map(|p| p[axis] * p[axis]).sum()).collect();
        assert!(mean.norm() < 1e-9, "{mean}");
        assert!(variances[0] > variances[1] && variances[1] > variances[2], "{variances:?}");
        assert!(points.iter().map(|p| p.x.powi(3)).sum::<f64>() > 0.0);
    }

    #[test]
    fn what_has_no_extent_stays() {
        assert_eq!(motion_own_file(&Surface::default()), Motion::identity());
        let line = Surface { faces: vec![[0, 0, 1]], ..tetrahedron() };
        assert_eq!(motion_own_file(&line), Motion::identity());
    }

    #[test]
    fn what_is_too_large_for_its_moments_stays() {
        let mut huge = tetrahedron();
        huge.cloud.points.iter_mut().for_each(|p| *p *= 1e160);
        let cloud = Surface { faces: Vec::new(), ..huge.clone() };
        for surface in [huge, cloud] {
            assert_eq!(motion_own_file(&surface), Motion::identity());
        }
    }
}
