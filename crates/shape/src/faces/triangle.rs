//! Triangles in Kendall's shape space: what is left of three corners when place, turn and size don't matter.
//!
//! The space is a sphere of radius 1/2 on which the least-squares matching error is a chord, so a kd-tree over
//! [`Shape`] is an exact index.

use visage_geometry::{Point3, Vector3};

/// Three labelled corners and the outward normal of the surface they lie on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// The corners a, b, c; on a face: the subject's right inner eye corner, the left one, the nose tip.
    pub corners: [Point3; 3],
}

/// A labelled triangle's place on the sphere of radius 1/2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape(pub Vector3);

impl Triangle {
    /// The triangle with these corners.
    pub fn new(corners: [Point3; 3]) -> Self {
        Triangle { corners }
    }

    /// The Helmert coordinates `u = (b - a) / sqrt 2` and `v = (2 c - a - b) / sqrt 6`.
    fn helmert(&self) -> (Vector3, Vector3) {
        let [a, b, c] = self.corners.map(|p| p.coords);
        ((b - a) / 2f64.sqrt(), (2.0 * c - a - b) / 6f64.sqrt())
    }

    /// The size S: root of the summed squared distances of the corners from their centre.
    pub fn size(&self) -> f64 {
        let (u, v) = self.helmert();
        (u.norm_squared() + v.norm_squared()).sqrt()
    }

    /// The point `h = (|u|^2 - |v|^2, 2 u.v, 2 n.(u x v)) / (2 S^2)`. Of the normal only the side counts:
    /// it says from where the triangle is seen. Three equal corners give the origin.
    pub fn shape(&self, outward: &Vector3) -> Shape {
        let (u, v) = self.helmert();
        let size2 = u.norm_squared() + v.norm_squared();
        if size2 <= 0.0 {
            return Shape(Vector3::zeros());
        }
        let area = u.cross(&v);
        let turn = if area.dot(outward) < 0.0 { -area.norm() } else { area.norm() };
        let h = Vector3::new(u.norm_squared() - v.norm_squared(), 2.0 * u.dot(&v), 2.0 * turn);
        Shape(h / (2.0 * size2))
    }

    /// The mean of the corners.
    pub fn center(&self) -> Point3 {
        let [a, b, c] = self.corners.map(|p| p.coords);
        Point3::from((a + b + c) / 3.0)
    }

    /// The unit normal on the side of `outward`; for corners in a line, the direction across it nearest to `outward`.
    pub fn normal(&self, outward: &Vector3) -> Vector3 {
        let [a, b, c] = self.corners;
        let area = (b - a).cross(&(c - a));
        let side = if area.dot(outward) < 0.0 { -1.0 } else { 1.0 };
        area.try_normalize(f64::MIN_POSITIVE).map_or_else(|| self.across(outward), |normal| normal * side)
    }

    /// A unit vector across the line of three corners that span no plane.
    fn across(&self, outward: &Vector3) -> Vector3 {
        let [a, b, c] = self.corners;
        let longest =
            [b - a, c - b, a - c].into_iter().fold(Vector3::zeros(), |l, e| if e.norm() > l.norm() { e } else { l });
        let line = longest.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::x);
        let rest = outward - line * outward.dot(&line);
        rest.try_normalize(1e-12).unwrap_or_else(|| crate::saliency::quadric::tangents(&line)[0])
    }

    /// The corners as complex numbers in the triangle's plane seen from `normal`, about their centre.
    ///
    /// `x_axis` is any direction that is not along the normal; it only fixes the angle they are counted from.
    pub(super) fn in_plane(&self, normal: &Vector3) -> [nalgebra::Complex<f64>; 3] {
        let [x_axis, y_axis] = crate::saliency::quadric::tangents(normal);
        let center = self.center();
        self.corners.map(|p| nalgebra::Complex::new((p - center).dot(&x_axis), (p - center).dot(&y_axis)))
    }

    /// The rotation that lays this triangle onto `standard` in the least-squares sense: planes and outward
    /// sides together, then the in-plane angle.
    pub fn rotation_onto(
        &self,
        outward: &Vector3,
        standard: &Triangle,
        standard_outward: &Vector3,
    ) -> nalgebra::Matrix3<f64> {
        let (from, to) = (self.normal(outward), standard.normal(standard_outward));
        let (p, q) = (self.in_plane(&from), standard.in_plane(&to));
        let correlation: nalgebra::Complex<f64> = p.iter().zip(&q).map(|(p, q)| p.conj() * q).sum();
        let (sine, cosine) = correlation.arg().sin_cos();
        let turn = nalgebra::Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
        frame(&to).transpose() * turn * frame(&from)
    }
}

/// Rows: the two tangents of `normal` and the normal itself.
fn frame(normal: &Vector3) -> nalgebra::Matrix3<f64> {
    let [x, y] = crate::saliency::quadric::tangents(normal);
    nalgebra::Matrix3::from_rows(&[x.transpose(), y.transpose(), normal.transpose()])
}

impl Shape {
    /// The shape of the same triangle with corners (b, c, a): a turn of 120 degrees about z.
    pub fn relabelled(&self) -> Shape {
        let (sine, cosine) = (0.75f64.sqrt(), -0.5);
        let h = self.0;
        Shape(Vector3::new(cosine * h.x - sine * h.y, sine * h.x + cosine * h.y, h.z))
    }

    /// The shape with the first two corners swapped: half a turn about x.
    pub fn swapped(&self) -> Shape {
        Shape(Vector3::new(self.0.x, -self.0.y, -self.0.z))
    }

    /// The shape seen from the other side: the other half of the sphere.
    pub fn mirrored(&self) -> Shape {
        Shape(Vector3::new(self.0.x, self.0.y, -self.0.z))
    }

