//! Heads with a face, put together from ellipsoids and limbs. Each seed is another person.
//!
//! The frame is that of the built-in face standard: x to the subject's left, y up, z out of the face, mm, the origin
//! behind the nose between the ears.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::implicit::{cut, ellipsoid, first_hit, join, limb};
use super::{Specimen, surface_nets};
use visage_geometry::{Bounds, Point3, Vector3};

/// Edge of the grid cells from which heads are meshed, mm.
const CELL: f64 = 3.2;

/// How one person's measures differ from the average: factors, 1 = average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proportions {
    /// Size of the whole head.
    pub size: f64,
    /// Distance between the eyes.
    pub eye_distance: f64,
    /// From the root of the nose to its tip.
    pub nose_length: f64,
    /// How far the nose stands out.
    pub nose_depth: f64,
    /// Width of nose wings and nostrils.
    pub nose_width: f64,
    /// Width of the mouth.
    pub mouth_width: f64,
    /// Width of the lower jaw.
    pub jaw_width: f64,
    /// How far the chin stands out.
    pub chin_depth: f64,
}

impl Proportions {
    /// The average adult.
    pub const AVERAGE: Proportions = Proportions {
        size: 1.0,
        eye_distance: 1.0,
        nose_length: 1.0,
        nose_depth: 1.0,
        nose_width: 1.0,
        mouth_width: 1.0,
        jaw_width: 1.0,
        chin_depth: 1.0,
    };

    /// A person by number: every factor is off the average by 4 to 9 %.
    pub fn of(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut factor = || {
            let off: f64 = rng.random_range(0.04..0.09);
            if rng.random() { 1.0 + off } else { 1.0 - off }
        };
        Proportions {
            size: factor(),
            eye_distance: factor(),
            nose_length: factor(),
            nose_depth: factor(),
            nose_width: factor(),
            mouth_width: factor(),
            jaw_width: factor(),
            chin_depth: factor(),
        }
    }
}

/// The head of a person with these proportions, with the landmarks of the face.
pub fn head(proportions: &Proportions) -> Specimen {
    head_with(proportions, 0.0, |head, _| head)
}

/// The same with more on it, such as hair: `more` changes the field at a point of the average-sized head, and may stand
/// `margin` off it.
pub(super) fn head_with(proportions: &Proportions, margin: f64, more: impl Fn(f64, &Point3) -> f64 + Sync) -> Specimen {
    let shape = Shape(*proportions);
    let size = proportions.size;
    let field = |p: &Point3| more(shape.head(&(p / size)), &(p / size)) * size;
    let mut bounds = box_around(size);
    bounds.min -= Vector3::repeat(margin * size);
    bounds.max += Vector3::repeat(margin * size);
    let mesh = surface_nets::mesh(&field, &bounds, CELL);
    let landmarks = shape.landmarks();
    let landmarks = landmarks.into_iter().map(|(name, p)| (name, p * size)).collect();
    Specimen { mesh, landmarks }
}

/// A skull with ears and neck, but three bumps where no face has them in place of the face.
pub fn head_with_bumps() -> Specimen {
    let shape = Shape(Proportions::AVERAGE);
    let bumps = [([-24.0, 78.0, 98.0], 13.0), ([38.0, 6.0, 94.0], 16.0), ([-16.0, -48.0, 104.0], 11.0)];
    let field = |p: &Point3| {
        bumps.iter().fold(shape.skull(p), |skull, (center, radius)| {
            join(skull, limb(p, *center, [0.0, 20.0, 0.0], *radius, *radius), 6.0)
        })
    };
    Specimen { mesh: surface_nets::mesh(&field, &box_around(1.0), CELL), landmarks: BTreeMap::new() }
}

fn box_around(size: f64) -> Bounds {
    let mut bounds = Bounds { min: Point3::new(-104.0, -134.0, -112.0), max: Point3::new(104.0, 152.0, 150.0) };
    bounds.min *= size;
    bounds.max *= size;
    bounds
}

/// A point's mirror image on the subject's left, so that what comes in pairs is made once. Rounded at the middle, so
/// that the two halves meet without a crease.
fn left_half(p: &Point3) -> Point3 {
    Point3::new((p.x * p.x + 0.25).sqrt(), p.y, p.z)
}

/// The solid of a head of average size; all figures are mm of an average adult.
struct Shape(Proportions);

