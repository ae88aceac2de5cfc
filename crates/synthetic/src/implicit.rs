//! Solids as signed fields: negative inside, positive outside, near the surface about the distance to it.
//!
//! Fields are blended with a quadratic smooth minimum: where two differ by less than the width `k`, the result is
//! rounded off, by `k / 4` at most.

use visage_geometry::{Point3, Vector3};

/// The field of an ellipsoid with half-axes `radii` along the coordinate axes.
pub fn ellipsoid(p: &Point3, center: [f64; 3], radii: [f64; 3]) -> f64 {
    let mut scaled = 0.0;
    let mut gradient = 0.0;
    for axis in 0..3 {
        let q = (p[axis] - center[axis]) / radii[axis];
        scaled += q * q;
        gradient += (q / radii[axis]) * (q / radii[axis]);
    }
    let (scaled, gradient) = (scaled.sqrt(), gradient.sqrt());
    // at the centre the gradient vanishes; the distance there is the smallest half-axis
    if gradient < 1e-9 { -radii[0].min(radii[1]).min(radii[2]) } else { scaled * (scaled - 1.0) / gradient }
}

/// The field of a limb: a ball whose centre goes from `a` to `b` while its radius goes from `radius_a` to `radius_b`.
pub fn limb(p: &Point3, a: [f64; 3], b: [f64; 3], radius_a: f64, radius_b: f64) -> f64 {
    let (a, b) = (Point3::from(a), Point3::from(b));
    let along = b - a;
    let t = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (p - a - along * t).norm() - (radius_a + t * (radius_b - radius_a))
}

/// The field of a ring in the plane through `center` spanned by x and y: a tube of radius `tube` bent to `radius`.
pub fn ring(p: &Point3, center: [f64; 3], radius: f64, tube: f64) -> f64 {
    let q = p - Point3::from(center);
    (q.x.hypot(q.y) - radius).hypot(q.z) - tube
}

/// The field of a box around `center` with these half-edges along the coordinate axes.
pub fn cuboid(p: &Point3, center: [f64; 3], halves: [f64; 3]) -> f64 {
    let beyond = Vector3::from_fn(|axis, _| (p[axis] - center[axis]).abs() - halves[axis]);
    beyond.map(|d| d.max(0.0)).norm() + beyond.max().min(0.0)
}

/// The field of a solid of revolution with flat ends: about the segment from `a` to `b` its radius goes from
/// `radius_a` to `radius_b`. With equal radii a cylinder.
pub fn frustum(p: &Point3, a: [f64; 3], b: [f64; 3], radius_a: f64, radius_b: f64) -> f64 {
    let (a, b) = (Point3::from(a), Point3::from(b));
    let length = (b - a).norm();
    let axis = (b - a) / length;
    let along = (p - a).dot(&axis);
    let across = (p - a - axis * along).norm();
    let slope = (radius_b - radius_a) / length;
    let side = (across - radius_a - slope * along.clamp(0.0, length)) / slope.hypot(1.0);
    let end = (along - 0.5 * length).abs() - 0.5 * length;
    side.max(0.0).hypot(end.max(0.0)) + side.max(end).min(0.0)
}

/// The field of the solid below the plane at `height` along the unit vector `normal`.
pub fn below(p: &Point3, normal: &Vector3, height: f64) -> f64 {
    p.coords.dot(normal) - height
}

/// Both solids, the seam between them filled over a width `k`.
pub fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k / 4.0
}

/// The first solid without the second, the edge rounded over a width `k`.
pub fn cut(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, b, k)
}

/// The gradient of a field by central differences over `step`.
pub fn gradient(field: &impl Fn(&Point3) -> f64, p: &Point3, step: f64) -> Vector3 {
    let difference = |axis: usize| {
        let mut offset = Vector3::zeros();
        offset[axis] = step;
        field(&(p + offset)) - field(&(p - offset))
    };
    Vector3::new(difference(0), difference(1), difference(2)) / (2.0 * step)
}

