//! What is written of a mesh.

use crate::ply::VertexAttributes;
use visage_geometry::{Mesh, Unit};

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
