//! Which side of a surface is outside: from the volume of a closed mesh, from a cloud's own normals, from the
//! scanner's place, or left open.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::curvature::sorted_edges;
use super::proximity::Proximity;
use super::samples::Samples;
use crate::geometry::normals::least_spread;
use crate::geometry::{Mesh, Point3, Surface, Vector3};

/// What is known of the outer side of a surface with consistent normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The normals point outward.
    Outward,
    /// They point inward, all of them.
    Inward,
    /// They agree with each other, but no one knows which side is outside: try both.
    Unknown,
}

impl Side {
    /// The factors to try that turn normals outward.
    pub fn signs(self) -> &'static [f64] {
        match self {
            Side::Outward => &[1.0],
            Side::Inward => &[-1.0],
            Side::Unknown => &[1.0, -1.0],
        }
    }

    /// The likeliest factor.
    pub fn first_sign(self) -> f64 {
        self.signs()[0]
    }
}

/// A mesh is taken as closed if at most this share of its edges is open or runs the wrong way: scanned and
/// decimated models have a few such edges, one that misses a neck has more.
const CLOSED_TOLERANCE: f64 = 1e-3;

/// The outer side of a mesh: by the sign of its volume if it is closed, else unknown.
pub fn side_of_mesh(mesh: &Mesh) -> Side {
    let edges = sorted_edges(mesh);
    let (mut count, mut sound) = (0usize, 0usize);
    for group in edges.chunk_by(|a, b| a[..2] == b[..2]) {
        count += 1;
        sound += usize::from(group.len() == 2 && group[0][2] != group[1][2]);
    }
    let closed = count > 0 && (count - sound) as f64 <= CLOSED_TOLERANCE * count as f64;
    match mesh.signed_volume_6() {
        volume if closed && volume > 0.0 => Side::Outward,
        volume if closed && volume < 0.0 => Side::Inward,
        _ => Side::Unknown,
    }
}

/// A cloud with unit normals, what is known of their side, and its neighbours.
#[derive(Debug, Clone)]
pub struct OrientedCloud {
    /// Positions, thinned.
    pub points: Vec<Point3>,
    /// Unit normals; zero where the neighbours tell none.
    pub normals: Vec<Vector3>,
    /// Which side they point to.
    pub side: Side,
    /// Each point's neighbours.
    pub proximity: Proximity,
}

/// A bare cloud thinned to cells of edge `cell`, with unit normals. Its own normals are outward by the convention of
/// this program; without them normals are estimated from the neighbours, and turned towards the scanner if its place
/// is known.
pub fn oriented_cloud(surface: &Surface, cell: f64) -> OrientedCloud {
    if let Some(normals) = &surface.cloud.normals {
        let unit = |n: &nalgebra::Vector3<f32>| n.cast::<f64>().try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
        let normals: Vec<Vector3> = normals.iter().map(unit).collect();
        let Samples { points, normals, .. } = Samples::from_cloud(&surface.cloud.points, &normals, cell);
        let proximity = Proximity::new(&points);
        return OrientedCloud { points, normals, side: Side::Outward, proximity };
    }
    let same_side = vec![Vector3::z(); surface.cloud.len()];
    let points = Samples::from_cloud(&surface.cloud.points, &same_side, cell).points;
    let proximity = Proximity::new(&points);
    let mut normals = plane_normals(&points, &proximity);
    let Some(sensor) = surface.sensor else {
        make_consistent(&points, &proximity, &mut normals);
        return OrientedCloud { points, normals, side: Side::Unknown, proximity };
    };
    for (point, normal) in points.iter().zip(&mut normals) {
        if normal.dot(&(sensor - point)) < 0.0 {
            *normal = -*normal;
        }
    }
    OrientedCloud { points, normals, side: Side::Outward, proximity }
}

/// Normals of the planes fitted to the neighbours; either sign. Zero with too few neighbours.
fn plane_normals(points: &[Point3], proximity: &Proximity) -> Vec<Vector3> {
    (0..points.len())
        .into_par_iter()
        .map(|index| {
            let (mut sum, mut squares, mut count) = (Vector3::zeros(), nalgebra::Matrix3::zeros(), 0.0);
            for other in proximity.of(index) {
                let offset = points[other] - points[index];
                sum += offset;
                squares += offset * offset.transpose();
                count += 1.0;
            }
            if count < 4.0 {
                return Vector3::zeros();
            }
            least_spread(&(squares - sum * sum.transpose() / count)).0
        })
        .collect()
}