    /// The chord between two shapes, in [0, 1].
    pub fn chord(&self, other: &Shape) -> f64 {
        (self.0 - other.0).norm()
    }

    /// The least-squares matching error E_FT against a standard of size `standard_size`: the root of the
    /// summed squared corner distances after the best translation, turn and scale. In the standard's unit.
    pub fn matching_error(&self, standard: &Shape, standard_size: f64) -> f64 {
        standard_size * self.chord(standard)
    }

    /// As an array, for the index.
    pub fn coordinates(&self) -> [f64; 3] {
        self.0.into()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub fn triangle(values: [f64; 9]) -> Triangle {
        Triangle::new([0, 3, 6].map(|k| Point3::new(values[k], values[k + 1], values[k + 2])))
    }

    /// The residual of the best translation, in-plane turn and scale, found by linear least squares on the
    /// four unknowns of `x' = p x - q y + s, y' = q x + p y + t`.
    fn brute_force_error(test: &Triangle, outward: &Vector3, standard: &Triangle, standard_outward: &Vector3) -> f64 {
        let p = test.in_plane(&test.normal(outward));
        let q = standard.in_plane(&standard.normal(standard_outward));
        let mut matrix = nalgebra::SMatrix::<f64, 6, 4>::zeros();
        let mut right = nalgebra::SVector::<f64, 6>::zeros();
        for k in 0..3 {
            matrix.set_row(2 * k, &nalgebra::RowVector4::new(p[k].re, -p[k].im, 1.0, 0.0));
            matrix.set_row(2 * k + 1, &nalgebra::RowVector4::new(p[k].im, p[k].re, 0.0, 1.0));
            right[2 * k] = q[k].re;
            right[2 * k + 1] = q[k].im;
        }
        let normal_matrix = matrix.transpose() * matrix;
        let solution = normal_matrix.cholesky().expect("a triangle with a size").solve(&(matrix.transpose() * right));
        (matrix * solution - right).norm()
    }

    fn corners() -> impl Strategy<Value = [f64; 9]> {
        prop::array::uniform9(-1.0..1.0f64)
    }

    proptest! {
        #[test]
        fn the_chord_is_the_least_squares_error(a in corners(), b in corners(), outward in prop::array::uniform3(-1.0..1.0f64)) {
            let (test, standard) = (triangle(a), triangle(b));
            let (outward, up) = (Vector3::from(outward), Vector3::z());
            prop_assume!(test.size() > 0.3 && standard.size() > 0.3);
            prop_assume!(test.shape(&outward).0.z.abs() > 1e-6 && standard.shape(&up).0.z.abs() > 1e-6);
            let error = test.shape(&outward).matching_error(&standard.shape(&up), standard.size());
            let brute = brute_force_error(&test, &outward, &standard, &up);
            // the square root loses digits near 0: compare squares
            prop_assert!((error * error - brute * brute).abs() < 1e-12, "{error} {brute}");
        }

        #[test]
        fn shapes_lie_on_the_sphere_and_follow_relabelling(a in corners(), outward in prop::array::uniform3(-1.0..1.0f64)) {
            let test = triangle(a);
            let outward = Vector3::from(outward);
            let shape = test.shape(&outward);
            prop_assert!((shape.0.norm() - 0.5).abs() < 1e-12);
            let [p, q, r] = test.corners;
            prop_assert!((Triangle::new([q, r, p]).shape(&outward).chord(&shape.relabelled())) < 1e-12);
            let swapped = Triangle::new([q, p, r]).shape(&outward);
            prop_assert!(swapped.chord(&shape.swapped()) < 1e-12);
            prop_assert!(test.shape(&-outward).chord(&shape.mirrored()) < 1e-12);
        }

        #[test]
        fn moving_turning_and_scaling_change_nothing(a in corners(), w in prop::array::uniform3(-3.0..3.0f64), scale in 0.1..10.0f64) {
            let test = triangle(a);
            let motion = visage_geometry::Motion::new(Vector3::new(5.0, -2.0, 1.0), Vector3::from(w));
            let moved = Triangle::new(test.corners.map(|p| Point3::from((motion * p).coords * scale)));
            let outward = Vector3::new(0.2, 0.3, 0.9);
            prop_assert!(moved.shape(&(motion * outward)).chord(&test.shape(&outward)) < 1e-9);
        }

        #[test]
        fn the_rotation_lays_a_turned_triangle_back(a in corners(), w in prop::array::uniform3(-1.5..1.5f64)) {
            let standard = triangle(a);
            prop_assume!(standard.corners[0] != standard.corners[1] && standard.shape(&Vector3::z()).0.z.abs() > 0.01);
            let turn = nalgebra::Rotation3::new(Vector3::from(w));
            let test = Triangle::new(standard.corners.map(|p| turn * p));
            let back = test.rotation_onto(&(turn * Vector3::z()), &standard, &Vector3::z());
            prop_assert!((back - turn.inverse().matrix()).norm() < 1e-9);
        }
    }

    #[test]
    fn the_built_in_triangle_has_the_published_shape() {
        let [r, l, n] = [[-18.4, 32.5, 92.0], [18.4, 32.5, 92.0], [0.0, 4.1, 130.7]].map(Point3::from);
        let standard = Triangle::new([r, l, n]);
        let shape = standard.shape(&Vector3::new(0.0, 1.0, 1.0));
        assert!((standard.size() - 47.05).abs() < 0.01);
        assert!((shape.0 - Vector3::new(-0.194, 0.0, -0.461)).norm() < 1e-3, "{shape:?}");
    }
}
