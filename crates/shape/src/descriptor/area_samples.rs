//! A surface as oriented samples of equal area, with its exact moments: what no change of its mesh alters.

use nalgebra::Matrix3;

use super::cloud_surface::CloudSurface;
use crate::saliency::orientation::OrientedCloud;
use visage_geometry::{Bounds, Mesh, Point3, Vector3};

/// A flat piece of a surface.
struct Piece {
    corner: Vector3,
    sides: [Vector3; 2],
    /// A unit normal, of either side.
    normal: Vector3,
    area: f64,
    /// A triangle, or a parallelogram.
    is_half: bool,
}

/// Samples of equal area about the surface's centroid, in units of their mean distance from it.
#[derive(Debug, Clone, Default)]
pub(super) struct AreaSamples {
    pub points: Vec<Vector3>,
    /// Unit normals, of either side.
    pub normals: Vec<Vector3>,
    /// The second moments of the surface, and of its normals, by area.
    pub moments: [Matrix3<f64>; 2],
    /// The centroid in the frame of what was sampled, and the mean distance from it.
    pub center: Vector3,
    pub size: f64,
}

impl AreaSamples {
    /// `count` samples of a mesh; `None` if it has no area.
    pub fn of_mesh(mesh: &Mesh, count: usize) -> Option<AreaSamples> {
        let bounds = mesh.bounds()?;
        let (middle, unit) = (bounds.center(), bounds.diagonal());
        let piece = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|vertex| (mesh.vertices[vertex as usize] - middle) / unit);
            let across = (b - a).cross(&(c - a));
            let area = 0.5 * across.norm();
            (area > 0.0).then(|| Piece {
                corner: a,
                sides: [b - a, c - a],
                normal: across / (2.0 * area),
                area,
                is_half: true,
            })
        };
        Some(sampled(&mesh.faces.iter().filter_map(piece).collect::<Vec<_>>(), count)?.enlarged(middle, unit))
    }

    /// `count` samples of a cloud, whose points stand for as much area as their neighbours leave them; `None` without normals.
    pub fn of_cloud(cloud: &OrientedCloud, count: usize) -> Option<AreaSamples> {
        let bounds = Bounds::of(&cloud.points)?;
        let (middle, unit) = (bounds.center(), bounds.diagonal());
        let CloudSurface { points, normals, areas } = CloudSurface::of(cloud);
        let piece = |((point, normal), area): ((&Point3, &Vector3), &f64)| {
            let edge = area.sqrt() / unit;
            let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).try_normalize(f64::MIN_POSITIVE)?;
            let sides = [across * edge, normal.cross(&across) * edge];
            let corner = (point - middle) / unit - 0.5 * (sides[0] + sides[1]);
            (edge > 0.0).then_some(Piece { corner, sides, normal: *normal, area: edge * edge, is_half: false })
        };
        let pieces = points.iter().zip(&normals).zip(&areas).filter_map(piece);
        Some(sampled(&pieces.collect::<Vec<_>>(), count)?.enlarged(middle, unit))
    }

    /// The same of what is `unit` times as large about a `middle`.
    fn enlarged(self, middle: Point3, unit: f64) -> AreaSamples {
        AreaSamples { center: middle.coords + self.center * unit, size: self.size * unit, ..self }
    }

    /// Samples that are there, as those of a surface of their own: what is seen of one.
    pub fn of_part(points: Vec<Vector3>, normals: Vec<Vector3>) -> Option<AreaSamples> {
        let count = points.len() as f64;
        let mean = points.iter().sum::<Vector3>() / count;
        let points: Vec<Vector3> = points.into_iter().map(|p| p - mean).collect();
        let moment = |of: &[Vector3]| of.iter().map(|v| v * v.transpose()).sum::<Matrix3<f64>>() / count;
        let moments = [moment(&points), moment(&normals)];
        scaled(points, normals, moments, mean)
    }
}

/// Samples spread evenly over the pieces in their order, at places that fill each.
fn sampled(pieces: &[Piece], count: usize) -> Option<AreaSamples> {
    let total: f64 = pieces.iter().map(|piece| piece.area).sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let center = pieces.iter().map(|piece| piece.middle() * piece.area).sum::<Vector3>() / total;
    let (mut spread, mut facing) = (Matrix3::zeros(), Matrix3::zeros());
    for piece in pieces {
        spread += piece.second_moment(&center);
        facing += piece.normal * piece.normal.transpose() * piece.area;
    }
    let (mut points, mut normals) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut rest = pieces.iter();
    let (mut piece, mut reached) = (rest.next()?, 0.0);
    for number in 0..count {
        let wanted = total * (number as f64 + 0.5) / count as f64;
        while reached + piece.area < wanted {
            let Some(next) = rest.next() else { break };
            reached += piece.area;
            piece = next;
        }
        points.push(piece.place(number) - center);
        normals.push(piece.normal);
    }
    scaled(points, normals, [spread / total, facing / total], center)
}

