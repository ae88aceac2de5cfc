//! Where the scanner stood: given by the file or the caller, else read off the scan itself.
//!
//! Rays leave a scanner evenly spread, so how densely points lie on a surface says how it was turned to the scanner.

pub mod depth_image;
pub mod looked_through;
pub mod standing_still;
pub mod turning;
pub mod viewpoint;

use visage_geometry::neighbours::LocalPoint;
use visage_geometry::{Motion, Vector3};

/// The side from which a view's surface was seen, in the view's local frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sensor {
    /// The scanner stood here.
    At(Vector3),
    /// The scanner stood far off in this direction (unit vector).
    Toward(Vector3),
}

impl Sensor {
    /// Where the scanner stood, if that is known.
    pub fn position(&self) -> Option<Vector3> {
        match self {
            Sensor::At(position) => Some(*position),
            Sensor::Toward(_) => None,
        }
    }

    /// The direction (not normalised) from a point of the view to the scanner.
    pub fn direction_from(&self, point: &LocalPoint) -> Vector3 {
        match self {
            Sensor::At(position) => position - nalgebra::Vector3::from(*point).cast::<f64>(),
            Sensor::Toward(direction) => *direction,
        }
    }

    /// Whether it looks all the way round, as no lens does: many of its rays go far off from where it looks as a whole.
    pub fn is_round(&self, points: &[LocalPoint]) -> bool {
        let Sensor::At(position) = self else { return false };
        let step = points.len().div_ceil(TUNING.round_samples).max(1);
        let rays: Vec<Vector3> = points
            .iter()
            .step_by(step)
            .filter_map(|p| (nalgebra::Vector3::from(*p).cast::<f64>() - position).try_normalize(f64::MIN_POSITIVE))
            .collect();
        let ahead = rays.iter().sum::<Vector3>().try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
        let aside = rays.iter().filter(|ray| ray.dot(&ahead) < TUNING.widest_lens).count();
        aside as f64 > TUNING.round * rays.len() as f64
    }

    /// In a frame in which all places are shifted by `shift`.
    pub fn moved(self, shift: &Vector3) -> Self {
        match self {
            Sensor::At(position) => Sensor::At(position + shift),
            far => far,
        }
    }

    /// On the other side.
    pub fn reversed(self) -> Self {
        match self {
            Sensor::At(position) => Sensor::At(-position),
            Sensor::Toward(direction) => Sensor::Toward(-direction),
        }
    }
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points whose rays are looked at.
        round_samples: usize = 1000,
        /// The cosine of half the angle that a lens sees at most, 120 degrees,
        widest_lens: f64 = 0.5,
        /// and the share of rays beyond it from which on a scanner looks all the way round.
        round: f64 = 0.1,
        /// Facets that the search for a direction looks at.
        samples: usize = 400,
        /// Directions tried over the half sphere.
        directions: usize = 150,
        /// Then directions around the best one, at these angles (degrees) from it.
        refinements: [f64; 4] = [6.0, 3.0, 1.5, 0.75],
        /// The densest facets are seen head-on: this quantile.
        head_on: f64 = 0.95,
        /// What is denser still counts no more than so many times that.
        densest: f64 = 1.3,
        /// No surface is seen at a smaller cosine than about this,
        grazing: f64 = 0.26,
        /// and one that would be costs so much.
        grazing_cost: f64 = 0.3,
    }
}

/// A piece of a view's surface, as far as it tells from where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facet {
    /// Unit normal (local frame), its sign arbitrary.
    pub normal: nalgebra::Vector3<f32>,
    /// Points there for a unit of area, in any unit that all facets of the view share.
    pub density: f32,
}

impl Facet {
    /// Of a place with its normal and the squared distance of the farthest of so many nearest points as for all others.
    pub fn within(normal: [f32; 3], farthest2: f32) -> Self {
        Facet { normal: normal.into(), density: 1.0 / farthest2.max(f32::MIN_POSITIVE) }
    }
}

