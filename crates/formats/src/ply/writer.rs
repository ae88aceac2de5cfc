//! Clouds and meshes to PLY: binary little-endian, or as text.

use std::io::Write as _;

use crate::MeshContent;
use crate::precision::fits_float;
use visage_geometry::{Cloud, Mesh, Point3, Vector3};

/// Writes a cloud with the attributes it has, and for each point the index of its view if `views` is given.
///
/// Positions are `float`, or `double` where `float` would round them visibly (far from the origin). `views` must
/// have the length of the cloud. The same cloud always gives the same bytes.
pub fn write_cloud(cloud: &Cloud, views: Option<&[u16]>) -> Vec<u8> {
    cloud_as(Encoding::Binary, cloud, views)
}

/// Writes a cloud as text, as exactly as [`write_cloud`] does.
pub fn write_cloud_text(cloud: &Cloud) -> Vec<u8> {
    cloud_as(Encoding::Text, cloud, None)
}

fn cloud_as(encoding: Encoding, cloud: &Cloud, views: Option<&[u16]>) -> Vec<u8> {
    let mut writer = Writer::new(encoding, &cloud.points);
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
    writer.end_header(cloud.len() * 45);
    for (index, point) in cloud.points.iter().enumerate() {
        writer.put_point(point);
        if let Some(normals) = &cloud.normals {
            normals[index].iter().for_each(|x| writer.put_float(*x));
        }
        if let Some(colors) = &cloud.colors {
            colors[index].iter().for_each(|x| writer.put_byte(*x));
        }
        if let Some(intensities) = &cloud.intensities {
            writer.put_float(intensities[index]);
        }
        if let Some(views) = views {
            writer.put_short(views[index]);
        }
        writer.end_row();
    }
    writer.bytes
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
    /// How much a vertex stands out: `saliency`.
    pub saliency: Option<&'a [f32]>,
}

impl<'a> VertexAttributes<'a> {
    /// What is one number a vertex, by the name that it is written under.
    fn figures(&self) -> impl Iterator<Item = (&'static str, &'a [f32])> {
        let named = [("support", self.support), ("deviation", self.deviation), ("saliency", self.saliency)];
        named.into_iter().filter_map(|(name, figures)| Some((name, figures?)))
    }
}

/// Writes a mesh with what is known of its vertices; positions as in [`write_cloud`].
pub(super) fn write_content(content: &MeshContent) -> Vec<u8> {
    write_surface(content.mesh, &content.attributes)
}

/// The same as text.
pub(super) fn write_content_text(content: &MeshContent) -> Vec<u8> {
    surface_as(Encoding::Text, content.mesh, &content.attributes)
}

/// Writes a mesh with attributes of its vertices; positions as in [`write_cloud`].
pub fn write_surface(mesh: &Mesh, attributes: &VertexAttributes) -> Vec<u8> {
    surface_as(Encoding::Binary, mesh, attributes)
}

fn surface_as(encoding: Encoding, mesh: &Mesh, attributes: &VertexAttributes) -> Vec<u8> {
    let mut writer = Writer::new(encoding, &mesh.vertices);
    if attributes.normals.is_some() {
        writer.properties("float", &["nx", "ny", "nz"]);
    }
    if attributes.colors.is_some() {
        writer.properties("uchar", &["red", "green", "blue"]);
    }
    let figures: Vec<_> = attributes.figures().collect();
    for (name, _) in &figures {
        writer.properties("float", &[name]);
    }
    writer.header.push_str(&format!("element face {}\n", mesh.faces.len()));
    writer.header.push_str("property list uchar int vertex_indices\n");
    writer.end_header(mesh.vertices.len() * 43 + mesh.faces.len() * 13);
    for (index, point) in mesh.vertices.iter().enumerate() {
        writer.put_point(point);
        if let Some(normals) = attributes.normals {
            normals[index].iter().for_each(|x| writer.put_float(*x as f32));
        }
        if let Some(colors) = attributes.colors {
            colors[index].iter().for_each(|x| writer.put_byte(*x));
        }
        figures.iter().for_each(|(_, figures)| writer.put_float(figures[index]));
        writer.end_row();
    }
    for face in &mesh.faces {
        writer.put_byte(3);
        face.iter().for_each(|vertex| writer.put_index(*vertex));
        writer.end_row();
    }
    writer.bytes
}

