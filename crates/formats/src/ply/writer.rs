//! Clouds and meshes to binary little-endian PLY.

use crate::MeshContent;
use crate::precision::fits_float;
use visage_geometry::{Cloud, Mesh, Point3, Vector3};

/// Writes a cloud with the attributes it has, and for each point the index of its view if `views` is given.
///
/// Positions are `float`, or `double` where `float` would round them visibly (far from the origin). `views` must
/// have the length of the cloud. The same cloud always gives the same bytes.
pub fn write_cloud(cloud: &Cloud, views: Option<&[u16]>) -> Vec<u8> {
    let mut writer = Writer::new(&cloud.points);
    if cloud.normals.is_some() {
        writer.properties("float", &["nx", "ny", "nz"]);
    }
    if cloud.colors.is_some() {
        writer.properties("uchar", &["red", "green", "blue"]);
    }
    if cloud.intensities.is_some() {
        writer.properties("float", &["intensity"]);
    }
    if views.is_some() {
        writer.properties("ushort", &["view"]);
    }
    let mut bytes = writer.end_header();
    bytes.reserve(cloud.len() * 45);
    for (index, point) in cloud.points.iter().enumerate() {
        writer.put_point(&mut bytes, point);
        if let Some(normals) = &cloud.normals {
            normals[index].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        }
        if let Some(colors) = &cloud.colors {
            bytes.extend(colors[index]);
        }
        if let Some(intensities) = &cloud.intensities {
            bytes.extend(intensities[index].to_le_bytes());
        }
        if let Some(views) = views {
            bytes.extend(views[index].to_le_bytes());
        }
    }
    bytes
}

/// Writes a mesh; positions as in [`write_cloud`].
pub fn write_mesh(mesh: &Mesh) -> Vec<u8> {
    write_surface(mesh, &VertexAttributes::default())
}

/// What is written of the vertices of a mesh beside their positions; each of the length of the vertices.
#[derive(Debug, Clone, Copy, Default)]
pub struct VertexAttributes<'a> {
    /// Outward unit normals: `nx ny nz`.
    pub normals: Option<&'a [Vector3]>,
    /// `red green blue`.
    pub colors: Option<&'a [[u8; 3]]>,
    /// How much data stands for a vertex: `support`, 0 where nobody saw it.
    pub support: Option<&'a [f32]>,
    /// How far a vertex is from something: `deviation`.
    pub deviation: Option<&'a [f32]>,
}

/// Writes a mesh with what is known of its vertices; positions as in [`write_cloud`].
pub(super) fn write_content(content: &MeshContent) -> Vec<u8> {
    write_surface(content.mesh, &content.attributes)
}

/// Writes a mesh with attributes of its vertices; positions as in [`write_cloud`].
pub fn write_surface(mesh: &Mesh, attributes: &VertexAttributes) -> Vec<u8> {
    let mut writer = Writer::new(&mesh.vertices);
    if attributes.normals.is_some() {
        writer.properties("float", &["nx", "ny", "nz"]);
    }
    if attributes.colors.is_some() {
        writer.properties("uchar", &["red", "green", "blue"]);
    }
    if attributes.support.is_some() {
        writer.properties("float", &["support"]);
    }
    if attributes.deviation.is_some() {
        writer.properties("float", &["deviation"]);
    }
    writer.header.push_str(&format!("element face {}\n", mesh.faces.len()));
    writer.header.push_str("property list uchar int vertex_indices\n");
    let mut bytes = writer.end_header();
    bytes.reserve(mesh.vertices.len() * 43 + mesh.faces.len() * 13);
    for (index, point) in mesh.vertices.iter().enumerate() {
        writer.put_point(&mut bytes, point);
        if let Some(normals) = attributes.normals {
            normals[index].iter().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        }
        if let Some(colors) = attributes.colors {
            bytes.extend(colors[index]);
        }
        if let Some(support) = attributes.support {
            bytes.extend(support[index].to_le_bytes());
        }
        if let Some(deviation) = attributes.deviation {
            bytes.extend(deviation[index].to_le_bytes());
        }
    }
    for face in &mesh.faces {
        bytes.push(3);
        face.iter().for_each(|vertex| bytes.extend(vertex.to_le_bytes()));
    }
    bytes
}