/// Turns normals so that neighbours agree, along the minimum spanning tree of the neighbour graph (Hoppe et al., 1992).
/// Each component starts at its highest point, turned up.
///
/// Neighbours agree as on a circular arc: the normal of one, mirrored at the plane that bisects their connection, is
/// the other's. So a bend as sharp as a nose is passed even where points are sparse, and the two sides of a thin wall
/// look away from each other (after Konig and Gumhold, 2009). An edge costs `1 - |agreement|`.
fn make_consistent(points: &[Point3], proximity: &Proximity, normals: &mut [Vector3]) {
    let listed_by = proximity.reversed();
    let mut by_height: Vec<usize> = (0..points.len()).collect();
    by_height.sort_by(|&a, &b| points[b].z.total_cmp(&points[a].z).then(a.cmp(&b)));
    let mut done = vec![false; points.len()];
    let mut heap: BinaryHeap<Reverse<(u64, u32, u32)>> = BinaryHeap::new();
    for start in by_height {
        if done[start] {
            continue;
        }
        if normals[start].z < 0.0 {
            normals[start] = -normals[start];
        }
        heap.push(Reverse((0, start as u32, start as u32)));
        while let Some(Reverse((_, point, from))) = heap.pop() {
            let (point, from) = (point as usize, from as usize);
            if std::mem::replace(&mut done[point], true) {
                continue;
            }
            if agreement(points, normals, from, point) < 0.0 {
                normals[point] = -normals[point];
            }
            for other in proximity.of(point).chain(listed_by.of(point)).filter(|&other| !done[other]) {
                let cost = (1.0 - agreement(points, normals, point, other).abs()).max(0.0);
                // bits of a non-negative float order as the float does
                heap.push(Reverse((cost.to_bits(), other as u32, point as u32)));
            }
        }
    }
}

/// The cosine between the normal of one point, mirrored to the place of the other, and the other's.
fn agreement(points: &[Point3], normals: &[Vector3], from: usize, to: usize) -> f64 {
    let along = (points[to] - points[from]).try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
    let mirrored = normals[from] - along * (2.0 * along.dot(&normals[from]));
    mirrored.dot(&normals[to])
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;
    use crate::geometry::Cloud;

    #[test]
    fn closed_meshes_tell_their_side_and_open_ones_do_not() {
        let mut mesh = sphere(1.0, 3);
        assert_eq!(side_of_mesh(&mesh), Side::Outward);
        for face in &mut mesh.faces {
            face.swap(1, 2);
        }
        assert_eq!(side_of_mesh(&mesh), Side::Inward);
        mesh.faces.truncate(300);
        assert_eq!(side_of_mesh(&mesh), Side::Unknown);
        assert_eq!(side_of_mesh(&Mesh::default()), Side::Unknown);
    }

    #[test]
    fn estimated_normals_of_a_sphere_agree() {
        let cloud = Cloud::from_points(sphere(1.0, 4).vertices);
        let OrientedCloud { points, normals, side, .. } =
            oriented_cloud(&Surface { cloud, ..Surface::default() }, 0.05);
        assert_eq!(side, Side::Unknown);
        assert!(normals.iter().zip(&points).all(|(n, p)| n.dot(&p.coords) > 0.95), "highest point turned up");
    }

    #[test]
    fn a_known_scanner_settles_the_side() {
        let points = sphere(1.0, 4).vertices.into_iter().filter(|p| p.x > 0.4).collect();
        let sensor = Some(Point3::new(5.0, 0.0, 0.0));
        let surface = Surface { cloud: Cloud::from_points(points), sensor, ..Surface::default() };
        let OrientedCloud { points, normals, side, .. } = oriented_cloud(&surface, 0.05);
        assert_eq!(side, Side::Outward);
        assert!(normals.iter().zip(&points).all(|(n, p)| n.dot(&p.coords) > 0.9));
    }

    #[test]
    fn own_normals_are_believed() {
        let mut cloud = Cloud::from_points(vec![Point3::origin()]);
        cloud.normals = Some(vec![nalgebra::Vector3::new(0.0, 0.0, 2.0)]);
        let OrientedCloud { normals, side, .. } = oriented_cloud(&Surface { cloud, ..Surface::default() }, 1.0);
        assert_eq!((normals[0], side), (Vector3::z(), Side::Outward));
    }
}
