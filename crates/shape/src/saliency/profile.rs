//! The shape of a surface as a whole, in a few numbers that no turn, shift, scale or change of its mesh alters: how
//! pairs of its points lie to each other.
//!
//! After the surflet pairs of Wahl, Hillenbrand and Hirzinger 2003 and the shape distributions of Osada et al. 2002: pairs are
//! drawn by area and counted by their distance, by whether their surfaces look away from each other or towards each
//! other along it, and by how far their normals agree. Two profiles are compared by Hellinger's distance.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::CurvedSurface;
use visage_geometry::Vector3;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Pairs drawn. Drawing again changes a profile by some 0.0007.
        pairs: usize = 40_000,
        /// The distance at which the likeness has fallen to 1/e.
        spread: f64 = 0.02,
        /// The root of a share in this many steps.
        steps: f64 = 255.0,
    }
}

/// Classes of distance, up to this many root mean square radii; a pair counts in the two nearest.
const DISTANCES: usize = 12;
const FARTHEST: f64 = 3.0;
/// Classes of looking: towards each other, along each other, away from each other; limits of the mean cosine.
const LOOKS: usize = 3;
const LOOK: f64 = 0.25;
/// Classes of normals: opposite, across, the same; limits of the cosine.
const NORMALS: usize = 3;
const AGREEMENT: f64 = 0.4;
const CLASSES: usize = DISTANCES * LOOKS * NORMALS;

/// The profile of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShapeProfile {
    /// The square roots of the shares of pairs by class.
    roots: [u8; CLASSES],
    /// Whether it is known which side is outside.
    is_sided: bool,
}

impl Default for ShapeProfile {
    /// That of no surface: like nothing.
    fn default() -> Self {
        ShapeProfile { roots: [0; CLASSES], is_sided: false }
    }
}

impl ShapeProfile {
    /// The length of [`ShapeProfile::to_bytes`].
    pub const BYTES: usize = CLASSES + 1;

    /// The profile of a surface with this root mean square radius about its centroid; `is_sided` tells whether its
    /// normals are known to point outward.
    pub fn of(surface: &CurvedSurface, radius: f64, is_sided: bool) -> ShapeProfile {
        let mut total = 0.0;
        let areas: Vec<f64> = surface
            .areas
            .iter()
            .map(|area| {
                total += area;
                total
            })
            .collect();
        let mut counts = [0.0; CLASSES];
        if !(total.is_normal() && radius.is_normal()) {
            return ShapeProfile::default();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut draw = || {
            let place = rng.random_range(0.0..total);
            areas.partition_point(|area| *area <= place).min(areas.len() - 1)
        };
        for _ in 0..TUNING.pairs {
            count(surface, draw(), draw(), radius, &mut counts);
        }
        let sum: f64 = counts.iter().sum();
        let root = |count: f64| ((count / sum.max(f64::MIN_POSITIVE)).sqrt() * TUNING.steps).round() as u8;
        ShapeProfile { roots: counts.map(root), is_sided }
    }

    /// How alike two shapes are, in (0, 1]: 1 for the same. `None` if one has no profile.
    pub fn likeness(&self, other: &ShapeProfile) -> Option<f64> {
        let distance = self.distance(other)?;
        if self.is_sided && other.is_sided {
            return Some((-distance / TUNING.spread).exp());
        }
        // seen from its other side, the surface looks the other way everywhere
        let distance = self.inside_out().distance(other)?.min(distance);
        Some((-distance / TUNING.spread).exp())
    }

    /// Hellinger's distance, squared: 0 for the same shares, 1 for nothing in common.
    fn distance(&self, other: &ShapeProfile) -> Option<f64> {
        let product = |a: &[u8; CLASSES], b: &[u8; CLASSES]| {
            f64::from(a.iter().zip(b).map(|(a, b)| u32::from(*a) * u32::from(*b)).sum::<u32>())
        };
        // rounding to steps changes the lengths a little
        let lengths = (product(&self.roots, &self.roots) * product(&other.roots, &other.roots)).sqrt();
        (lengths > 0.0).then(|| (1.0 - product(&self.roots, &other.roots) / lengths).max(0.0))
    }

    fn inside_out(&self) -> ShapeProfile {
        let mut turned = *self;
        for distance in 0..DISTANCES {
            for normals in 0..NORMALS {
                for look in 0..LOOKS {
                    turned.roots[class(distance, LOOKS - 1 - look, normals)] =
                        self.roots[class(distance, look, normals)];
                }
            }
        }
        turned
    }

    /// Its bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..CLASSES].copy_from_slice(&self.roots);
        bytes[CLASSES] = u8::from(self.is_sided);
        bytes
    }