/// The axis along which a view was seen, from its facets. Its sign is arbitrary: a sheet looks the same from behind.
///
/// A scanner's rays are spread evenly, so a surface that they meet at an angle holds fewer points, by the angle's cosine;
/// and what they would only graze, or meet from behind, was not seen. The direction that explains the facets best
/// (least sum of absolute differences) is found to some 5 degrees where points are as scanned, to 15 where they were
/// thinned evenly. (That points along it lie in one sheet says less: a thin open sheet is one along most directions.)
pub fn viewing_axis(facets: &[Facet]) -> Vector3 {
    let step = facets.len().div_ceil(TUNING.samples).max(1);
    let facets: Vec<(Vector3, f64)> =
        facets.iter().step_by(step).map(|f| (f.normal.cast::<f64>(), f.density.into())).collect();
    let facets = with_head_on_as_one(facets);
    let mut cosines = Vec::with_capacity(facets.len());
    let mut cost = |direction: &Vector3| unexplained(&facets, direction, &mut cosines);
    let mut cheapest = |directions: &mut dyn Iterator<Item = Vector3>| {
        directions.map(|d| (cost(&d), d)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vector3::z, |(_, d)| d)
    };
    let mut best = cheapest(&mut half_sphere(TUNING.directions));
    for degrees in TUNING.refinements {
        best = cheapest(&mut std::iter::once(best).chain(cone(best, f64::to_radians(degrees))));
    }
    best
}

/// Scales densities so that facets seen head-on have 1.
fn with_head_on_as_one(mut facets: Vec<(Vector3, f64)>) -> Vec<(Vector3, f64)> {
    let mut densities: Vec<f64> = facets.iter().map(|f| f.1).collect();
    densities.sort_unstable_by(f64::total_cmp);
    let head_on = densities.get((TUNING.head_on * densities.len() as f64) as usize).copied().unwrap_or(1.0);
    for (_, density) in &mut facets {
        *density = (*density / head_on).min(TUNING.densest);
    }
    facets
}

/// How badly a scanner in `direction` explains the facets: the mean difference between their densities and cosines, and
/// their share that it could not have seen. `cosines` is room to work in.
fn unexplained(facets: &[(Vector3, f64)], direction: &Vector3, cosines: &mut Vec<f64>) -> f64 {
    let (mut across, mut along) = (0.0, 0.0);
    cosines.clear();
    for (normal, density) in facets {
        let cosine = normal.dot(direction).abs();
        across += density * cosine;
        along += cosine * cosine;
        cosines.push(cosine);
    }
    let factor = across / along.max(f64::MIN_POSITIVE);
    let differs = |((_, density), cosine): (&(Vector3, f64), &f64)| {
        (density - factor * cosine).abs() + TUNING.grazing_cost * (1.0 - cosine / TUNING.grazing).max(0.0)
    };
    facets.iter().zip(&*cosines).map(differs).sum::<f64>() / facets.len().max(1) as f64
}

/// Chooses the side of a sheet by the rest of the object: surface seen from outside faces away from the middle.
///
/// `samples` are points of the view with unit normals of any sign (local frame), `middle` the middle of all views in
/// the local frame. Returns the sensor, and how clear the choice is: 0 (a coin toss) to 1.
pub fn outer_side(axis: Vector3, samples: &[(LocalPoint, [f32; 3])], middle: &Vector3) -> (Sensor, f64) {
    let (mut flux, mut total) = (0.0, 0.0);
    for (point, normal) in samples {
        let normal = nalgebra::Vector3::from(*normal).cast::<f64>();
        let outward = normal * normal.dot(&axis).signum();
        let radial = nalgebra::Vector3::from(*point).cast::<f64>() - middle;
        flux += outward.dot(&radial);
        total += outward.dot(&radial).abs();
    }
    let sensor = Sensor::Toward(axis);
    let clarity = if total > 0.0 { flux.abs() / total } else { 0.0 };
    (if flux < 0.0 { sensor.reversed() } else { sensor }, clarity)
}

/// The middle of all posed views in a view's local frame.
pub fn middle_in_view(local_poses: &[Motion], placed: &[bool], view: usize) -> Vector3 {
    let placed: Vec<&Motion> = local_poses.iter().zip(placed).filter(|(_, p)| **p).map(|(pose, _)| pose).collect();
    let sum: Vector3 = placed.iter().map(|pose| pose.translation.vector).sum();
    let middle = nalgebra::Point3::from(sum / placed.len().max(1) as f64);
    local_poses[view].inverse_transform_point(&middle).coords
}

