//! Writes 3MF: one mesh, as programs for 3D printing open it.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::MeshContent;
use visage_geometry::Unit;

const TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>
"#;
const RELATIONS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>
"#;

/// Writes a mesh with its colours. A 3MF file has a unit: coordinates of no known unit are called millimetres. The same mesh
/// always gives the same bytes.
pub fn write_mesh(content: &MeshContent) -> Vec<u8> {
    let parts = [("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS), ("3D/3dmodel.model", &model(content))];
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // no time of day: the same mesh gives the same bytes
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).large_file(false);
    for (name, text) in parts {
        let is_large = text.len() as u64 > u64::from(u32::MAX) / 2;
        // memory takes whatever is written
        let written = archive.start_file(name, options.large_file(is_large)).is_ok();
        if !(written && archive.write_all(text.as_bytes()).is_ok()) {
            return Vec::new();
        }
    }
    archive.finish().map(Cursor::into_inner).unwrap_or_default()
}

/// The model as XML.
fn model(content: &MeshContent) -> String {
    let unit = match content.unit {
        Unit::Mm | Unit::Unknown => "millimeter",
        Unit::Cm => "centimeter",
        Unit::M => "meter",
        Unit::In => "inch",
    };
    let mut text = format!(
        concat!(
            r#"<?xml version="1.0" encoding="UTF-8"?>"#,
            "\n",
            r#"<model unit="{}" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" "#,
            r#"xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02">"#,
            "\n<metadata name=\"Application\">visage</metadata>\n<resources>\n"
        ),
        unit
    );
    let palette = content.attributes.colors.map(Palette::new);
    if let Some(palette) = &palette {
        text.push_str("<m:colorgroup id=\"2\">\n");
        for [red, green, blue] in &palette.colors {
            // writing to a string can't fail
            let _ = writeln!(text, "<m:color color=\"#{red:02X}{green:02X}{blue:02X}FF\"/>");
        }
        text.push_str("</m:colorgroup>\n");
    }
    let of_object = if palette.is_some() { " pid=\"2\" pindex=\"0\"" } else { "" };
    let _ = writeln!(text, "<object id=\"1\" type=\"model\"{of_object}><mesh>\n<vertices>");
    for point in &content.mesh.vertices {
        let _ = writeln!(text, "<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>", point.x, point.y, point.z);
    }
    text.push_str("</vertices>\n<triangles>\n");
    for face in &content.mesh.faces {
        let [a, b, c] = face;
        let _ = write!(text, "<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"");
        if let Some(palette) = &palette {
            let [a, b, c] = face.map(|vertex| palette.of_vertices[vertex as usize]);
            let _ = write!(text, " pid=\"2\" p1=\"{a}\" p2=\"{b}\" p3=\"{c}\"");
        }
        text.push_str("/>\n");
    }
    text.push_str("</triangles>\n</mesh></object>\n</resources>\n<build><item objectid=\"1\"/></build>\n</model>\n");
    text
}

/// The colours of vertices, each once.
struct Palette {
    /// In the order in which they come.
    colors: Vec<[u8; 3]>,
    /// For each vertex the place of its colour.
    of_vertices: Vec<u32>,
}

impl Palette {
    fn new(of_vertices: &[[u8; 3]]) -> Palette {
        let (mut colors, mut known) = (Vec::new(), HashMap::new());
        let mut place = |color: &[u8; 3]| {
            *known.entry(*color).or_insert_with(|| {
                colors.push(*color);
                colors.len() as u32 - 1
            })
        };
        let of_vertices = of_vertices.iter().map(&mut place).collect();
        Palette { colors, of_vertices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ply::VertexAttributes;
    use crate::{ReadLimits, read};
    use visage_geometry::{Mesh, Point3};

    #[test]
    fn a_mesh_comes_back_with_its_colours_and_unit() {
        let vertices = vec![
            Point3::new(1.0 / 3.0, -4.5e6, 1e-9),
            Point3::new(1.0, 0.0, 0.5),
            Point3::origin(),
            Point3::new(0.0, 2.0, 0.25),
        ];
        let mesh = Mesh { vertices, faces: vec![[0, 1, 2], [2, 1, 3]] };
        let colors = [[1, 2, 3], [255, 0, 17], [1, 2, 3], [9, 9, 9]];
        let attributes = VertexAttributes { colors: Some(&colors), ..VertexAttributes::default() };
        let content = MeshContent { mesh: &mesh, attributes, unit: Unit::Cm };
        let bytes = write_mesh(&content);
        assert_eq!(bytes, write_mesh(&content));
        let back = read("a.3mf", &bytes, &ReadLimits::default()).expect("own files are read");
        assert_eq!(back.unit.and_then(crate::DeclaredUnit::unit), Some(Unit::Cm));
        assert_eq!(back.surface.mesh(), Some(mesh));
        assert_eq!(back.surface.cloud.colors, Some(colors.to_vec()));
        assert!(back.dropped.is_empty(), "{}", back.dropped);
    }
}
