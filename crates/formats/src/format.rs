//! What there is to know of a file format: everything that lists formats, or chooses one, asks [`FORMATS`].

use std::fmt;

use super::poses::PoseFile;
use super::{FORMATS, FormatError, MeshWriter, ReadLimits, Reading, ScanReading, extension, packed};
use visage_geometry::{Cloud, Motion};

/// The media type of scans and models. They are sent as bytes, also where a type is registered: an operation has one
/// media type, and generated clients take `model/...` for JSON.
pub(super) const BYTES: &str = "application/octet-stream";

/// A file format, and what it is read and written by.
pub struct Format {
    /// What people call it: `PLY`.
    pub name: &'static str,
    /// How the names of its files end: lower case, no dot, the one that is written first.
    pub endings: &'static [&'static str],
    /// The media type that its files are sent as.
    pub media_type: &'static str,
    /// What its files can hold, as far as it is read.
    pub holds: &'static [Content],
    /// What reads it.
    pub reader: Reader,
    /// What writes it.
    pub writers: Writers,
}

/// What a file can hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Points of a surface.
    Points,
    /// Triangles.
    Mesh,
    /// Normals of the points.
    Normals,
    /// Colours of the points.
    Colors,
    /// Intensities of the points.
    Intensities,
    /// The grid of an organised scan.
    Grid,
    /// Where the scanner stood.
    Sensor,
    /// Where each of several scans is, by name.
    Poses,
}

impl Content {
    /// In words, for lists.
    pub fn name(self) -> &'static str {
        match self {
            Content::Points => "points",
            Content::Mesh => "mesh",
            Content::Normals => "normals",
            Content::Colors => "colours",
            Content::Intensities => "intensities",
            Content::Grid => "range grid",
            Content::Sensor => "place of the scanner",
            Content::Poses => "poses",
        }
    }
}

/// Reads a scan or a model, and says what of it was not taken.
pub type SurfaceReader = fn(&[u8], &ReadLimits) -> Result<Reading, FormatError>;

/// Reads the scans of a file that may hold several.
pub type ScansReader = fn(&[u8], &ReadLimits) -> Result<Vec<ScanReading>, FormatError>;

/// Reads the bytes of a file.
#[derive(Clone, Copy)]
pub enum Reader {
    /// A scan or a model.
    Surface(SurfaceReader),
    /// Scans, each with its place among the others.
    Scans(ScansReader),
    /// Poses by scan name; the name of the file serves messages.
    Poses(fn(&str, &[u8]) -> Result<PoseFile, FormatError>),
}

/// Writes poses by scan name.
pub type PoseWriter = fn(&[(String, Option<Motion>)]) -> String;

/// Writes the bytes of a file; the same values always give the same bytes.
#[derive(Clone, Copy)]
pub struct Writers {
    /// A cloud with all its attributes.
    pub cloud: Option<fn(&Cloud) -> Vec<u8>>,
    /// A mesh with what is known of its vertices.
    pub mesh: Option<MeshWriter>,
    /// Poses by scan name, `None` for a scan without a place.
    pub poses: Option<PoseWriter>,
    /// The same as text, where the others write binary files of a format that knows both.
    pub text: Option<TextWriters>,
}

/// Writes files as text that are binary otherwise.
#[derive(Clone, Copy)]
pub struct TextWriters {
    /// A cloud with all its attributes.
    pub cloud: fn(&Cloud) -> Vec<u8>,
    /// A mesh with what is known of its vertices.
    pub mesh: MeshWriter,
}

impl Writers {
    /// For a format that is only read.
    pub const NONE: Writers = Writers { cloud: None, mesh: None, poses: None, text: None };

    /// Whether anything is written in the format.
    pub fn any(&self) -> bool {
        self.cloud.is_some() || self.mesh.is_some() || self.poses.is_some()
    }

    /// The same, writing text.
    ///
    /// # Errors
    /// The names of the formats that can be told to, if this one can't.
    pub fn as_text(self) -> Result<Writers, String> {
        match self.text {
            Some(TextWriters { cloud, mesh }) => Ok(Writers { cloud: Some(cloud), mesh: Some(mesh), ..self }),
            None => {
                let able = FORMATS.iter().filter(|format| format.writers.text.is_some());
                Err(able.map(|format| format.name).collect::<Vec<_>>().join(", "))
            }
        }
    }
}

