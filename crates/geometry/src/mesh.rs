//! A triangle mesh.

use super::{Bounds, Point3, Vector3};

/// Triangles over shared vertices. Outward winding is the convention, not a promise: files get it wrong.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, in the unit of the file.
    pub vertices: Vec<Point3>,
    /// Triangles as indices into `vertices`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// The box around all vertices, or `None` if there are none.
    #[inline]
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.vertices)
    }

    /// The corners of face `index`.
    #[inline]
    pub fn corners(&self, index: usize) -> [Point3; 3] {
        self.faces[index].map(|v| self.vertices[v as usize])
    }

    /// The normal of face `index` with the length of twice the face's area; zero for a degenerate face.
    #[inline]
    pub fn area_normal(&self, index: usize) -> Vector3 {
        let [a, b, c] = self.corners(index);
        (b - a).cross(&(c - a))
    }

    /// Six times the enclosed volume for a closed mesh: positive when faces wind outward.
    #[inline]
    pub fn signed_volume_6(&self) -> f64 {
        let origin = self.bounds().map_or(Point3::origin(), |b| b.center());
        (0..self.faces.len())
            .map(|f| {
                let [a, b, c] = self.corners(f).map(|p| p - origin);
                a.dot(&b.cross(&c))
            })
            .sum()
    }

    /// Area-weighted unit normals at the vertices; zero where no face with an area meets.
    #[inline]
    pub fn vertex_normals(&self) -> Vec<Vector3> {
        let mut normals = vec![Vector3::zeros(); self.vertices.len()];
        for (index, face) in self.faces.iter().enumerate() {
            let normal = self.area_normal(index);
            for &v in face {
                normals[v as usize] += normal;
            }
        }
        for normal in &mut normals {
            *normal = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
        }
        normals
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh {
            vertices: vec![
                Point3::origin(),
                Point3::new(1.0, 0.0, 0.0),
                Point3::new(0.0, 1.0, 0.0),
                Point3::new(0.0, 0.0, 1.0),
            ],
            faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn outward_winding_gives_a_positive_volume() {
        assert!((tetrahedron().signed_volume_6() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn vertex_normals_point_outward() {
        let mesh = tetrahedron();
        let center = mesh.bounds().expect("four vertices").center();
        for (vertex, normal) in mesh.vertices.iter().zip(mesh.vertex_normals()) {
            assert!((vertex - center).dot(&normal) > 0.0);
            assert!((normal.norm() - 1.0).abs() < 1e-12);
        }
    }
}