/// How values are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    /// Little-endian.
    Binary,
    /// The shortest numbers that are read back as the same values, a row a line.
    Text,
}

/// Writes the value's bytes, or its digits and a blank.
macro_rules! put {
    ($name:ident, $kind:ty) => {
        fn $name(&mut self, value: $kind) {
            match self.encoding {
                Encoding::Binary => self.bytes.extend(value.to_le_bytes()),
                Encoding::Text => {
                    // writing to memory can't fail
                    let _ = write!(self.bytes, "{value} ");
                }
            }
        }
    };
}

/// The header as it grows, then the rows.
struct Writer {
    encoding: Encoding,
    header: String,
    /// How positions are stored.
    as_float: bool,
    bytes: Vec<u8>,
}

impl Writer {
    /// A header that declares `points` and their positions.
    fn new(encoding: Encoding, points: &[Point3]) -> Self {
        let as_float = fits_float(points);
        let format = match encoding {
            Encoding::Binary => "binary_little_endian",
            Encoding::Text => "ascii",
        };
        let header = format!("ply\nformat {format} 1.0\nelement vertex {}\n", points.len());
        let mut writer = Writer { encoding, header, as_float, bytes: Vec::new() };
        writer.properties(if as_float { "float" } else { "double" }, &["x", "y", "z"]);
        writer
    }

    fn properties(&mut self, scalar: &str, names: &[&str]) {
        for name in names {
            self.header.push_str(&format!("property {scalar} {name}\n"));
        }
    }

    /// Rows come now, about so many bytes.
    fn end_header(&mut self, expected: usize) {
        self.header.push_str("end_header\n");
        self.bytes.reserve(self.header.len() + expected);
        self.bytes.extend(self.header.as_bytes());
    }

    fn put_point(&mut self, point: &Point3) {
        for coordinate in point.iter() {
            if self.as_float {
                self.put_float(*coordinate as f32);
            } else {
                self.put_double(*coordinate);
            }
        }
    }

    put!(put_float, f32);
    put!(put_double, f64);
    put!(put_byte, u8);
    put!(put_short, u16);
    put!(put_index, u32);

    fn end_row(&mut self) {
        if self.encoding == Encoding::Text
            && let Some(blank) = self.bytes.last_mut()
        {
            *blank = b'\n';
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
    fn text_holds_the_same_values() {
        let values: [f64; 5] = [1.0 / 3.0, -1e-9, 4.5e6, 0.0, 123.456];
        let mut cloud = Cloud::from_points(values.map(|x| Point3::new(f64::from(x as f32), 1.0, -x.floor())).to_vec());
        cloud.normals = Some(vec![nalgebra::Vector3::new(0.6, 0.0, 0.8); 5]);
        cloud.colors = Some(vec![[0, 7, 255]; 5]);
        cloud.intensities = Some(vec![0.1, 2e-12, 3e20, -1.0, 0.0]);
        let near = write_cloud_text(&cloud);
        assert!(header_of(&near).starts_with("ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\n"));
        assert!(near.ends_with(b"\n123.456 1 -123 0.6 0 0.8 0 7 255 0\n"), "{}", String::from_utf8_lossy(&near));
        let back = |bytes: &[u8]| ply::read(bytes, &ReadLimits::default()).expect("own files are read").surface;
        let binary = back(&write_cloud(&cloud, None)).cloud;
        for (text, binary) in back(&near).cloud.points.iter().zip(&binary.points) {
            assert_eq!(text.map(|x| x as f32), binary.map(|x| x as f32));
        }
        // what needs doubles is read back to the last bit
        cloud.points = (0..5).map(|k| Point3::new(4.0e5 + f64::from(k) / 3.0, 1.0, 0.0)).collect();
        let far = write_cloud_text(&cloud);
        assert!(header_of(&far).contains("property double x"));
        assert_eq!(back(&far).cloud, cloud);
        let mesh = Mesh { vertices: cloud.points.clone(), faces: vec![[0, 1, 2], [4, 3, 2]] };
        let text = write_content_text(&(&mesh).into());
        assert!(text.ends_with(b"\n3 0 1 2\n3 4 3 2\n"));
        assert_eq!(back(&text).mesh(), Some(mesh));
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