fn least_aligned_axis(direction: &Vector3) -> Vector3 {
    let mut axis = Vector3::zeros();
    axis[direction.iamin()] = 1.0;
    axis
}

/// Directions at `angle` (radians) around `axis`.
fn cone(axis: Vector3, angle: f64) -> impl Iterator<Item = Vector3> {
    const AROUND: usize = 12;
    let across = axis.cross(&least_aligned_axis(&axis)).normalize();
    let upward = axis.cross(&across);

    (0..AROUND).map(move |k| {
        let (sine, cosine) = (std::f64::consts::TAU * k as f64 / AROUND as f64).sin_cos();
        axis * angle.cos() + (across * cosine + upward * sine) * angle.sin()
    })
}

/// Directions spread evenly over the half sphere z >= 0 (a Fibonacci lattice).
fn half_sphere(count: usize) -> impl Iterator<Item = Vector3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (k as f64 + 0.5) / count as f64;
        let radius = (1.0 - z * z).sqrt();
        let (sine, cosine) = (golden * k as f64).sin_cos();
        Vector3::new(radius * cosine, radius * sine, z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Facets of the half of a sphere that is seen from far off in `direction`, by rays evenly spread; and their places.
    fn cap(direction: &Vector3) -> Vec<(Vector3, Facet)> {
        let seen = half_sphere(1500).flat_map(|n| [n, -n]).filter(|n| n.dot(direction) > 0.15);
        let facet = |n: &Vector3| Facet { normal: -n.cast::<f32>(), density: 7.0 * n.dot(direction) as f32 };
        seen.map(|n| (n * 50.0, facet(&n))).collect()
    }

    #[test]
    fn who_stands_on_the_ground_looks_all_round_and_a_wide_lens_does_not() {
        let seen_within = |half_angle: f64| -> Vec<LocalPoint> {
            let rays = half_sphere(3000).filter(|ray| ray.z > half_angle.cos());
            rays.map(|ray| (ray * 3.0).cast::<f32>().into()).collect()
        };
        let at = Sensor::At(Vector3::zeros());
        // rays to flat ground go to all sides and none upward
        assert!(at.is_round(&seen_within(f64::to_radians(85.0))));
        assert!(!at.is_round(&seen_within(f64::to_radians(60.0))));
        assert!(!Sensor::Toward(Vector3::z()).is_round(&seen_within(f64::to_radians(85.0))));
    }

    #[test]
    fn a_cap_was_seen_from_its_outer_side() {
        for direction in [Vector3::x(), Vector3::new(1.0, -2.0, 0.5).normalize(), -Vector3::z()] {
            let cap = cap(&direction);
            let facets: Vec<Facet> = cap.iter().map(|(_, facet)| *facet).collect();
            let axis = viewing_axis(&facets);
            assert!(axis.dot(&direction).abs() > 0.999, "{axis} {direction}");
            let samples: Vec<_> = cap.iter().map(|(p, facet)| (p.cast::<f32>().into(), facet.normal.into())).collect();
            let (sensor, clarity) = outer_side(axis, &samples, &Vector3::zeros());
            assert!(sensor.direction_from(&[0.0; 3]).dot(&direction) > 0.0);
            assert!(clarity > 0.9, "{clarity}");
        }
    }

    #[test]
    fn the_axis_of_an_open_sheet_is_told_by_its_density() {
        // a shallow ridge is one sheet along nearly all directions
        let axis = Vector3::new(0.5, 0.3, 0.8).normalize();
        let slopes = [0.0, 0.3, -0.3, 0.6].map(|slope| Vector3::new(slope, 0.4 * slope * slope - 0.2, 1.0).normalize());
        let facets: Vec<Facet> =
            slopes.iter().map(|n| Facet { normal: n.cast::<f32>(), density: n.dot(&axis).abs() as f32 }).collect();
        assert!(viewing_axis(&facets).dot(&axis).abs() > 0.99);
    }
}
