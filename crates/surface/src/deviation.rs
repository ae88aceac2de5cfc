//! How far one surface is from another, place by place and with a sign: outside of the reference is positive.
//!
//! A reference with triangles is the nearest place on them; of a bare cloud it is the plane of the nearest point, as far as that
//! reaches. Where the normals of a cloud say nothing of its outer side, distances have no sign.

use rayon::prelude::*;

use crate::distance::Distances;
use crate::nearest::TriangleTree;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals::{NEIGHBOURS, local_planes};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Mesh, Point3, Surface, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The plane of a point reaches as far as this many distances to its nearest neighbours.
        plane_reach: f64 = 2.0,
    }
}
/// Points that are measured between two looks at the flag that stops.
const PATIENCE: usize = 1 << 16;
/// Grey: nothing of the reference is within reach.
const NOWHERE: [u8; 3] = [128; 3];

/// What distances are measured to.
pub struct Reference {
    form: Form,
}

enum Form {
    Mesh(Box<(Mesh, TriangleTree)>),
    Cloud(CloudPlanes),
}

/// A cloud as planes about its points.
struct CloudPlanes {
    center: Vector3,
    indexed: IndexedPoints,
    normals: Vec<nalgebra::Vector3<f32>>,
    is_oriented: bool,
    /// How far a plane reaches, squared.
    reach2: f64,
}

impl Reference {
    /// The triangles of a surface, or its points if it has none; `None` if it is empty.
    pub fn new(surface: &Surface) -> Option<Reference> {
        let form = match surface.mesh() {
            Some(mesh) => {
                let tree = TriangleTree::new(&mesh)?;
                Form::Mesh(Box::new((mesh, tree)))
            }
            None => Form::Cloud(CloudPlanes::new(surface)?),
        };
        Some(Reference { form })
    }

    /// Whether distances have a sign.
    pub fn has_sides(&self) -> bool {
        match &self.form {
            Form::Mesh(_) => true,
            Form::Cloud(planes) => planes.is_oriented,
        }
    }

    /// How far each point is from the reference, positive outside; NaN for those that have nothing of it within `reach`.
    ///
    /// # Errors
    /// [`Canceled`], while it is at work.
    pub fn distances(&self, points: &[Point3], reach: f64, progress: &Progress) -> Result<Vec<f64>, Canceled> {
        let mut found = Vec::with_capacity(points.len());
        for part in points.chunks(PATIENCE) {
            progress.check()?;
            let of_part: Vec<f64> =
                part.par_iter().with_min_len(128).map(|point| self.distance(point, reach)).collect();
            found.extend(of_part);
        }
        Ok(found)
    }

    fn distance(&self, point: &Point3, reach: f64) -> f64 {
        let (mesh, tree) = match &self.form {
            Form::Mesh(mesh) => &**mesh,
            Form::Cloud(planes) => return planes.distance(point, reach),
        };
        let Some(found) = tree.nearest(point, reach * reach) else { return f64::NAN };
        let is_inside = mesh.area_normal(found.face as usize).dot(&(point - found.place)) < 0.0;
        if is_inside { -found.distance2.sqrt() } else { found.distance2.sqrt() }
    }
}

impl CloudPlanes {
    fn new(surface: &Surface) -> Option<CloudPlanes> {
        let center = surface.cloud.bounds()?.center().coords;
        let points: Vec<LocalPoint> =
            surface.cloud.points.par_iter().map(|point| (point.coords - center).cast::<f32>().into()).collect();
        let indexed = IndexedPoints::new(points);
        let (normals, is_oriented) = match &surface.cloud.normals {
            Some(normals) => (normals.clone(), true),
            None => {
                let planes = local_planes(&indexed, &indexed.points, NEIGHBOURS);
                (planes.iter().map(|plane| nalgebra::Vector3::from(plane.normal)).collect(), false)
            }
        };
        let spacing = spacing(&indexed);
        Some(CloudPlanes { center, indexed, normals, is_oriented, reach2: (TUNING.plane_reach * spacing).powi(2) })
    }

