//! Where the scanner stood: told by the file or the caller, else read off the scan itself.
//!
//! A range scan sees each ray's first surface only, so seen from the scanner it is one sheet: along the right
//! direction, points that fall side by side lie at about one depth.

use crate::geometry::neighbours::LocalPoint;
use crate::geometry::{Motion, Vector3};

use super::view::View;

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

    /// On the other side.
    pub fn reversed(self) -> Self {
        match self {
            Sensor::At(position) => Sensor::At(-position),
            Sensor::Toward(direction) => Sensor::Toward(-direction),
        }
    }
}

/// Points that the search for a direction looks at.
const SAMPLES: usize = 4000;
/// Directions tried over the half sphere.
const DIRECTIONS: usize = 300;

/// Then directions around the best one, at these angles (degrees) from it.
const REFINEMENTS: [f64; 4] = [6.0, 3.0, 1.5, 0.75];

/// The axis along which the view is most nearly one sheet. Its sign is arbitrary: a sheet looks the same from behind.
pub fn viewing_axis(view: &View) -> Vector3 {
    let points = view.points();
    let step = points.len().div_ceil(SAMPLES).max(1);
    let samples: Vec<Vector3> =
        points.iter().step_by(step).map(|p| nalgebra::Vector3::from(*p).cast::<f64>()).collect();
    // cells wide enough to hold several samples of a sheet that is seen head-on
    sheet_axis(&samples, view.spacing * (step as f64).sqrt() * 3.0, DIRECTIONS)
}

/// The axis along which `samples` of a surface are most nearly one sheet, of about `directions` over the half sphere;
/// side by side are those within `cell`.
pub(super) fn sheet_axis(samples: &[Vector3], cell: f64, directions: usize) -> Vector3 {
    let cost = |direction: &Vector3| mean_depth_range(samples, direction, cell);
    let cheapest = |directions: &mut dyn Iterator<Item = Vector3>| {
        directions.map(|d| (cost(&d), d)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vector3::z, |(_, d)| d)
    };
    let mut best = cheapest(&mut half_sphere(directions));
    for degrees in REFINEMENTS {
        best = cheapest(&mut std::iter::once(best).chain(cone(best, f64::to_radians(degrees))));
    }
    best
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

/// Mean over occupied cells, seen along `direction`, of the range of depths in the cell.
fn mean_depth_range(samples: &[Vector3], direction: &Vector3, cell: f64) -> f64 {
    let across = direction.cross(&least_aligned_axis(direction)).normalize();
    let upward = direction.cross(&across);
    let mut placed: Vec<(i32, i32, f64)> = samples
        .iter()
        .map(|p| ((p.dot(&across) / cell).floor() as i32, (p.dot(&upward) / cell).floor() as i32, p.dot(direction)))
        .collect();
    placed.sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
    let (mut sum, mut weight) = (0.0, 0.0);
    for group in placed.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let range = group.last().map_or(0.0, |last| last.2) - group[0].2;
        sum += range * group.len() as f64;
        weight += group.len() as f64;
    }
    sum / f64::max(weight, 1.0)
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
    use crate::geometry::{Cloud, Point3};

    /// The half of a sphere that is seen from far off in `direction`.
    fn cap(direction: &Vector3) -> View {
        let points =
            half_sphere(3000).flat_map(|p| [p, -p]).filter(|p| p.dot(direction) > 0.15).map(|p| Point3::from(p * 50.0));
        View::new(&Cloud::from_points(points.collect())).expect("a cap can be used")
    }

    #[test]
    fn a_cap_was_seen_from_its_outer_side() {
        for direction in [Vector3::x(), Vector3::new(1.0, -2.0, 0.5).normalize(), -Vector3::z()] {
            let view = cap(&direction);
            let axis = viewing_axis(&view);
            assert!(axis.dot(&direction).abs() > 0.97, "{axis} {direction}");
            let samples: Vec<_> = view
                .points()
                .iter()
                .map(|p| {
                    let normal = (nalgebra::Vector3::from(*p) + view.center.cast::<f32>()).normalize();
                    (*p, (-normal).into())
                })
                .collect();
            let (sensor, clarity) = outer_side(axis, &samples, &-view.center);
            assert!(sensor.direction_from(&[0.0; 3]).dot(&direction) > 0.0);
            assert!(clarity > 0.9, "{clarity}");
        }
    }
}