impl Format {
    /// The format of files that end like this (lower case, no dot).
    pub fn of_ending(ending: &str) -> Option<&'static Format> {
        FORMATS.iter().copied().find(|format| format.endings.contains(&ending))
    }

    /// The formats of scans and models, in the order in which people read about them.
    pub fn surfaces() -> impl Iterator<Item = &'static Format> + Clone {
        FORMATS.iter().copied().filter(|format| format.is_surface())
    }

    /// Whether its files are scans or models.
    pub fn is_surface(&self) -> bool {
        matches!(self.reader, Reader::Surface(_) | Reader::Scans(_))
    }

    /// Whether files of this format are in a frame that they share by its definition, that of the land and not of a scanner.
    pub fn shares_frame(&self) -> bool {
        [&super::las::LAS, &super::las::LAZ].contains(&self)
    }

    /// The ending that is written.
    pub fn ending(&self) -> &'static str {
        self.endings.first().copied().unwrap_or_default()
    }
}

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Format {}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Endings that files of all kinds have: tables, notes, arrays.
const COMMON: &[&str] = &["asc", "bin", "csv", "npy", "npz", "txt"];

/// Whether a file of this name may well be no scan although its ending is that of a format: where scans are looked for,
/// rather than named, those of other formats come first.
pub fn is_common(name: &str) -> bool {
    COMMON.contains(&&*extension(packed::inner_name(name).unwrap_or(name)))
}

/// Which of the files of a folder are scans, by their names: hidden ones are none, such as the `._scan.ply` that a Mac leaves
/// beside a scan, and files that may be anything (`.csv`) are some where there is nothing better.
pub fn scan_files(names: &[&str]) -> Vec<bool> {
    let is_hidden = |name: &str| name.split('/').any(|part| part.starts_with('.'));
    let may_be = |name: &str| super::check_name(name).is_ok() && !is_hidden(name);
    let has_sure = names.iter().any(|name| may_be(name) && !is_common(name));
    names.iter().map(|name| may_be(name) && (!has_sure || !is_common(name))).collect()
}

/// Identity poses for the scans whose formats share one frame by definition (map coordinates, for example). None if there is only one
/// such scan.
pub fn shared_frame<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<(String, Motion)> {
    let is_shared = |name: &&str| super::check_name(name).is_ok_and(Format::shares_frame);
    let shared: Vec<&str> = names.into_iter().filter(is_shared).collect();
    match shared.len() {
        0 | 1 => Vec::new(),
        _ => shared.into_iter().map(|name| (name.to_owned(), Motion::identity())).collect(),
    }
}

/// Endings (lower case, no dot) of the files that are read as scans or models.
pub fn surface_endings() -> Vec<&'static str> {
    Format::surfaces().flat_map(|format| format.endings.iter().copied()).collect()
}

/// The formats of scans and models as a choice, for messages: "A, B or C".
pub fn surface_names() -> String {
    let names: Vec<&str> = Format::surfaces().map(|format| format.name).collect();
    match names.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => String::new(),
    }
}

/// The formats as a table in Markdown, for the documentation.
pub fn markdown() -> String {
    let mut text =
        "| format | endings | holds, as far as it is read | written |\n| --- | --- | --- | --- |\n".to_owned();
    for format in FORMATS {
        let endings: Vec<String> = format.endings.iter().map(|ending| format!("`.{ending}`")).collect();
        let holds: Vec<&str> = format.holds.iter().map(|content| content.name()).collect();
        let written = [
            (format.writers.cloud.is_some(), "clouds"),
            (format.writers.mesh.is_some(), "meshes"),
            (format.writers.poses.is_some(), "poses"),
        ];
        let written: Vec<&str> = written.iter().filter(|(is_written, _)| *is_written).map(|(_, what)| *what).collect();
        let row = [format.name, &endings.join(", "), &holds.join(", "), &written.join(", ")].map(or_none).join(" | ");
        text.push_str(&format!("| {row} |\n"));
    }
    text
}

fn or_none(cell: &str) -> &str {
    if cell.is_empty() { "-" } else { cell }
}

#[cfg(test)]
mod tests {
    use super::super::{MeshContent, ply::VertexAttributes, read};
    use super::super::{check_name, read_surface};
    use super::*;
    use visage_geometry::{Mesh, Point3, Unit};