fn scaled(
    mut points: Vec<Vector3>,
    normals: Vec<Vector3>,
    moments: [Matrix3<f64>; 2],
    center: Vector3,
) -> Option<AreaSamples> {
    let mean = points.iter().map(|p| p.norm()).sum::<f64>() / points.len() as f64;
    if !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    points.iter_mut().for_each(|p| *p /= mean);
    Some(AreaSamples { points, normals, moments, center, size: mean })
}

impl Piece {
    fn middle(&self) -> Vector3 {
        let share = if self.is_half { 1.0 / 3.0 } else { 0.5 };
        self.corner + (self.sides[0] + self.sides[1]) * share
    }

    /// The integral of `p p^T` about a place: of a parallelogram that of both its halves.
    fn second_moment(&self, center: &Vector3) -> Matrix3<f64> {
        let [a, b, c] =
            [self.corner, self.corner + self.sides[0], self.corner + self.sides[1]].map(|corner| corner - center);
        let of = |corners: [Vector3; 3], area: f64| {
            let sum: Vector3 = corners.iter().sum();
            let squares: Matrix3<f64> = corners.iter().map(|p| p * p.transpose()).sum();
            (squares + sum * sum.transpose()) * (area / 12.0)
        };
        if self.is_half {
            return of([a, b, c], self.area);
        }
        of([a, b, c], 0.5 * self.area) + of([b + c - a, b, c], 0.5 * self.area)
    }

    /// Where the sample of a number is: a sequence of low discrepancy in the square (Roberts' R2), folded into a triangle.
    fn place(&self, number: usize) -> Vector3 {
        let along = |step: f64| (0.5 + number as f64 * step).fract();
        let (mut x, mut y) = (along(0.754_877_666_246_692_7), along(0.569_840_290_998_053_2));
        if self.is_half && x + y > 1.0 {
            (x, y) = (1.0 - x, 1.0 - y);
        }
        self.corner + self.sides[0] * x + self.sides[1] * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::curvature::tests::sphere;

    fn egg() -> Mesh {
        let mut mesh = sphere(1.0, 3);
        mesh.vertices.iter_mut().for_each(|p| *p = Point3::new(3.0 * p.x + 40.0, 2.0 * p.y, p.z));
        mesh
    }

    #[test]
    fn moments_and_samples_do_not_depend_on_where_vertices_are() {
        let mesh = egg();
        let mut cut = Mesh::default();
        for face in 0..mesh.faces.len() {
            let ([a, b, c], first) = (mesh.corners(face), cut.vertices.len() as u32);
            cut.vertices.extend([a, b, c, nalgebra::center(&b, &c)]);
            cut.faces.extend([[first, first + 1, first + 3], [first + 2, first, first + 3]]);
        }
        let [whole, cut] = [&mesh, &cut].map(|mesh| AreaSamples::of_mesh(mesh, 5000).expect("it has an area"));
        for k in 0..2 {
            assert!((whole.moments[k] - cut.moments[k]).norm() < 1e-12);
        }
        let mean =
            |samples: &AreaSamples| samples.points.iter().map(|p| p.norm()).sum::<f64>() / samples.points.len() as f64;
        assert!((mean(&whole) - 1.0).abs() < 1e-12 && (mean(&cut) - 1.0).abs() < 1e-12);
        let middle: Vector3 = whole.points.iter().sum::<Vector3>() / 5000.0;
        assert!(middle.norm() < 0.01, "{middle}");
    }

    #[test]
    fn samples_go_by_area() {
        // one large triangle, and a hundred that are small
        let mut mesh = Mesh {
            vertices: vec![Point3::origin(), Point3::new(3.0, 0.0, 0.0), Point3::new(0.0, 3.0, 0.0)],
            faces: vec![[0, 1, 2]],
        };
        for k in 0..100 {
            let (first, y) = (mesh.vertices.len() as u32, 0.01 * f64::from(k));
            mesh.vertices.extend([[0.0, y, 1.0], [0.01, y, 1.0], [0.0, y + 0.01, 1.0]].map(Point3::from));
            mesh.faces.push([first, first + 1, first + 2]);
        }
        let samples = AreaSamples::of_mesh(&mesh, 10_000).expect("it has an area");
        let above = samples.points.iter().filter(|p| p.z > samples.points[0].z + 1e-6).count();
        assert!((8..16).contains(&above), "{above}");
    }

    #[test]
    fn without_area_there_are_none() {
        let line =
            Mesh { vertices: (0..3).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect(), faces: vec![[0, 1, 2]; 9] };
        assert!(AreaSamples::of_mesh(&line, 100).is_none() && AreaSamples::of_mesh(&Mesh::default(), 100).is_none());
    }
}