/// The header as it grows, and how positions are stored.
struct Writer {
    header: String,
    as_float: bool,
}

impl Writer {
    /// A header that declares `points` and their positions.
    fn new(points: &[Point3]) -> Self {
        let as_float = fits_float(points);
        let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.len());
        let mut writer = Writer { header, as_float };
        writer.properties(if as_float { "float" } else { "double" }, &["x", "y", "z"]);
        writer
    }

    fn properties(&mut self, scalar: &str, names: &[&str]) {
        for name in names {
            self.header.push_str(&format!("property {scalar} {name}\n"));
        }
    }

    fn end_header(&mut self) -> Vec<u8> {
        self.header.push_str("end_header\n");
        self.header.as_bytes().to_vec()
    }

    fn put_point(&self, bytes: &mut Vec<u8>, point: &Point3) {
        for coordinate in point.iter() {
            if self.as_float {
                bytes.extend((*coordinate as f32).to_le_bytes());
            } else {
                bytes.extend(coordinate.to_le_bytes());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadLimits, ply};

    fn header_of(bytes: &[u8]) -> String {
        let text = String::from_utf8_lossy(bytes);
        text.split("end_header").next().unwrap_or_default().to_owned()
    }

    #[test]
    fn far_from_the_origin_positions_are_double() {
        let near = Cloud::from_points(vec![Point3::new(0.1, 0.2, 0.3), Point3::new(1.0, 1.0, 1.0)]);
        assert!(header_of(&write_cloud(&near, None)).contains("property float x"));
        let mut far = near.clone();
        far.points.iter_mut().for_each(|p| p.x += 4.0e5);
        let bytes = write_cloud(&far, None);
        assert!(header_of(&bytes).contains("property double x"));
        let back = ply::read(&bytes, &ReadLimits::default()).expect("own files are read").surface;
        assert_eq!(back.cloud, far);
    }

    #[test]
    fn attributes_and_views_are_written_where_present() {
        let cloud = Cloud {
            points: vec![Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 2.0, 3.0)],
            normals: Some(vec![nalgebra::Vector3::x(), nalgebra::Vector3::y()]),
            colors: Some(vec![[1, 2, 3], [4, 5, 255]]),
            intensities: Some(vec![0.5, 100.0]),
        };
        let bytes = write_cloud(&cloud, Some(&[0, 513]));
        assert!(header_of(&bytes).ends_with("property float intensity\nproperty ushort view\n"));
        assert_eq!(&bytes[bytes.len() - 2..], &513u16.to_le_bytes());
        let back = ply::read(&bytes, &ReadLimits::default()).expect("own files are read").surface;
        assert_eq!(back.cloud, cloud);
    }

    #[test]
    fn a_mesh_comes_back() {
        let mesh = Mesh {
            vertices: vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.25)],
            faces: vec![[0, 1, 2], [2, 1, 0]],
        };
        let back = ply::read(&write_mesh(&mesh), &ReadLimits::default()).expect("own files are read").surface;
        assert_eq!(back.mesh(), Some(mesh));
    }
    #[test]
    fn a_mesh_is_written_with_what_is_known_of_its_vertices() {
        let mesh = Mesh {
            vertices: vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)],
            faces: vec![[0, 1, 2]],
        };
        let (normals, colors) = (mesh.vertex_normals(), [[1, 2, 3], [4, 5, 6], [7, 8, 255]]);
        let attributes = VertexAttributes {
            normals: Some(&normals),
            colors: Some(&colors),
            support: Some(&[0.0, 1.5, 2.0]),
            ..VertexAttributes::default()
        };
        let bytes = write_surface(&mesh, &attributes);
        assert!(header_of(&bytes).contains("property uchar blue\nproperty float support\nelement face 1\n"));
        // the support of the last vertex stands before the only face
        assert_eq!(bytes[bytes.len() - 17..bytes.len() - 13], 2.0f32.to_le_bytes());
        let back = ply::read(&bytes, &ReadLimits::default()).expect("own files are read").surface;
        assert_eq!(back.cloud.normals, Some(vec![nalgebra::Vector3::z(); 3]));
        assert_eq!(back.cloud.colors, Some(colors.to_vec()));
        assert_eq!(back.mesh(), Some(mesh));
    }
}
