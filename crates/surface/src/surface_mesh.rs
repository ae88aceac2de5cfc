//! A mesh with what is known of its vertices.

use super::reconstruct::Reconstruction;
use visage_geometry::{Mesh, Surface};

/// Triangles, and for each vertex what is known of it. Attributes have the length of the vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceMesh {
    /// The triangles.
    pub mesh: Mesh,
    /// Red, green, blue.
    pub colors: Option<Vec<[u8; 3]>>,
    /// About how many points a vertex is the mean of, 0 where nobody saw it.
    pub support: Option<Vec<f32>>,
}

impl SurfaceMesh {
    /// The triangles of a file, `None` if it has none.
    pub fn of_file(surface: &Surface) -> Option<SurfaceMesh> {
        Some(SurfaceMesh { mesh: surface.mesh()?, colors: surface.cloud.colors.clone(), support: None })
    }

    /// The same with the triangles for which `kept` holds, without vertices that no triangle has.
    pub fn kept(&self, kept: impl Fn(&[u32; 3]) -> bool) -> SurfaceMesh {
        let faces: Vec<[u32; 3]> = self.mesh.faces.iter().copied().filter(kept).collect();
        let mut places = vec![UNUSED; self.mesh.vertices.len()];
        faces.iter().flatten().for_each(|vertex| places[*vertex as usize] = 0);
        let used: Vec<usize> = (0..places.len()).filter(|vertex| places[*vertex] != UNUSED).collect();
        used.iter().zip(0..).for_each(|(vertex, place)| places[*vertex] = place);
        SurfaceMesh {
            mesh: Mesh {
                vertices: used.iter().map(|vertex| self.mesh.vertices[*vertex]).collect(),
                faces: faces.into_iter().map(|face| face.map(|vertex| places[vertex as usize])).collect(),
            },
            colors: self.colors.as_ref().map(|colors| used.iter().map(|vertex| colors[*vertex]).collect()),
            support: self.support.as_ref().map(|support| used.iter().map(|vertex| support[*vertex]).collect()),
        }
    }
}

/// Marks a vertex that no triangle has.
const UNUSED: u32 = u32::MAX;

impl From<Reconstruction> for SurfaceMesh {
    fn from(made: Reconstruction) -> Self {
        SurfaceMesh { mesh: made.mesh, colors: made.colors, support: Some(made.support) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Point3;

    #[test]
    fn vertices_without_a_triangle_go_with_their_attributes() {
        let surface = SurfaceMesh {
            mesh: Mesh {
                vertices: (0..5).map(|x| Point3::new(f64::from(x), 0.0, 0.0)).collect(),
                faces: vec![[0, 1, 2], [2, 3, 4]],
            },
            colors: Some((0..5).map(|red| [red, 0, 0]).collect()),
            support: Some((0..5u8).map(f32::from).collect()),
        };
        let kept = surface.kept(|face| face[0] == 2);
        assert_eq!(kept.mesh.faces, [[0, 1, 2]]);
        assert_eq!(kept.mesh.vertices.iter().map(|p| p.x).collect::<Vec<_>>(), [2.0, 3.0, 4.0]);
        assert_eq!(
            (kept.colors, kept.support),
            (Some(vec![[2, 0, 0], [3, 0, 0], [4, 0, 0]]), Some(vec![2.0, 3.0, 4.0]))
        );
    }
}
