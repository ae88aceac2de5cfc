//! Writes GLB: one mesh or one cloud, as phones and browsers open it.

use std::fmt::Write;

use super::{BIN, CHUNK_HEAD, HEAD, JSON, MAGIC};
use crate::MeshContent;
use visage_geometry::{Bounds, Cloud, Mesh, Point3, Unit, Vector3};

/// Writes a cloud with its normals, colours and intensities (as `_INTENSITY`). glTF is in metres: coordinates stand as
/// they are, their unit is not known. Those far from the origin are kept exact by the node's translation. The same cloud always gives the same
/// bytes.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    let mut file = File::new(&cloud.points, 0, Unit::Unknown);
    if let Some(normals) = &cloud.normals {
        file.normals(normals.iter().copied(), normals.len());
    }
    if let Some(colors) = &cloud.colors {
        file.colors(colors);
    }
    if let Some(intensities) = &cloud.intensities {
        let bytes = intensities.iter().flat_map(|intensity| intensity.to_le_bytes());
        file.attribute("_INTENSITY", r#""componentType":5126,"type":"SCALAR""#, intensities.len(), bytes);
    }
    file.finish(None)
}

/// Writes a mesh, in the same way.
pub fn write_mesh(mesh: &Mesh) -> Vec<u8> {
    write_content(&mesh.into())
}

/// Writes a mesh with the normals and colours of its vertices, and their support as `_SUPPORT`. Where the unit is known, a scale
/// of the node makes metres of it.
pub(super) fn write_content(content: &MeshContent) -> Vec<u8> {
    let MeshContent { mesh, attributes, unit } = content;
    let mut file = File::new(&mesh.vertices, 4, *unit);
    if let Some(normals) = attributes.normals {
        file.normals(normals.iter().map(|normal| normal.cast()), normals.len());
    }
    if let Some(colors) = attributes.colors {
        file.colors(colors);
    }
    if let Some(support) = attributes.support {
        let bytes = support.iter().flat_map(|support| support.to_le_bytes());
        file.attribute("_SUPPORT", r#""componentType":5126,"type":"SCALAR""#, support.len(), bytes);
    }
    let bytes = mesh.faces.iter().flatten().flat_map(|vertex| vertex.to_le_bytes());
    let indices = file.accessor(r#""componentType":5125,"type":"SCALAR""#, 3 * mesh.faces.len(), bytes);
    file.finish(Some(indices))
}

/// A file while it is written: one node with one primitive.
struct File {
    binary: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
    attributes: Vec<String>,
    origin: Vector3,
    /// Metres in a unit of the coordinates.
    scale: f64,
    mode: u8,
}

impl File {
    fn new(points: &[Point3], mode: u8, unit: Unit) -> Self {
        let scale = unit.in_mm().map_or(1.0, |mm| mm / 1000.0);
        let bounds = Bounds::of(points).unwrap_or(Bounds { min: Point3::origin(), max: Point3::origin() });
        let is_far = bounds.center().coords.amax() > bounds.diagonal();
        let origin = if is_far { bounds.center().coords.map(f64::round) } else { Vector3::zeros() };
        let (views, accessors, attributes) = (Vec::new(), Vec::new(), Vec::new());
        let mut file = File { binary: Vec::new(), views, accessors, attributes, origin, scale, mode };
        let place = |point: &Point3| [point.x - origin.x, point.y - origin.y, point.z - origin.z].map(|x| x as f32);
        let bytes = points.iter().flat_map(|point| place(point).map(f32::to_le_bytes)).flatten();
        let ends = [place(&bounds.min), place(&bounds.max)];
        let kind = format!(r#""componentType":5126,"type":"VEC3","min":{:?},"max":{:?}"#, ends[0], ends[1]);
        file.attribute("POSITION", &kind, points.len(), bytes);
        file
    }

    fn attribute(&mut self, name: &str, kind: &str, count: usize, bytes: impl Iterator<Item = u8>) {
        let index = self.accessor(kind, count, bytes);
        self.attributes.push(format!(r#""{name}":{index}"#));
    }

    fn normals(&mut self, normals: impl Iterator<Item = nalgebra::Vector3<f32>>, count: usize) {
        // a normal that is none would not be of unit length, and rounding leaves some that are not quite
        let unit = |normal: nalgebra::Vector3<f32>| {
            let unit = normal.cast::<f64>().try_normalize(0.0).map_or(nalgebra::Vector3::z(), |unit| unit.cast());
            [unit.x, unit.y, unit.z]
        };
        let bytes = normals.flat_map(|normal| unit(normal).map(f32::to_le_bytes)).flatten();
        self.attribute("NORMAL", r#""componentType":5126,"type":"VEC3""#, count, bytes);
    }

    fn colors(&mut self, colors: &[[u8; 3]]) {
        let bytes = colors.iter().flat_map(|[red, green, blue]| [*red, *green, *blue, 255]);
        self.attribute("COLOR_0", r#""componentType":5121,"normalized":true,"type":"VEC4""#, colors.len(), bytes);
    }

    /// Appends values, and gives the index of their accessor. All have rows of whole words.
    fn accessor(&mut self, kind: &str, count: usize, bytes: impl Iterator<Item = u8>) -> usize {
        let (index, start) = (self.accessors.len(), self.binary.len());
        self.binary.extend(bytes);
        let length = self.binary.len() - start;
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{length}}}"#));
        self.accessors.push(format!(r#"{{"bufferView":{index},"count":{count},{kind}}}"#));
        index
    }

    fn finish(self, indices: Option<usize>) -> Vec<u8> {
        let File { binary, views, accessors, attributes, origin, scale, mode } = self;
        let mut node = r#"{"mesh":0"#.to_owned();
        if scale != 1.0 {
            let _ = write!(node, r#","scale":[{scale},{scale},{scale}]"#);
        }
        if origin != Vector3::zeros() {
            let origin = origin * scale;
            let _ = write!(node, r#","translation":[{},{},{}]"#, origin.x, origin.y, origin.z);
        }
        let indices = indices.map_or(String::new(), |index| format!(r#","indices":{index}"#));
        let mut json = format!(
            r#"{{"asset":{{"version":"2.0","generator":"visage"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{node}}}],"meshes":[{{"primitives":[{{"attributes":{{{}}}{indices},"mode":{mode}}}]}}],"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}]}}"#,
            attributes.join(","),
            binary.len(),
            views.join(","),
            accessors.join(","),
        )
        .into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let length = HEAD + 2 * CHUNK_HEAD + json.len() + binary.len();
        let mut bytes = Vec::with_capacity(length);
        bytes.extend(MAGIC);
        for number in [2, length as u32, json.len() as u32, JSON] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(json);
        for number in [binary.len() as u32, BIN] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(binary);
        bytes
    }
}