    fn distance(&self, point: &Point3, reach: f64) -> f64 {
        let local = point.coords - self.center;
        let query: LocalPoint = local.cast::<f32>().into();
        let within2 = (reach * reach).min(f64::from(f32::MAX)) as f32;
        let Some(found) = self.indexed.tree.nearest(&query, within2) else { return f64::NAN };
        let nearest = nalgebra::Vector3::from(self.indexed.points[found.index as usize]).cast::<f64>();
        let normal = self.normals[found.index as usize].cast::<f64>();
        let offset = local - nearest;
        let height = offset.dot(&normal);
        let beside2 = (offset.norm_squared() - height * height).max(0.0);
        let size = if beside2 <= self.reach2 && normal != Vector3::zeros() { height.abs() } else { offset.norm() };
        if self.is_oriented && height < 0.0 { -size } else { size }
    }
}

/// The median distance of neighbours, of a few points.
pub fn spacing(indexed: &IndexedPoints) -> f64 {
    const ASKED: usize = 2000;
    const AROUND: usize = 4;
    let step = indexed.points.len().div_ceil(ASKED).max(1);
    let mut found = Vec::new();
    let mut of_point = |point: &LocalPoint| {
        indexed.tree.k_nearest(point, AROUND, f32::INFINITY, &mut found);
        // the point itself is the first
        let others = found.get(1..).unwrap_or_default();
        let sum: f64 = others.iter().map(|other| f64::from(other.distance2).sqrt()).sum();
        (!others.is_empty()).then(|| sum / others.len() as f64)
    };
    let mut distances: Vec<f64> = indexed.points.iter().step_by(step).filter_map(&mut of_point).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or_default()
}

/// The distances of all points in figures; lengths in their unit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DeviationReport {
    /// Points that have something of the reference within reach.
    pub points: usize,
    /// Points that have nothing of it within reach; they are in no other figure.
    pub out_of_reach: usize,
    /// The mean with signs: which side the points are on as a whole. Without signs if the reference has no sides.
    pub mean_signed: f64,
    /// The least with its sign.
    pub lowest: f64,
    /// The largest with its sign.
    pub highest: f64,
    /// Without signs.
    pub absolute: Distances,
    /// Share of the points that are farther than the limit.
    pub beyond_limit: Option<f64>,
}

impl DeviationReport {
    /// The figures of these distances, NaN for points that are out of reach.
    pub fn of(distances: &[f64], limit: Option<f64>) -> DeviationReport {
        let near: Vec<f64> = distances.iter().copied().filter(|distance| distance.is_finite()).collect();
        let count = near.len().max(1) as f64;
        let beyond = |limit: f64| near.iter().filter(|distance| distance.abs() > limit).count() as f64 / count;
        let extreme = |best: fn(f64, f64) -> f64| near.iter().copied().reduce(best).unwrap_or_default();
        DeviationReport {
            points: near.len(),
            out_of_reach: distances.len() - near.len(),
            mean_signed: near.iter().sum::<f64>() / count,
            lowest: extreme(f64::min),
            highest: extreme(f64::max),
            absolute: Distances::of(near.iter().map(|distance| distance.abs()).collect()),
            beyond_limit: limit.map(beyond),
        }
    }
}

