//! MeshLab's alignments (`.aln`) and projects (`.mlp`): the matrix of each mesh, by the name of its file.

use std::borrow::Cow;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::lines;
use super::text::read_blocks;
use super::{Fault, PoseFile, matrices, rows_of_16};
use crate::quote;
use visage_geometry::Motion;

/// Whether the first line is a count, and a name follows.
pub(super) fn is_aln(text: &str) -> bool {
    let mut lines = lines::data(text).map(|(_, line)| line);
    let is_count = lines.next().is_some_and(lines::is_index);
    is_count && lines.next().is_some_and(|line| lines::count_numbers(line).is_none())
}

/// The count of scans, then for each its name, `#` and 4 rows; at the end `0`.
pub(super) fn read_aln(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile::default();
    let count = lines::data(text).next().and_then(|(_, line)| line.parse::<usize>().ok());
    let count = count.ok_or_else(|| Fault::file("it does not begin with the number of scans"))?;
    let has_end = lines::data(text).last().is_some_and(|(_, line)| line == "0");
    let blocks = lines::data(text).count().saturating_sub(1 + usize::from(has_end));
    read_blocks(lines::data(text).skip(1).take(blocks), &mut file)?;
    if file.poses.len() != count {
        let problem = format!("it declares {count} scans, but holds the poses of {}", file.poses.len());
        return Err(Fault::file(problem));
    }
    Ok(file)
}

/// Writes an alignment; unplaced scans are left out.
pub fn write_aln(poses: &[(String, Option<Motion>)]) -> String {
    let placed: Vec<(&str, &Motion)> = placed(poses).collect();
    let block = |(name, pose): &(&str, &Motion)| format!("{name}\n#\n{}", matrices::write_matrix(pose));
    format!("{}\n{}0\n", placed.len(), placed.iter().map(block).collect::<String>())
}

/// Reads a project.
pub(super) fn read_mlp(text: &str) -> Result<PoseFile, Fault> {
    let mut file = PoseFile::default();
    let mut reader = Reader::from_str(text);
    let mut mesh: Option<Mesh> = None;
    let mut is_matrix = false;
    loop {
        let place = reader.buffer_position();
        let event = reader.read_event().map_err(|error| Fault::xml(reader.error_position(), &error.to_string()))?;
        match event {
            Event::Start(tag) if tag.name().as_ref() == "MLMesh" => mesh = Some(Mesh::of(&tag, place)?),
            Event::Empty(tag) if tag.name().as_ref() == "MLMesh" => Mesh::of(&tag, place)?.push_to(&mut file)?,
            Event::End(tag) if tag.name().as_ref() == "MLMesh" => {
                mesh.take().map_or(Ok(()), |mesh| mesh.push_to(&mut file))?;
            }
            Event::Start(tag) => is_matrix = tag.name().as_ref() == "MLMatrix44",
            Event::End(_) => is_matrix = false,
            Event::Text(text) if is_matrix => {
                if let Some(mesh) = &mut mesh {
                    mesh.matrix = Some(matrix(&mesh.name, &text.into_inner())?);
                }
            }
            Event::Eof if mesh.is_some() || file.poses.is_empty() => {
                let problem = if mesh.is_some() { "it ends within an MLMesh" } else { "it is XML without an MLMesh" };
                return Err(Fault::file(problem));
            }
            Event::Eof => return Ok(file),
            _ => {}
        }
    }
}

impl Fault {
    fn xml(place: u64, problem: &str) -> Fault {
        let remedy = "export the MeshLab project again".to_owned();
        Fault { place: format!("byte {place}"), problem: format!("it is no sound XML: {problem}"), remedy }
    }
}

/// One mesh of a project.
struct Mesh {
    name: String,
    matrix: Option<[[f64; 4]; 4]>,
}

impl Mesh {
    /// By the name of its file; the label is what people see of it.
    fn of(tag: &BytesStart, place: u64) -> Result<Mesh, Fault> {
        let attribute = |name: &str| -> Result<Option<String>, Fault> {
            let found = tag.try_get_attribute(name).map_err(|error| Fault::xml(place, &error.to_string()))?;
            let value = found.map(|found| found.normalized_value(XmlVersion::default()).map(Cow::into_owned));
            value.transpose().map_err(|error| Fault::xml(place, &error.to_string()))
        };
        let named = attribute("filename")?.filter(|name| !name.is_empty());
        let name = if named.is_some() { named } else { attribute("label")? };
        let name = name.ok_or_else(|| Fault::xml(place, "an MLMesh has neither filename nor label"))?;
        Ok(Mesh { name, matrix: None })
    }