    #[test]
    fn every_ending_belongs_to_one_format() {
        let mut endings: Vec<&str> = FORMATS.iter().flat_map(|format| format.endings).copied().collect();
        assert!(endings.iter().all(|ending| ending.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())));
        let count = endings.len();
        endings.sort_unstable();
        endings.dedup();
        assert_eq!(endings.len(), count);
        for format in FORMATS {
            for ending in format.endings {
                let found = check_name(&format!("a.b.{}", ending.to_uppercase())).ok();
                assert_eq!(found, format.is_surface().then_some(*format));
            }
        }
        assert!(check_name("ply").is_err());
    }

    /// What a format holds of a mesh comes back, in its place and size.
    fn assert_attributes_stay(format: &Format, write: MeshWriter) {
        let vertices = vec![Point3::new(512.0, 0.0, 0.0), Point3::new(768.0, 0.0, 0.0), Point3::new(512.0, 256.0, 0.0)];
        let mesh = Mesh { vertices, faces: vec![[0, 1, 2]] };
        let (normals, colors) = (mesh.vertex_normals(), [[1, 2, 3], [4, 5, 6], [7, 8, 255]]);
        let attributes = VertexAttributes {
            normals: Some(&normals),
            colors: Some(&colors),
            support: Some(&[0.0, 1.5, 2.0]),
            ..VertexAttributes::default()
        };
        let bytes = write(&MeshContent { mesh: &mesh, attributes, unit: Unit::Mm });
        let back = read(&format!("a.{}", format.ending()), &bytes, &ReadLimits::default()).expect(format.name);
        if format.holds.contains(&Content::Colors) {
            assert_eq!(back.surface.cloud.colors, Some(colors.to_vec()), "{format:?}");
        }
        if format.holds.contains(&Content::Normals) {
            assert_eq!(back.surface.cloud.normals, Some(vec![nalgebra::Vector3::z(); 3]), "{format:?}");
        }
        // a format with a unit of its own has the same size in it
        let mm = back.unit.map_or(1.0, |unit| unit.metres * 1000.0);
        for (place, vertex) in back.surface.cloud.points.iter().zip(&mesh.vertices) {
            assert!((place * mm - vertex).norm() < 1e-4, "{format:?}: {place}");
        }
    }

    #[test]
    fn what_is_written_in_a_format_is_read_by_it() {
        let vertices = vec![Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.5), Point3::new(0.0, 2.0, 0.25)];
        let mesh = Mesh { vertices: vertices.clone(), faces: vec![[0, 1, 2], [2, 1, 0]] };
        let placed = vec![("a".to_owned(), Some(Motion::translation(1.0, 2.0, 3.0))), ("b".to_owned(), None)];
        for format in FORMATS {
            match format.reader {
                Reader::Surface(_) | Reader::Scans(_) => {
                    let name = format!("a.{}", format.ending());
                    let read = |bytes: Vec<u8>| read_surface(&name, &bytes, &ReadLimits::default()).expect(format.name);
                    if let Some(write) = format.writers.mesh {
                        assert!(format.holds.contains(&Content::Mesh));
                        assert_eq!(read(write(&(&mesh).into())).mesh().as_ref(), Some(&mesh), "{format:?}");
                        assert_attributes_stay(format, write);
                    }
                    if let Some(write) = format.writers.cloud {
                        assert_eq!(read(write(&Cloud::from_points(vertices.clone()))).cloud.points, vertices);
                    }
                    assert!(format.writers.poses.is_none());
                }
                Reader::Poses(read) => {
                    assert_eq!(format.holds, [Content::Poses]);
                    if let Some(write) = format.writers.poses {
                        let read = read("poses", write(&placed).as_bytes()).expect(format.name);
                        // a format without names holds the poses of all scans that are placed
                        let read = read.named_as(&["a"]).expect(format.name);
                        assert_eq!(read.to_map()["a"], Motion::translation(1.0, 2.0, 3.0), "{format:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn tiles_of_land_stand_where_they_are() {
        let names = |names: &[&'static str]| -> Vec<String> {
            shared_frame(names.iter().copied()).into_iter().map(|(name, _)| name).collect()
        };
        assert_eq!(names(&["a.las", "b.ply", "x/c.LAZ"]), ["a.las", "x/c.LAZ"]);
        assert!(names(&["a.las", "b.ply"]).is_empty(), "one alone tells nothing");
    }

    #[test]
    fn files_that_may_be_anything_are_scans_where_there_are_no_others() {
        let chosen = |names: &[&'static str]| {
            let are_scans = scan_files(names);
            names
                .iter()
                .copied()
                .zip(are_scans)
                .filter_map(|(name, is_scan)| is_scan.then_some(name))
                .collect::<Vec<_>>()
        };
        assert_eq!(chosen(&["a.ply", "set/._a.ply", ".b/a.ply", "t.csv", "c.jpg"]), ["a.ply"]);
        assert_eq!(chosen(&["t.csv.gz", "._a.ply", "c.jpg"]), ["t.csv.gz"]);
    }

    #[test]
    fn the_documentation_has_the_table() {
        let documentation = include_str!("../../../docs/API.md");
        for table in [markdown(), crate::poses::markdown()] {
            assert!(documentation.contains(&table), "docs/API.md is to hold:\n{table}");
        }
    }
}
