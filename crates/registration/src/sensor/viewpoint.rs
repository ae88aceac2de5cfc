//! Whether a scan was taken from the origin of its own frame, read off the scan alone.
//!
//! Depth cameras and lidars put the origin where they stand, but no file says so, and processed scans stand anywhere. Two
//! things hold at the true viewpoint and hardly anywhere else: rays leave it evenly spread, and in each direction it saw
//! one surface, not several behind each other.

use crate::view::median;
use visage_geometry::Vector3;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint, Neighbour};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Places at which the spread of the rays is measured.
        least_places: usize = 50,
        /// The quartiles of the solid angle that a point stands for differ by no more than this factor: 1.1 for a laser, 1.3 for
        /// a depth camera; places that are no viewpoint mostly have 2 and more.
        even: f64 = 1.5,
        /// Points of a scan that was thinned are spread evenly over the surface: the areas that they stand for vary less than the
        /// solid angles from any viewpoint, by this factor at least in a scan that was not.
        thinned: f64 = 1.1,
        /// Points that are looked at for surfaces behind each other,
        directions: usize = 4000,
        /// and those of them that ask their neighbours in direction.
        asked: usize = 400,
        /// A neighbour lies on another surface if the line to it is steeper than this against the rays (about 3 degrees from
        /// them), and farther off than this share of the distance.
        steep: f32 = 20.0,
        /// That share of the distance.
        apart: f32 = 0.02,
        /// A place between surfaces has so many neighbours on others;
        others: usize = 3,
        /// no more than this share of all may be such a place: the borders of what stands before a background are.
        between: f64 = 0.06,
        /// Axes that a panorama's grid may have,
        axes: usize = 300,
        /// and how close to its poles rays are looked at, as a sine.
        near_pole: f64 = 0.15,
        /// So even rays have to be when they are allowed an axis.
        even_about_axis: f64 = 1.25,
        /// Places with their neighbours, at which viewpoints are tried.
        places: usize = 240,
        /// Distances of viewpoints from the middle of the scan, in its radius.
        distances: [f64; 7] = [0.0, 0.35, 0.7, 1.2, 2.0, 3.5, 6.0],
        /// Directions in which they lie.
        around: usize = 60,
        /// Steps about the best, in the distance from it to the scan's middle (or the radius, if that is more).
        steps: [f64; 6] = [0.3, 0.15, 0.08, 0.04, 0.02, 0.01],
        /// From the place mirrored in the middle of the scan, and from afar in any direction, rays are less even by this factor, or
        /// the scan does not show where it was taken from: of a far scanner it does not, and half a ball looks from its middle as
        /// evenly sampled as from afar.
        sided: f64 = 1.5,
        /// Afar, in the radius of the scan.
        far: f64 = 20.0,
    }
}

/// Neighbours in direction that are asked.
const NEIGHBOURS: usize = 8;

