//! The squared distance from a bundle of planes, as a quadric (Garland & Heckbert 1997), with room for what is not known of
//! the planes (Trettner & Kobbelt 2020).

use visage_geometry::Vector3;

/// `x' A x - 2 b' x + c`, and the area that it stands for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quadric {
    /// xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: Vector3,
    c: f64,
    weight: f64,
}

impl Quadric {
    /// The squared distance from the plane through `place` with this unit normal, `weight` times.
    pub(super) fn plane(normal: &Vector3, place: &Vector3, weight: f64) -> Quadric {
        let (n, d) = (normal * weight, normal.dot(place));
        Quadric {
            a: [n.x * normal.x, n.x * normal.y, n.x * normal.z, n.y * normal.y, n.y * normal.z, n.z * normal.z],
            b: n * d,
            c: weight * d * d,
            weight,
        }
    }

    /// The squared distance from a place, `weight` times; it stands for no area.
    pub(super) fn place(place: &Vector3, weight: f64) -> Quadric {
        let a = [weight, 0.0, 0.0, weight, 0.0, weight];
        Quadric { a, b: place * weight, c: weight * place.norm_squared(), weight: 0.0 }
    }

    /// The same without an area that it stands for.
    pub(super) fn weightless(self) -> Quadric {
        Quadric { weight: 0.0, ..self }
    }

    #[inline]
    pub(super) fn plus(&self, other: &Quadric) -> Quadric {
        let mut a = self.a;
        a.iter_mut().zip(other.a).for_each(|(a, other)| *a += other);
        Quadric { a, b: self.b + other.b, c: self.c + other.c, weight: self.weight + other.weight }
    }

    /// Its value at a place; rounding makes it no less than 0.
    #[inline]
    pub(super) fn at(&self, x: &Vector3) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let square = xx * x.x * x.x + yy * x.y * x.y + zz * x.z * x.z;
        let mixed = xy * x.x * x.y + xz * x.x * x.z + yz * x.y * x.z;
        (square + 2.0 * mixed - 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// A value of it as the mean square distance over the area that it stands for.
    #[inline]
    pub(super) fn mean(&self, value: f64) -> f64 {
        value / self.weight.max(f64::MIN_POSITIVE)
    }

    /// Where it is least; `None` if that is not one place.
    #[inline]
    pub(super) fn least(&self) -> Option<Vector3> {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let (c0, c1, c2) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let determinant = xx * c0 + xy * c1 + xz * c2;
        let size = (xx + yy + zz) / 3.0;
        // false for what is not a number, too
        let is_one_place = determinant > SINGULAR * size * size * size;
        if !is_one_place {
            return None;
        }
        let (c3, c4, c5) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        let b = &self.b;
        let x = Vector3::new(
            c0 * b.x + c1 * b.y + c2 * b.z,
            c1 * b.x + c3 * b.y + c4 * b.z,
            c2 * b.x + c4 * b.y + c5 * b.z,
        );
        Some(x / determinant)
    }
}

/// A matrix whose determinant is less than this times the cube of its mean eigenvalue is not inverted.
const SINGULAR: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_where_the_quadric_is_least() {
        let meet = Vector3::new(1.0, -2.0, 3.0);
        let normals = [Vector3::x(), Vector3::new(1.0, 1.0, 0.0).normalize(), Vector3::new(0.0, 1.0, 2.0).normalize()];
        let planes = normals.iter().map(|normal| Quadric::plane(normal, &meet, 2.0));
        let all = planes.fold(Quadric::default(), |all, plane| all.plus(&plane));
        assert!((all.least().expect("one place") - meet).norm() < 1e-9);
        let beside = meet + Vector3::x();
        let expected: f64 = normals.iter().map(|normal| 2.0 * normal.x.powi(2)).sum();
        assert!((all.at(&beside) - expected).abs() < 1e-9);
        assert!((all.mean(all.at(&beside)) - expected / 6.0).abs() < 1e-9);
    }

    #[test]
    fn one_plane_has_no_least_place_until_one_is_given() {
        let plane = Quadric::plane(&Vector3::z(), &Vector3::zeros(), 1.0);
        assert_eq!(plane.least(), None);
        let held = plane.plus(&Quadric::place(&Vector3::new(3.0, 4.0, 0.0), 1e-4));
        assert!((held.least().expect("one place") - Vector3::new(3.0, 4.0, 0.0)).norm() < 1e-6);
        assert_eq!(Quadric::default().least(), None);
    }
}
