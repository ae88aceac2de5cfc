//! What is written of a mesh.

use crate::ply::VertexAttributes;
use visage_geometry::{Mesh, Surface, Unit, Vector3};

/// A mesh with what is known of its vertices, as writers take it. Each writes what its format can hold.
#[derive(Debug, Clone, Copy)]
pub struct MeshContent<'a> {
    /// The triangles.
    pub mesh: &'a Mesh,
    /// What is known of the vertices.
    pub attributes: VertexAttributes<'a>,
    /// The unit of the coordinates.
    pub unit: Unit,
}

impl<'a> From<&'a Mesh> for MeshContent<'a> {
    /// Bare triangles of no known unit.
    fn from(mesh: &'a Mesh) -> Self {
        MeshContent { mesh, attributes: VertexAttributes::default(), unit: Unit::Unknown }
    }
}

/// Writes a mesh.
pub type MeshWriter = fn(&MeshContent) -> Vec<u8>;

/// Writes the mesh of a surface with the normals and colours of its points; `None` if it has no triangles.
pub fn write_mesh_of(surface: &Surface, unit: Unit, write: MeshWriter) -> Option<Vec<u8>> {
    let mesh = surface.mesh()?;
    let normals: Option<Vec<Vector3>> =
        surface.cloud.normals.as_ref().map(|normals| normals.iter().map(|normal| normal.cast()).collect());
    let colors = surface.cloud.colors.as_deref();
    let attributes = VertexAttributes { normals: normals.as_deref(), colors, ..VertexAttributes::default() };
    Some(write(&MeshContent { mesh: &mesh, attributes, unit }))
}
