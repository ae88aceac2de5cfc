//! What this program writes of the points of its own files beside what scans have: of which scan a point is, and how much stands for
//! it.

use super::header::{Encoding, Header, Kind, ScalarType};
use crate::text_start;

/// The property `view` of the vertices of a binary little-endian file; `None` if it has none, or is not whole.
pub fn views(bytes: &[u8]) -> Option<Vec<u16>> {
    column(bytes, "view", ScalarType::U16, u16::from_le_bytes)
}

/// The property `support` of the vertices, likewise.
pub fn support(bytes: &[u8]) -> Option<Vec<f32>> {
    column(bytes, "support", ScalarType::F32, f32::from_le_bytes)
}

fn column<T, const SIZE: usize>(
    bytes: &[u8],
    name: &str,
    wanted: ScalarType,
    value: fn([u8; SIZE]) -> T,
) -> Option<Vec<T>> {
    let header = Header::parse(bytes, text_start(bytes).ok()?).ok()?;
    let vertices = header.elements.first().filter(|element| element.name == "vertex")?;
    if header.encoding != Encoding::LittleEndian {
        return None;
    }
    let (mut row, mut place) = (0, None);
    for property in &vertices.properties {
        let Kind::Scalar(scalar) = property.kind else { return None };
        if property.name == name && scalar == wanted {
            place = Some(row);
        }
        row += scalar.size();
    }
    let place = place?;
    let length = usize::try_from(vertices.count).ok()?.checked_mul(row)?;
    let body = bytes.get(header.body_start..header.body_start.checked_add(length)?)?;
    let read = |row: &[u8]| Some(value(row.get(place..place + SIZE)?.try_into().ok()?));
    body.chunks_exact(row).map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ply::{VertexAttributes, write_cloud, write_mesh, write_surface};
    use visage_geometry::{Cloud, Mesh, Point3};

    #[test]
    fn views_come_back_and_what_is_cut_short_has_none() {
        let cloud = Cloud::from_points(vec![Point3::origin(), Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 0.0, 0.0)]);
        let bytes = write_cloud(&cloud, Some(&[7, 0, 513]));
        assert_eq!(views(&bytes), Some(vec![7, 0, 513]));
        assert_eq!(views(&bytes[..bytes.len() - 1]), None);
        assert_eq!(views(&write_cloud(&cloud, None)), None);
        assert_eq!(views(&write_mesh(&Mesh { vertices: cloud.points, faces: vec![[0, 1, 2]] })), None);
        assert_eq!(views(b"ply\nformat ascii 1.0\nelement vertex 1\nproperty ushort view\nend_header\n3\n"), None);
        assert_eq!(views(b"no ply"), None);
    }

    #[test]
    fn support_comes_back() {
        let mesh = Mesh { vertices: vec![Point3::origin(); 3], faces: vec![[0, 1, 2]] };
        let attributes = VertexAttributes { support: Some(&[0.0, 2.5, 7.0]), ..VertexAttributes::default() };
        let bytes = write_surface(&mesh, &attributes);
        assert_eq!(support(&bytes), Some(vec![0.0, 2.5, 7.0]));
        assert_eq!(support(&write_mesh(&mesh)), None);
    }
}