/// The colours of distances: white on the reference, red outside up to `full`, blue inside; grey out of reach.
pub fn colors(distances: &[f64], full: f64) -> Vec<[u8; 3]> {
    let color = |distance: &f64| {
        if !distance.is_finite() {
            return NOWHERE;
        }
        let share = if full > 0.0 { (distance / full).clamp(-1.0, 1.0) } else { distance.signum() };
        let pale = (255.0 * (1.0 - share.abs())).round() as u8;
        if share > 0.0 { [255, pale, pale] } else { [pale, pale, 255] }
    };
    distances.iter().map(color).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Cloud;

    /// A sphere of this radius as a cloud with outward normals.
    fn sphere(radius: f64) -> Surface {
        let count = 20_000;
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let direction = |k: usize| {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
            let (sine, cosine) = (golden * k as f64).sin_cos();
            let around = (1.0 - z * z).sqrt();
            Vector3::new(around * cosine, around * sine, z)
        };
        let directions: Vec<Vector3> = (0..count).map(direction).collect();
        let cloud = Cloud {
            points: directions.iter().map(|d| Point3::from(radius * d)).collect(),
            normals: Some(directions.iter().map(|d| d.cast()).collect()),
            ..Cloud::default()
        };
        Surface { cloud, ..Surface::default() }
    }

    /// A box of edge 2 about the origin, wound outward.
    fn cube() -> Surface {
        let corner = |k: u32| {
            let side = |bit: u32| if k & bit == 0 { -1.0 } else { 1.0 };
            Point3::new(side(1), side(2), side(4))
        };
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        Surface { cloud: Cloud::from_points((0..8).map(corner).collect()), faces, ..Surface::default() }
    }

    fn distances(reference: &Surface, points: &[Point3], reach: f64) -> Vec<f64> {
        let reference = Reference::new(reference).expect("not empty");
        reference.distances(points, reach, &Progress::silent()).expect("not canceled")
    }

    #[test]
    fn a_box_has_an_inside_also_at_its_corners_and_edges() {
        let points = [
            (Point3::new(3.0, 0.0, 0.0), 2.0),
            (Point3::new(0.5, 0.1, 0.2), -0.5),
            (Point3::new(2.0, 2.0, 2.0), 3f64.sqrt()),
            (Point3::new(2.0, 2.0, 0.3), 2f64.sqrt()),
            (Point3::new(0.9, 0.9, 0.9), -0.1),
            (Point3::new(1.0, 0.2, 0.0), 0.0),
        ];
        let found = distances(&cube(), &points.map(|(point, _)| point), f64::INFINITY);
        for (found, (point, expected)) in found.iter().zip(points) {
            assert!((found - expected).abs() < 1e-12, "{point}: {found}");
        }
        let near = distances(&cube(), &points.map(|(point, _)| point), 1.5);
        assert!(near[0].is_nan() && near[2].is_nan() && near[1] == found[1]);
    }

    #[test]
    fn a_cloud_is_as_far_as_its_surface_not_as_its_points() {
        let reference = sphere(10.0);
        for (radius, expected) in [(10.02, 0.02), (9.9, -0.1), (12.0, 2.0)] {
            let other = sphere(radius);
            // turned about: no point is before another
            let turned: Vec<Point3> = other.cloud.points.iter().map(|p| Point3::new(p.z, p.x, p.y)).collect();
            let report = DeviationReport::of(&distances(&reference, &turned, f64::INFINITY), Some(0.05));
            assert!((report.mean_signed - expected).abs() < 0.002, "{report:?}");
            assert!((report.absolute.p99 - expected.abs()).abs() < 0.01, "{report:?}");
            assert_eq!(report.beyond_limit, Some(if expected.abs() > 0.05 { 1.0 } else { 0.0 }));
        }
        let mut bare = sphere(10.0);
        bare.cloud.normals = None;
        let bare = Reference::new(&bare).expect("not empty");
        assert!(!bare.has_sides());
        let inside = bare.distances(&[Point3::new(0.0, 0.0, 9.0)], f64::INFINITY, &Progress::silent());
        assert!((inside.expect("not canceled")[0] - 1.0).abs() < 0.02);
        assert!(Reference::new(&Surface::default()).is_none());
    }

    #[test]
    fn figures_leave_out_what_is_out_of_reach() {
        let report = DeviationReport::of(&[-1.0, 3.0, f64::NAN], Some(2.0));
        assert_eq!((report.points, report.out_of_reach, report.mean_signed), (2, 1, 1.0));
        assert_eq!((report.lowest, report.highest, report.absolute.max), (-1.0, 3.0, 3.0));
        assert_eq!(report.beyond_limit, Some(0.5));
        let none = DeviationReport::of(&[f64::NAN], None);
        assert_eq!((none.points, none.absolute, none.highest), (0, Distances::default(), 0.0));
    }

    #[test]
    fn colours_say_the_side() {
        assert_eq!(
            colors(&[0.0, 1.0, -2.0, 0.5, f64::NAN], 1.0),
            [[255, 255, 255], [255, 0, 0], [0, 0, 255], [255, 128, 128], NOWHERE]
        );
    }
}