    /// The inverse of [`ShapeProfile::to_bytes`].
    pub fn from_bytes(bytes: &[u8; Self::BYTES]) -> ShapeProfile {
        let mut roots = [0; CLASSES];
        roots.copy_from_slice(&bytes[..CLASSES]);
        ShapeProfile { roots, is_sided: bytes[CLASSES] != 0 }
    }
}

fn class(distance: usize, look: usize, normals: usize) -> usize {
    (distance * LOOKS + look) * NORMALS + normals
}

/// 0, 1 or 2: below, within or above the limits.
fn third(value: f64, limit: f64) -> usize {
    usize::from(value >= -limit) + usize::from(value >= limit)
}

fn count(surface: &CurvedSurface, a: usize, b: usize, radius: f64, counts: &mut [f64; CLASSES]) {
    let offset: Vector3 = surface.points[b] - surface.points[a];
    let Some(direction) = offset.try_normalize(0.0) else { return };
    let (normal_a, normal_b) = (&surface.normals[a], &surface.normals[b]);
    let look = third(0.5 * (normal_b.dot(&direction) - normal_a.dot(&direction)), LOOK);
    let normals = third(normal_a.dot(normal_b), AGREEMENT);
    let place = offset.norm() / radius / FARTHEST * DISTANCES as f64 - 0.5;
    let place = place.clamp(0.0, (DISTANCES - 1) as f64);
    let (below, share) = (place.floor() as usize, place.fract());
    counts[class(below, look, normals)] += 1.0 - share;
    counts[class((below + 1).min(DISTANCES - 1), look, normals)] += share;
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;
    use visage_geometry::Point3;

    /// A ball stretched along x.
    fn egg(stretch: f64) -> ShapeProfile {
        let mut mesh = sphere(50.0, 4);
        for vertex in &mut mesh.vertices {
            *vertex = Point3::new(vertex.x * stretch, vertex.y, vertex.z);
        }
        let surface = CurvedSurface::from_mesh(&mesh, 1.0);
        ShapeProfile::of(&surface, 50.0 * ((stretch * stretch + 2.0) / 3.0).sqrt(), true)
    }

    #[test]
    fn likeness_falls_with_the_difference() {
        let likeness = |stretch| egg(1.5).likeness(&egg(stretch)).expect("both have one");
        assert_eq!(likeness(1.5), 1.0);
        assert!(likeness(1.55) > 0.8, "{}", likeness(1.55));
        assert!(likeness(2.0) < likeness(1.7) && likeness(1.7) < likeness(1.55));
        assert!(likeness(3.0) < 0.1, "{}", likeness(3.0));
    }

    #[test]
    fn what_is_turned_inside_out_is_another_shape_unless_nobody_knows_the_sides() {
        let outside = egg(1.5);
        let inside = outside.inside_out();
        assert_eq!(inside.inside_out(), outside);
        assert!(outside.likeness(&inside).is_some_and(|likeness| likeness < 0.01));
        let unsure = ShapeProfile { is_sided: false, ..inside };
        assert_eq!(outside.likeness(&unsure), Some(1.0));
    }

    #[test]
    fn bytes_round_trip_and_nothing_is_like_nothing() {
        let profile = egg(1.2);
        assert_eq!(ShapeProfile::from_bytes(&profile.to_bytes()), profile);
        assert_eq!(profile.likeness(&ShapeProfile::default()), None);
        assert_eq!(ShapeProfile::of(&CurvedSurface::default(), 1.0, true), ShapeProfile::default());
    }
}