impl Shape {
    fn head(&self, p: &Point3) -> f64 {
        let left = left_half(p);
        let muzzle = ellipsoid(p, [0.0, -27.0, 89.0], [26.0 * self.0.mouth_width, 21.0, 27.0]);
        let mut head = join(self.skull(p), muzzle, 14.0);
        head = self.with_eyes(head, &left);
        head = self.with_nose(head, p, &left);
        self.with_mouth(head, &left)
    }

    /// Cranium, blank face, jaw, chin, cheekbones, neck and ears.
    fn skull(&self, p: &Point3) -> f64 {
        let left = left_half(p);
        let jaw = self.0.jaw_width;
        let chin = 85.0 + 25.0 * (self.0.chin_depth - 1.0);
        let mut skull = ellipsoid(p, [0.0, 62.0, 3.0], [79.0, 83.0, 102.0]);
        skull = join(skull, ellipsoid(p, [0.0, 2.0, 12.0], [67.0, 105.0, 85.0]), 30.0);
        skull = join(skull, ellipsoid(p, [0.0, -34.0, 55.0], [56.0 * jaw, 41.0, 53.0]), 20.0);
        skull = join(skull, limb(p, [0.0, -40.0, -15.0], [0.0, -190.0, -40.0], 56.0, 60.0), 25.0);
        skull = join(skull, ellipsoid(p, [0.0, -65.0, chin], [28.0 * jaw, 18.0, 25.0]), 18.0);
        skull = join(skull, ellipsoid(&left, [33.0, 2.0, 50.0], [36.0, 34.0, 45.0]), 20.0);
        skull = join(skull, ear(&left), 8.0);
        let below_the_neck = p.y + 128.0;
        cut(skull, below_the_neck, 4.0)
    }

    /// Brows over sockets, closed eyes in them, and the deep corners between eyes and nose.
    fn with_eyes(&self, head: f64, left: &Point3) -> f64 {
        let apart = self.0.eye_distance;
        let head = join(head, limb(left, [20.0 * apart, 56.0, 87.0], [38.0 * apart, 51.0, 79.0], 16.0, 17.0), 12.0);
        let head = cut(head, ellipsoid(left, [36.0 * apart, 33.0, 107.0], [29.0, 14.0, 15.0]), 9.0);
        join(head, ellipsoid(left, [33.0 * apart, 35.0, 83.0], [14.0, 13.0, 13.0]), 5.0)
    }

    /// Bridge, wings and septum; then the inner corners of the eyes, which cut into the foot of the bridge.
    fn with_nose(&self, head: f64, p: &Point3, left: &Point3) -> f64 {
        let wide = self.0.nose_width;
        let mut nose = limb(p, [0.0, 32.0, 97.0], self.nose_ball(), 7.0 * wide, NOSE_BALL_RADIUS);
        let [_, tip_y, tip_z] = self.nose_ball();
        nose = join(nose, ellipsoid(left, [11.0 * wide, tip_y - 5.0, tip_z - 12.0], [6.0 * wide, 7.0, 9.0]), 8.0);
        nose = join(nose, ellipsoid(p, [0.0, tip_y - 10.0, tip_z - 9.0], [8.0 * wide, 4.0, 8.0]), 5.0);
        let head = join(head, nose, 12.0);
        cut(head, ellipsoid(left, self.eye_corner(), [5.0, 5.0, 6.0]), 5.0)
    }

    fn with_mouth(&self, head: f64, left: &Point3) -> f64 {
        let wide = self.0.mouth_width;
        let head = join(head, limb(left, [0.0, -31.0, 107.0], [22.0 * wide, -34.5, 98.0], 4.0, 2.0), 8.0);
        let head = join(head, limb(left, [0.0, -41.5, 107.5], [20.0 * wide, -38.5, 98.0], 5.0, 2.5), 8.0);
        cut(head, limb(left, [0.0, -36.0, 114.0], [25.0 * wide, -36.5, 102.5], 1.6, 0.8), 4.0)
    }

    /// The middle of the ball at the tip of the nose.
    fn nose_ball(&self) -> [f64; 3] {
        [0.0, 32.0 - 29.0 * self.0.nose_length, 97.0 + 24.0 * self.0.nose_depth]
    }

    /// The middle of the hollow at the inner corner of the left eye.
    fn eye_corner(&self) -> [f64; 3] {
        [18.0 * self.0.eye_distance, 32.0, 98.0]
    }