    /// A mesh that was never moved may have no matrix.
    fn push_to(self, file: &mut PoseFile) -> Result<(), Fault> {
        let identity = visage_geometry::se3::to_rows(&Motion::identity());
        file.push_matrix(&self.name, self.matrix.unwrap_or(identity))
    }
}

fn matrix(name: &str, text: &str) -> Result<[[f64; 4]; 4], Fault> {
    let numbers = lines::numbers(text).map(|numbers| rows_of_16(&numbers));
    numbers.ok_or_else(|| {
        Fault::scan(name, format!("its MLMatrix44, {}, is not 16 numbers", quote(text.trim().as_bytes())))
    })
}

/// Writes a project; unplaced scans are left out.
pub fn write_mlp(poses: &[(String, Option<Motion>)]) -> String {
    let mut text = "<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n <MeshGroup>\n".to_owned();
    for (name, pose) in placed(poses) {
        let name = quick_xml::escape::escape(name);
        let matrix = matrices::write_matrix(pose);
        text.push_str(&format!(
            "  <MLMesh label=\"{name}\" filename=\"{name}\">\n   <MLMatrix44>\n{matrix}</MLMatrix44>\n  </MLMesh>\n"
        ));
    }
    text.push_str(" </MeshGroup>\n</MeshLabProject>\n");
    text
}

fn placed(poses: &[(String, Option<Motion>)]) -> impl Iterator<Item = (&str, &Motion)> {
    poses.iter().filter_map(|(name, pose)| Some((name.as_str(), pose.as_ref()?)))
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;

    fn poses() -> Vec<(String, Option<Motion>)> {
        vec![
            ("a & \"b\".ply".into(), Some(Motion::translation(4.0, 5.0, 6.0))),
            ("lost.ply".into(), None),
            ("c.ply".into(), Some(Motion::identity())),
        ]
    }

    #[test]
    fn what_is_written_is_read() {
        for (text, kind) in [(write_aln(&poses()), "MeshLab alignment"), (write_mlp(&poses()), "MeshLab project")] {
            let file = read("p", text.as_bytes()).expect(kind);
            let placed: Vec<_> = poses().into_iter().filter_map(|(name, pose)| Some((name, pose?))).collect();
            assert_eq!((file.kind, &file.poses), (kind, &placed), "{text}");
        }
    }

    #[test]
    fn projects_as_programs_write_them_are_read() {
        let text = "\u{feff}<?xml version=\"1.0\"?>\n<!DOCTYPE MeshLabDocument>\n<MeshLabProject><MeshGroup>\
            <MLMesh filename=\"C:\\x\\a.ply\" label=\"a\"><MLMatrix44>1 0 0 4 \n0 1 0 5 \n0 0 1 6 \n0 0 0 1 \n</MLMatrix44>\
            <RenderingOption>100</RenderingOption></MLMesh><MLMesh label=\"b.ply\" filename=\"\"/></MeshGroup>\
            <RasterGroup><MLRaster label=\"r.jpg\"><Plane fileName=\"r.jpg\"/></MLRaster></RasterGroup></MeshLabProject>";
        let file = read("a.mlp", text.as_bytes()).expect("sound");
        let [(a, pose), (b, unmoved)] = file.poses.as_slice() else { panic!("two meshes") };
        assert_eq!((a.as_str(), b.as_str()), ("C:\\x\\a.ply", "b.ply"));
        assert_eq!((*pose, *unmoved), (Motion::translation(4.0, 5.0, 6.0), Motion::identity()));
    }

    #[test]
    fn broken_files_are_refused() {
        let rows = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let problem = |text: &str| read("p", text.as_bytes()).expect_err(text).to_string();
        assert!(problem(&format!("2\na.ply\n#\n{rows}0\n")).contains("it declares 2 scans, but holds the poses of 1"));
        assert!(problem("<a/>").contains("it is XML without an MLMesh"));
        assert!(problem("<MLMesh filename=\"a\"><MLMatrix44>1 2</MLMatrix44></MLMesh>").contains("is not 16 numbers"));
        assert!(problem("<MLMesh/>").contains("neither filename nor label"));
        assert!(problem("<MLMesh filename=\"a\"></x>").contains("it is no sound XML"));
    }

    #[test]
    fn entities_are_not_expanded_and_depth_costs_nothing() {
        let bomb = "<!DOCTYPE d [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><MLMesh filename=\"&b;\"/>";
        assert!(read("p", bomb.as_bytes()).expect_err("an entity").to_string().contains("it is no sound XML"));
        let deep = "<a>".repeat(100_000);
        assert!(read("p", deep.as_bytes()).is_err());
        let many = format!("<MLMesh filename=\"a\"><MLMatrix44>{}</MLMatrix44></MLMesh>", "0 ".repeat(100_000));
        assert!(read("p", many.as_bytes()).is_err());
    }
}