/// How evenly rays from `eye` are spread: the solid angle a point stands for at some places, by its nearest points.
///
/// `None` for a place at the eye itself.
fn solid_angle(points: &[LocalPoint], place: &LocalPoint, near: &[Neighbour], eye: &Vector3) -> Option<f64> {
    let ray = nalgebra::Vector3::from(*place).cast::<f64>() - eye;
    let distance = ray.norm();
    let forward = ray.try_normalize(f64::MIN_POSITIVE)?;
    let across = forward.cross(&Vector3::ith(forward.iamin(), 1.0)).normalize();
    let upward = forward.cross(&across);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let (mut x_sum, mut y_sum) = (0.0, 0.0);
    for neighbour in near {
        let at = nalgebra::Vector3::from(points[neighbour.index as usize]).cast::<f64>() - eye;
        let depth = at.dot(&forward).max(0.1 * distance);
        let (x, y) = (at.dot(&across) / depth, at.dot(&upward) / depth);
        (x_sum, y_sum) = (x_sum + x, y_sum + y);
        (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
    }
    let count = near.len().max(1) as f64;
    let (x, y) = (x_sum / count, y_sum / count);
    let area2 = (xx / count - x * x) * (yy / count - y * y) - (xy / count - x * y).powi(2);
    Some(area2.max(0.0).sqrt())
}

/// The area of surface that a point stands for, by the nearest points, up to a factor that is the same for all.
fn area(points: &[LocalPoint], near: &[Neighbour]) -> f64 {
    let at = |n: &Neighbour| nalgebra::Vector3::from(points[n.index as usize]).cast::<f64>();
    let mean = near.iter().map(at).sum::<Vector3>() / near.len().max(1) as f64;
    let scatter: nalgebra::Matrix3<f64> = near.iter().map(|n| (at(n) - mean) * (at(n) - mean).transpose()).sum();
    // of a flat scatter the second invariant is the product of its two spreads
    (0.5 * (scatter.trace().powi(2) - scatter.norm_squared())).max(0.0).sqrt()
}

/// How unevenly rays are spread: the factor between the quartiles of solid angles; `None` of fewer than
/// `TUNING.least_places`.
fn unevenness(mut solid_angles: Vec<f64>) -> Option<f64> {
    if solid_angles.len() < TUNING.least_places {
        return None;
    }
    let last = solid_angles.len();
    let mut quartile = |share: f64| {
        let place = (share * last as f64) as usize;
        *solid_angles.select_nth_unstable_by(place, f64::total_cmp).1
    };
    let (low, high) = (quartile(0.25), quartile(0.75));
    Some(high / low.max(f64::MIN_POSITIVE))
}

/// What a point of a scan stands for, by its nearest points: of the rays from a viewpoint, and of the surface.
///
/// Each is measured twice: by the region that the nearest points take up, and by the square of the step to the nearest
/// of them. Rings of a rotating scanner lie far apart, with points close together along them. The nearest points are then
/// those of one ring, which take up no region; but the step along the ring is the same everywhere.
#[derive(Debug, Clone, Copy)]
pub struct PointShare {
    /// Unit direction of the ray.
    ray: Vector3,
    rays: [f64; 2],
    surface: [f64; 2],
}

impl PointShare {
    /// At `place`, which `near` surrounds, for rays from `eye`; `None` at the eye itself, or without a neighbour.
    pub fn of(points: &[LocalPoint], place: &LocalPoint, near: &[Neighbour], eye: &Vector3) -> Option<Self> {
        let (ray, rays) = share_of_rays(points, place, near, eye)?;
        Some(PointShare { ray, rays, surface: share_of_surface(points, near)? })
    }
}

/// The direction of the ray to a place, and what the point there stands for of the rays from `eye`.
fn share_of_rays(
    points: &[LocalPoint],
    place: &LocalPoint,
    near: &[Neighbour],
    eye: &Vector3,
) -> Option<(Vector3, [f64; 2])> {
    let ray = |p: &LocalPoint| (nalgebra::Vector3::from(*p).cast::<f64>() - eye).try_normalize(f64::MIN_POSITIVE);
    let own = ray(place)?;
    let others = near.iter().filter(|n| n.distance2 > 0.0);
    let angles2 = others.filter_map(|n| Some((ray(&points[n.index as usize])? - own).norm_squared()));
    Some((own, [solid_angle(points, place, near, eye)?, angles2.min_by(f64::total_cmp)?]))
}

/// What a point stands for of the surface, by its nearest points.
fn share_of_surface(points: &[LocalPoint], near: &[Neighbour]) -> Option<[f64; 2]> {
    let distances2 = near.iter().map(|n| n.distance2).filter(|distance2| *distance2 > 0.0).map(f64::from);
    Some([area(points, near), distances2.min_by(f64::total_cmp)?])
}

/// How unevenly rays are spread, and points over the surface, by each of the measures; `None` of too few places.
fn spreads(shares: &[PointShare]) -> Option<[(f64, f64); 2]> {
    let by = |measure: usize| {
        let rays = unevenness(shares.iter().map(|share| share.rays[measure]).collect())?;
        Some((rays, unevenness(shares.iter().map(|share| share.surface[measure]).collect())?))
    };
    Some([by(0)?, by(1)?])
}

/// How uneven the rays of a panorama are, whose rows and columns are latitudes and longitudes: towards its poles they
/// come closer by the sine of the angle from the axis, which is not known.
fn unevenness_about_axis(shares: &[PointShare]) -> Option<f64> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let about = |k: usize| {
        let z = (k as f64 + 0.5) / TUNING.axes as f64;
        let (sine, cosine) = (golden * k as f64).sin_cos();
        let axis = Vector3::new((1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z);
        unevenness(
            shares.iter().map(|share| share.rays[0] / share.ray.cross(&axis).norm().max(TUNING.near_pole)).collect(),
        )
    };
    (0..TUNING.axes).filter_map(about).min_by(f64::total_cmp)
}

/// Whether rays are spread as evenly as a scanner's, by one of the measures. Of thinned points it can't be said.
pub fn is_even(shares: &[PointShare]) -> bool {
    let is_sampled = |(rays, surface): (f64, f64)| surface >= TUNING.thinned * rays;
    let Some(spreads) = spreads(shares) else { return false };
    let is_even = |spread: (f64, f64)| spread.0 <= TUNING.even && is_sampled(spread);
    let is_panorama =
        || is_sampled(spreads[0]) && unevenness_about_axis(shares).is_some_and(|u| u <= TUNING.even_about_axis);
    spreads.into_iter().any(is_even) || is_panorama()
}

/// Their neighbours.
const NEAREST: usize = visage_geometry::normals::NEIGHBOURS;

/// The viewpoint from which the rays to a scan are spread most evenly, if that is plain: not where the scanner was far,
/// since a sheet looks the same from behind, nor where points were thinned. `radius` is the scan's.
pub fn find(indexed: &IndexedPoints, radius: f64) -> Option<Vector3> {
    let points = &indexed.points;
    let step = points.len().div_ceil(TUNING.places).max(1);
    let mut found = Vec::new();
    // what a point stands for of the surface is the same from everywhere
    let places: Vec<(LocalPoint, Vec<Neighbour>, [f64; 2])> = points
        .iter()
        .step_by(step)
        .filter_map(|place| {
            indexed.tree.k_nearest_unordered(place, NEAREST, 0.0, &mut found);
            Some((*place, found.clone(), share_of_surface(points, &found)?))
        })
        .collect();
    let seen = |eye: &Vector3| -> Vec<PointShare> {
        let share = |(place, near, surface): &(LocalPoint, Vec<Neighbour>, [f64; 2])| {
            let (ray, rays) = share_of_rays(points, place, near, eye)?;
            Some(PointShare { ray, rays, surface: *surface })
        };
        places.iter().filter_map(share).collect()
    };
    let cost = |eye: &Vector3| {
        let seen = seen(eye);
        let by = |measure: usize| unevenness(seen.iter().map(|share| share.rays[measure]).collect());
        by(0).zip(by(1)).map_or(f64::INFINITY, |(region, step)| region.min(step))
    };
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let direction = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / TUNING.around as f64;
        let (sine, cosine) = (golden * k as f64).sin_cos();
        Vector3::new((1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z)
    };
    let tried =
        TUNING.distances.iter().flat_map(|distance| (0..TUNING.around).map(move |k| direction(k) * *distance * radius));
    let mut best = tried.map(|eye| (cost(&eye), eye)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    for step in TUNING.steps {
        let mut moved = true;
        while moved {
            moved = false;
            let size = step * best.1.norm().max(radius);
            for k in 0..6 {
                let eye = best.1 + Vector3::ith(k / 2, if k % 2 == 0 { size } else { -size });
                let cost = cost(&eye);
                if cost < best.0 * 0.999 {
                    (best, moved) = ((cost, eye), true);
                }
            }
        }
    }
    let far = (0..TUNING.around).map(|k| cost(&(direction(k) * TUNING.far * radius))).fold(f64::INFINITY, f64::min);
    let is_plain = cost(&-best.1).min(far) > TUNING.sided * best.0;
    // the rays of a camera need not be as even as those from an origin; thinned points tell nothing of rays
    let is_sampled = |(rays, surface): (f64, f64)| rays <= best.0 && surface >= TUNING.thinned * rays;
    (is_plain && spreads(&seen(&best.1))?.into_iter().any(is_sampled)).then_some(best.1)
}

/// Whether one surface only is seen from `eye` in each direction.
pub fn is_single(points: &[LocalPoint], eye: &Vector3) -> bool {
    let eye = eye.cast::<f32>();
    let step = points.len().div_ceil(TUNING.directions).max(1);
    let rays: Vec<nalgebra::Vector3<f32>> =
        points.iter().step_by(step).map(|p| nalgebra::Vector3::from(*p) - eye).filter(|ray| ray.norm() > 0.0).collect();
    let directions = IndexedPoints::new(rays.iter().map(|ray| ray.normalize().into()).collect());
    let every = rays.len().div_ceil(TUNING.asked).max(1);
    let (mut asked, mut between, mut found) = (0usize, 0usize, Vec::new());
    for (index, ray) in rays.iter().enumerate().step_by(every) {
        directions.tree.k_nearest_unordered(&directions.points[index], NEIGHBOURS + 1, 0.0, &mut found);
        let reach = found.iter().map(|n| n.distance2).fold(0.0, f32::max).sqrt();
        let distance = ray.norm();
        let is_other = |n: &&Neighbour| {
            let apart = (rays[n.index as usize].norm() - distance).abs() / distance;
            apart > TUNING.steep * reach && apart > TUNING.apart
        };
        asked += 1;
        between += usize::from(found.iter().filter(is_other).count() >= TUNING.others);
    }
    asked > 0 && between as f64 <= TUNING.between * asked as f64
}

/// The typical angle between neighbouring rays, by their unit directions.
pub(super) fn angle_between_rays(directions: &IndexedPoints) -> f32 {
    let mut found = Vec::new();
    let every = directions.points.len().div_ceil(500).max(1);
    let mut nearest: Vec<f32> = directions
        .points
        .iter()
        .step_by(every)
        .filter_map(|direction| {
            directions.tree.k_nearest(direction, 2, f32::INFINITY, &mut found);
            found.iter().map(|n| n.distance2).max_by(f32::total_cmp)
        })
        .collect();
    median(&mut nearest).unwrap_or(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Sensor;
    use crate::view::View;
    use visage_geometry::{Cloud, Point3};

    /// A room of 6 by 5 by 3 m with a box in it, as a camera sees it that stands at `eye` and looks along `forward`; in
    /// the room's frame.
    fn room_from(eye: Point3, forward: Vector3) -> Vec<Point3> {
        let across = forward.cross(&Vector3::z()).normalize();
        let upward = across.cross(&forward);
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        // evenly spread over a cone of 55 degrees about the direction in which it looks
        let rays = (0..10_000).map(|k| {
            let along = 1.0 - 0.426 * (f64::from(k) + 0.5) / 10_000.0;
            let (sine, cosine) = (golden * f64::from(k)).sin_cos();
            let aside = (1.0 - along * along).sqrt();
            forward * along + across * (aside * cosine) + upward * (aside * sine)
        });
        seen_along(eye, rays)
    }

    /// The room as it is seen along these rays.
    fn seen_along(eye: Point3, rays: impl Iterator<Item = Vector3>) -> Vec<Point3> {
        let boxes = [([0.0, 0.0, 0.0], [6.0, 5.0, 3.0], true), ([3.5, 1.5, 0.0], [4.5, 2.6, 1.1], false)];
        let hit = |ray: Vector3| {
            let reach = |(low, high, from_inside): &([f64; 3], [f64; 3], bool)| {
                let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
                for axis in 0..3 {
                    let ends = [low[axis], high[axis]].map(|end| (end - eye[axis]) / ray[axis]);
                    (near, far) = (near.max(ends[0].min(ends[1])), far.min(ends[0].max(ends[1])));
                }
                let reach = if *from_inside { far } else { near };
                (near <= far && reach > 0.0).then_some(reach)
            };
            boxes.iter().filter_map(reach).min_by(f64::total_cmp)
        };
        rays.filter_map(|ray| Some(eye + ray * hit(ray)?)).collect()
    }

    #[test]
    fn a_scan_in_its_camera_s_frame_was_taken_from_the_origin() {
        let eye = Point3::new(1.0, 1.2, 1.5);
        let points = room_from(eye, Vector3::new(0.9, 0.4, -0.1).normalize());
        let camera = Cloud::from_points(points.iter().map(|p| Point3::from(p - eye)).collect());
        let view = View::new(&camera).expect("a sound scan");
        assert!(matches!(view.sensor, Some(Sensor::At(place)) if (place + view.center).norm() < 1e-9));
        let elsewhere = Cloud::from_points(points.iter().map(|p| p + Vector3::new(4.0, -3.0, 1.0)).collect());
        assert_eq!(View::new(&elsewhere).expect("a sound scan").sensor, None);
    }

    /// Rays in rows of one latitude (radians), `columns` each; the axis is not one of the frame.
    fn rows(latitudes: impl Iterator<Item = f64>, columns: u32) -> impl Iterator<Item = Vector3> {
        let turned = nalgebra::Rotation3::from_euler_angles(0.4, -0.7, 0.2);
        latitudes.flat_map(move |latitude| {
            (0..columns).map(move |k| {
                let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(columns)).sin_cos();
                turned * Vector3::new(latitude.cos() * cosine, latitude.cos() * sine, latitude.sin())
            })
        })
    }

    #[test]
    fn rings_and_panoramas_were_taken_from_their_origin() {
        let eye = Point3::new(1.0, 1.2, 1.5);
        // 16 rings 2 degrees apart, and a panorama of 100 rows from pole to pole
        let rings: Vec<Vector3> = rows((0..16).map(|k| f64::to_radians(2.0 * f64::from(k) - 15.0)), 900).collect();
        let panorama: Vec<Vector3> = rows((0..100).map(|k| f64::to_radians(1.8 * f64::from(k) - 89.1)), 200).collect();
        for rays in [rings, panorama] {
            let points = seen_along(eye, rays.into_iter());
            let own = Cloud::from_points(points.iter().map(|p| Point3::from(p - eye)).collect());
            let view = View::new(&own).expect("a sound scan");
            assert!(matches!(view.sensor, Some(Sensor::At(place)) if (place + view.center).norm() < 1e-9));
            let elsewhere = Cloud::from_points(points.iter().map(|p| p + Vector3::new(4.0, -3.0, 1.0)).collect());
            assert_eq!(View::new(&elsewhere).expect("a sound scan").sensor, None);
        }
    }

    #[test]
    fn a_camera_in_a_room_is_found_and_one_far_from_half_a_ball_is_not() {
        let eye = Point3::new(1.0, 1.2, 1.5);
        let room = Cloud::from_points(room_from(eye, Vector3::new(0.9, 0.4, -0.1).normalize()));
        let view = View::new(&room).expect("a sound scan");
        let found = find(&view.indexed, view.radius).expect("the camera shows");
        assert!((Point3::from(found + view.center) - eye).norm() < 0.3, "{:?}", found + view.center);
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let half_ball = (0..6000).map(|k| {
            // evenly seen from afar
            let radius = ((f64::from(k) + 0.5) / 6000.0).sqrt() * 0.98;
            let (sine, cosine) = (golden * f64::from(k)).sin_cos();
            Point3::new(radius * cosine, radius * sine, (1.0 - radius * radius).sqrt())
        });
        let view = View::new(&Cloud::from_points(half_ball.collect())).expect("a sound scan");
        assert_eq!(find(&view.indexed, view.radius), None);
    }
}