/// The first point of the surface on the way from `start`, outside, along the unit vector `direction`, no farther
/// than `reach`; `None` if there is none.
pub fn first_hit(field: &impl Fn(&Point3) -> f64, start: Point3, direction: &Vector3, reach: f64) -> Option<Point3> {
    const STEP: f64 = 0.5;
    let mut travelled = 0.0;
    while travelled < reach {
        if field(&(start + direction * (travelled + STEP))) < 0.0 {
            let (mut outside, mut inside) = (travelled, travelled + STEP);
            for _ in 0..40 {
                let middle = 0.5 * (outside + inside);
                if field(&(start + direction * middle)) < 0.0 { inside = middle } else { outside = middle }
            }
            return Some(start + direction * outside);
        }
        travelled += STEP;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_vanish_on_the_surface_and_grow_outward() {
        let ball = |p: &Point3| ellipsoid(p, [1.0, 0.0, 0.0], [2.0, 2.0, 2.0]);
        assert!((ball(&Point3::new(4.0, 0.0, 0.0)) - 1.0).abs() < 1e-12);
        assert_eq!(ball(&Point3::new(1.0, 0.0, 0.0)), -2.0);
        assert!(ellipsoid(&Point3::new(0.0, 3.0, 0.0), [0.0; 3], [1.0, 3.0, 5.0]).abs() < 1e-12);
        let limb = |y: f64| limb(&Point3::new(2.0, y, 0.0), [0.0; 3], [0.0, 10.0, 0.0], 1.0, 3.0);
        assert!((limb(0.0) - 1.0).abs() < 1e-12 && limb(5.0).abs() < 1e-12 && (limb(10.0) + 1.0).abs() < 1e-12);
        assert!((ring(&Point3::new(0.0, 7.0, 0.0), [0.0; 3], 5.0, 1.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn boxes_and_frustums_measure_distance() {
        let cuboid = |x: f64, y: f64| cuboid(&Point3::new(x, y, 0.0), [1.0, 0.0, 0.0], [2.0, 3.0, 4.0]);
        assert_eq!((cuboid(5.0, 0.0), cuboid(1.0, 0.0), cuboid(6.0, 7.0)), (2.0, -2.0, 5.0));
        let tube = |x: f64, y: f64| frustum(&Point3::new(x, y, 0.0), [0.0; 3], [0.0, 10.0, 0.0], 2.0, 2.0);
        assert_eq!((tube(5.0, 5.0), tube(0.0, 12.0), tube(0.0, 5.0), tube(5.0, 14.0)), (3.0, 2.0, -2.0, 5.0));
        let cone = |x: f64, y: f64| frustum(&Point3::new(x, y, 0.0), [0.0; 3], [0.0, 4.0, 0.0], 3.0, 0.0);
        assert!(cone(1.5, 2.0).abs() < 1e-12 && cone(0.0, 1.0) < 0.0 && cone(3.0, 3.0) > 0.0);
        assert_eq!(below(&Point3::new(0.0, 3.0, 0.0), &Vector3::y(), 1.0), 2.0);
    }

    #[test]
    fn blending_rounds_by_a_quarter_of_the_width_and_only_near_the_seam() {
        assert_eq!(join(1.0, 1.0, 4.0), 0.0);
        assert_eq!(join(1.0, 9.0, 4.0), 1.0);
        assert_eq!(cut(-5.0, 8.0, 2.0), -5.0);
        assert_eq!(cut(-5.0, -2.0, 1.0), 2.0);
    }

    #[test]
    fn the_first_hit_is_on_the_near_side() {
        let ball = |p: &Point3| ellipsoid(p, [0.0; 3], [2.0, 2.0, 2.0]);
        let hit = first_hit(&ball, Point3::new(0.0, 0.0, 10.0), &-Vector3::z(), 20.0).expect("the ball is hit");
        assert!((hit - Point3::new(0.0, 0.0, 2.0)).norm() < 1e-9);
        assert_eq!(first_hit(&ball, Point3::new(5.0, 0.0, 10.0), &-Vector3::z(), 20.0), None);
    }

    #[test]
    fn the_gradient_of_a_ball_points_outward() {
        let ball = |p: &Point3| ellipsoid(p, [0.0; 3], [2.0, 2.0, 2.0]);
        let normal = gradient(&ball, &Point3::new(0.0, 3.0, 4.0), 1e-3);
        assert!((normal - Vector3::new(0.0, 0.6, 0.8)).norm() < 1e-6);
    }
}
