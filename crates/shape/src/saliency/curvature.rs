//! Mean curvature of a mesh by the cotangent Laplace-Beltrami operator with mixed Voronoi areas
//! (Meyer, Desbrun, Schroder, Barr, "Discrete differential-geometry operators", 2003).

use super::CurvedSurface;
use visage_geometry::{Mesh, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Cotangents beyond this come from needle-shaped faces and carry no shape.
        max_cotangent: f64 = 20.0,
    }
}

/// The vertices of `mesh` with mean curvature l(v) = |Laplace x| / 2, signed: convex positive.
///
/// `side` is 1 if faces wind outward, -1 if inward. The operator is not defined on a rim: vertices of
/// boundary edges keep their place but get no area, so no sum counts their curvature.
pub fn of_mesh(mesh: &Mesh, side: f64) -> CurvedSurface {
    let count = mesh.vertices.len();
    let mut areas = vec![0.0; count];
    let mut laplacians = vec![Vector3::zeros(); count];
    for index in 0..mesh.faces.len() {
        add_face(mesh, index, &mut areas, &mut laplacians);
    }
    let normals: Vec<Vector3> = mesh.vertex_normals().into_iter().map(|n| n * side).collect();
    let mean_curvatures = (0..count)
        .map(|v| if areas[v] > 0.0 { 0.25 * laplacians[v].dot(&normals[v]) / areas[v] } else { 0.0 })
        .collect();
    for [a, b] in boundary_edges(mesh) {
        areas[a as usize] = 0.0;
        areas[b as usize] = 0.0;
    }
    CurvedSurface { points: mesh.vertices.clone(), normals, areas, mean_curvatures }
}

/// Adds a face's share of the mixed areas and of the sums of `(cot alpha + cot beta) (x_i - x_j)`.
fn add_face(mesh: &Mesh, index: usize, areas: &mut [f64], laplacians: &mut [Vector3]) {
    let corners = mesh.corners(index);
    let double_area = mesh.area_normal(index).norm();
    if double_area <= 0.0 {
        return;
    }
    let face = mesh.faces[index].map(|v| v as usize);
    let dots = [0, 1, 2].map(|k| (corners[(k + 1) % 3] - corners[k]).dot(&(corners[(k + 2) % 3] - corners[k])));
    let cotangents = dots.map(|d| (d / double_area).clamp(-TUNING.max_cotangent, TUNING.max_cotangent));
    let obtuse = (0..3).find(|&k| dots[k] < 0.0);
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let edge = corners[i] - corners[j];
        laplacians[face[i]] += cotangents[k] * edge;
        laplacians[face[j]] -= cotangents[k] * edge;
        areas[face[k]] += match obtuse {
            Some(blunt) => 0.5 * double_area * if blunt == k { 0.5 } else { 0.25 },
            None => {
                let to_i = (corners[i] - corners[k]).norm_squared();
                let to_j = (corners[j] - corners[k]).norm_squared();
                0.125 * (to_i * cotangents[j] + to_j * cotangents[i])
            }
        };
    }
}

/// The edges that belong to one face only, as (lower, higher) vertex, in ascending order.
pub fn boundary_edges(mesh: &Mesh) -> Vec<[u32; 2]> {
    let edges = sorted_edges(mesh);
    edges.chunk_by(Edge::is_beside).filter(|group| group.len() == 1).map(|group| group[0].ends()).collect()
}

/// A face's edge: its lower and its higher vertex, and whether the face runs from the lower to the higher. One number, since
/// numbers are sorted faster than lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge(u128);

impl Edge {
    fn new(from: u32, to: u32) -> Edge {
        Edge(u128::from(from.min(to)) << 64 | u128::from(from.max(to)) << 1 | u128::from(from < to))
    }

    fn ends(&self) -> [u32; 2] {
        [(self.0 >> 64) as u32, (self.0 >> 1) as u32]
    }

    /// Whether both lie between the same vertices.
    pub(super) fn is_beside(&self, other: &Edge) -> bool {
        self.0 >> 1 == other.0 >> 1
    }
}

/// The edges of all faces, those between the same vertices side by side, ascending.
pub(super) fn sorted_edges(mesh: &Mesh) -> Vec<Edge> {
    let edges = mesh.faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(|[a, b]| a != b);
    let mut edges: Vec<Edge> = edges.map(|[a, b]| Edge::new(a, b)).collect();
    edges.sort_unstable();
    edges
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use visage_geometry::Point3;

    /// A sphere of radius `radius` around the origin from an octahedron split `levels` times.
    pub(crate) fn sphere(radius: f64, levels: u32) -> Mesh {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let vertices: Vec<Point3> = axes.iter().flat_map(|a| [Point3::from(*a), Point3::from(-a)]).collect();
        let mut faces = Vec::new();
        for octant in 0..8u32 {
            let [x, y, z] = [octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2 & 1)];
            let mirrored = (octant.count_ones() & 1) == 1;
            faces.push(if mirrored { [x, z, y] } else { [x, y, z] });
        }
        let mut mesh = Mesh { vertices, faces };
        for _ in 0..levels {
            mesh = split(&mesh);
        }
        for vertex in &mut mesh.vertices {
            *vertex = Point3::from(vertex.coords.normalize() * radius);
        }
        mesh
    }

    fn split(mesh: &Mesh) -> Mesh {
        let mut vertices = mesh.vertices.clone();
        let mut middles = std::collections::BTreeMap::new();
        let mut faces = Vec::new();
        for &[a, b, c] in &mesh.faces {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    let middle = nalgebra::center(&vertices[p as usize], &vertices[q as usize]);
                    vertices.push(Point3::from(middle.coords.normalize()));
                    vertices.len() as u32 - 1
                })
            });
            faces.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        Mesh { vertices, faces }
    }

    #[test]
    fn a_sphere_has_curvature_one_over_radius_everywhere() {
        let surface = of_mesh(&sphere(4.0, 4), 1.0);
        for l in &surface.mean_curvatures {
            assert!((l - 0.25).abs() < 0.25 * 0.02, "{l}");
        }
        let area: f64 = surface.areas.iter().sum();
        assert!((area / (4.0 * std::f64::consts::PI * 16.0) - 1.0).abs() < 0.01, "{area}");
    }

    #[test]
    fn the_other_side_is_concave() {
        let surface = of_mesh(&sphere(1.0, 2), -1.0);
        assert!(surface.mean_curvatures.iter().all(|l| (l + 1.0).abs() < 0.1));
    }

    #[test]
    fn rim_vertices_count_for_nothing() {
        let mut mesh = sphere(1.0, 3);
        let centers: Vec<f64> = (0..mesh.faces.len()).map(|f| mesh.corners(f).iter().map(|p| p.z).sum()).collect();
        let mut keep = centers.iter().map(|z| *z > 0.0);
        mesh.faces.retain(|_| keep.next().expect("one flag a face"));
        let surface = of_mesh(&mesh, 1.0);
        let rim = boundary_edges(&mesh);
        assert_eq!(rim.len(), 32, "the equator of a three times split octahedron");
        assert!(rim.iter().flatten().all(|&v| surface.areas[v as usize] == 0.0));
        assert!(surface.areas.iter().filter(|a| **a > 0.0).count() > 100);
    }

    #[test]
    fn degenerate_faces_do_no_harm() {
        let mut mesh = sphere(1.0, 2);
        mesh.faces.push([0, 0, 1]);
        mesh.faces.push([3, 3, 3]);
        assert!(of_mesh(&mesh, 1.0).mean_curvatures.iter().all(|l| l.is_finite()));
    }
}