    /// Landmarks on the surface of the average-sized head, each found from the front.
    fn landmarks(&self) -> BTreeMap<&'static str, Point3> {
        let field = |p: &Point3| self.head(p);
        let (apart, wide) = (self.0.eye_distance, self.0.mouth_width);
        let [_, tip_y, _] = self.nose_ball();
        let places = [
            ("eye_r_inner", -18.0 * apart, 32.0),
            ("eye_l_inner", 18.0 * apart, 32.0),
            ("eye_r_outer", -45.0 * apart, 34.0),
            ("eye_l_outer", 45.0 * apart, 34.0),
            ("nose_tip", 0.0, tip_y),
            ("mouth_r", -25.0 * wide, -36.0),
            ("mouth_l", 25.0 * wide, -36.0),
            ("chin", 0.0, -68.0),
            ("sellion", 0.0, 37.0),
        ];
        let on_surface = |(name, x, y)| {
            first_hit(&field, Point3::new(x, y, 160.0), &-Vector3::z(), 160.0).map(|point| (name, point))
        };
        places.into_iter().filter_map(on_surface).collect()
    }
}

/// Radius of the ball at the tip of the nose, mm.
const NOSE_BALL_RADIUS: f64 = 9.5;

/// The left ear: a leaning shell with a hollow.
fn ear(left: &Point3) -> f64 {
    let (sine, cosine) = 15f64.to_radians().sin_cos();
    let q = left - Point3::new(78.0, 14.0, 0.0);
    let p = Point3::new(cosine * q.x - sine * q.z, q.y + 0.15 * q.z, sine * q.x + cosine * q.z);
    cut(ellipsoid(&p, [4.0, 0.0, 0.0], [10.0, 31.0, 17.0]), ellipsoid(&p, [14.0, 2.0, 3.0], [9.0, 18.0, 9.0]), 5.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_differ_from_the_average_and_from_each_other() {
        let (one, two) = (Proportions::of(1), Proportions::of(2));
        assert_ne!(one, two);
        assert_eq!(one, Proportions::of(1));
        for factor in [one.eye_distance, one.nose_length, one.nose_depth, two.size, two.jaw_width] {
            assert!((0.04..=0.09).contains(&(factor - 1.0f64).abs()), "{factor}");
        }
    }

    #[test]
    fn a_head_has_the_size_of_a_head_and_a_face_in_front() {
        let person = head(&Proportions::of(7));
        let mesh = &person.mesh;
        assert!((20_000..60_000).contains(&mesh.faces.len()), "{} triangles", mesh.faces.len());
        let litres = mesh.signed_volume_6() / 6.0 * 1e-6;
        assert!((3.0..7.0).contains(&litres), "{litres} l");
        let foremost = mesh.vertices.iter().copied().fold(Point3::origin(), |a, b| if b.z > a.z { b } else { a });
        let tip = person.landmarks["nose_tip"];
        assert!((foremost - tip).norm() < 5.0, "the nose tip {tip} is foremost, {foremost} was found");
        let (right, left) = (person.landmarks["eye_r_inner"], person.landmarks["eye_l_inner"]);
        assert!(right.x < -10.0 && left.x > 10.0 && (right.y - left.y).abs() < 1e-9);
        assert_eq!(person.landmarks.len(), 9);
    }

    #[test]
    fn landmarks_lie_on_the_mesh() {
        let person = head(&Proportions::AVERAGE);
        for (name, landmark) in &person.landmarks {
            let distances = person.mesh.vertices.iter().map(|v| (v - landmark).norm());
            let nearest = distances.fold(f64::INFINITY, f64::min);
            assert!(nearest < CELL, "{name} is {nearest} mm from the next vertex");
        }
    }

    /// Mean curvature of the field, 1/mm, positive where the surface bulges outward: the divergence of its unit normal.
    fn bulge(field: &impl Fn(&Point3) -> f64, p: &Point3, step: f64) -> f64 {
        let normal = |axis: usize, sign: f64| {
            let mut q = *p;
            q[axis] += sign * step;
            super::super::implicit::gradient(field, &q, 0.5).normalize()[axis]
        };
        (0..3).map(|axis| (normal(axis, 1.0) - normal(axis, -1.0)) / (2.0 * step)).sum::<f64>() / 2.0
    }

    #[test]
    fn inner_eye_corners_are_hollows_and_the_nose_tip_is_a_bulge() {
        let shape = Shape(Proportions::of(3));
        let field = |p: &Point3| shape.head(p);
        let landmarks = shape.landmarks();
        for name in ["eye_r_inner", "eye_l_inner"] {
            let bulge = bulge(&field, &landmarks[name], 2.0);
            assert!(bulge < -0.05, "{name}: {bulge}");
        }
        let bulge = bulge(&field, &landmarks["nose_tip"], 2.0);
        assert!(bulge > 0.05, "nose tip: {bulge}");
    }
}
