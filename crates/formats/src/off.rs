//! OFF, the format of Geomview: vertices and polygons in text, with normals (`NOFF`), colours (`COFF`), texture
//! coordinates (`STOFF`) or several of these. Colours of faces and texture coordinates are passed over.

use std::fmt::Write;

use super::budget::Budget;
use super::colors::Channels;
use super::format::{BYTES, Content, Format, Reader, Writers};
use super::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, Values, X};
use super::text::{TextLines, has_fraction, words};
use super::{FormatError, MeshContent, ReadLimits, Reading, number, quote, text_start};
use visage_geometry::{Cloud, Mesh};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "OFF",
    endings: &["off"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Mesh, Content::Normals, Content::Colors],
    reader: Reader::Surface(read),
    writers: Writers { cloud: Some(write_cloud), mesh: Some(write_content), ..Writers::NONE },
};

const REPAIR: &str = "repair the file or export it again";
/// The shortest vertex: three digits, and what parts them.
const LEAST_VERTEX: u64 = 6;
/// The shortest face: a digit and a line end.
const LEAST_FACE: u64 = 2;
/// Values of a vertex at most: position, normal, colour with opacity, texture coordinates.
const MOST_VALUES: usize = 12;

/// Reads an OFF file. Polygons are cut into fans.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// line for the rest: no vertices, words that are no numbers, binary files and those of other dimensions.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let text = &bytes[text_start(bytes)?..];
    let mut file = File { lines: TextLines::new(text) };
    let Head { mut kind, vertices, faces } = file.head()?;
    let left = file.lines.rest().len() as u64 + 1;
    let needed = vertices.saturating_mul(LEAST_VERTEX).saturating_add(faces.saturating_mul(LEAST_FACE));
    if needed > left {
        return Err(FormatError::Truncated {
            declared: format!("{vertices} vertices and {faces} faces"),
            found: format!("the {left} bytes after its header"),
        });
    }
    for (what, found, limit) in [("points", vertices, limits.most_points()), ("faces", faces, limits.max_faces)] {
        if found > limit {
            return Err(FormatError::TooLarge { what, found, limit });
        }
    }
    let mut budget = limits.budget();
    let mut points: Option<Points> = None;
    let mut superfluous = false;
    for vertex in 0..vertices {
        let line = file.next(|| format!("{vertices} vertices"), || format!("vertex {vertex}"))?;
        let mut row = file.row(line, kind)?;
        if points.is_none() {
            kind = row.kind;
            row = file.row(line, kind)?;
            let layout = kind.layout(row.has_fractions)?;
            budget.take(vertices, layout.bytes())?;
            points = Some(Points::new(&layout, vertices as usize));
        }
        if let Some(points) = &mut points {
            superfluous |= row.has_more;
            points.push(&row.values).map_err(|problem| file.wrong(problem))?;
        }
    }
    let none = || FormatError::malformed("the whole file", "there are no vertices", "send an OFF file with vertices");
    let mut points = points.ok_or_else(none)?;
    if superfluous {
        points.dropped.notes.push(format!("more values of the vertices than {} has are not used", kind.name()));
    }
    let triangles = file.faces((vertices, faces), limits, &mut budget, &mut points.dropped.faces)?;
    if file.next_data().is_some() {
        points.dropped.notes.push(format!("what follows the last face is not read (line {})", file.lines.number()));
    }
    points.finish(triangles, None, None)
}

/// What the vertices have beside their positions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Kind {
    normals: bool,
    colors: bool,
    texture: bool,
    /// Whether the colour stands before the normal, as MeshLab writes it (`NCOFF`); Geomview has it behind.
    colors_first: bool,
}

/// A length this near to 1 is that of a normal.
const UNIT_TOLERANCE: f64 = 0.02;

impl Kind {
    /// From the letters before `OFF`.
    fn of(letters: &str) -> Option<Self> {
        let mut kind = Kind::default();
        let mut rest = letters;
        while !rest.is_empty() {
            let (flag, length) = match rest.as_bytes() {
                [b'S', b'T', ..] => (&mut kind.texture, 2),
                [b'C', ..] => (&mut kind.colors, 1),
                [b'N', ..] => (&mut kind.normals, 1),
                _ => return None,
            };
            if std::mem::replace(flag, true) {
                return None;
            }
            rest = &rest[length..];
        }
        kind.colors_first = letters.contains("NC");
        Some(kind)
    }

    /// Where the normal and the colour are among the values of a vertex. Opacity may be among them.
    fn places(self, count: usize) -> (usize, usize) {
        let behind = if self.texture { 2 } else { 0 };
        match (self.normals, self.colors, self.colors_first) {
            (true, true, true) => (count.saturating_sub(3 + behind).max(6), 3),
            (true, true, false) => (3, 6),
            _ => (3, 3),
        }
    }

    /// The same with the order that the values of a vertex show: which has a normal in its place, or none (0 0 0). Where both
    /// have, the letters say it.
    fn as_shown(self, values: &[f64]) -> Self {
        let has_normal = |colors_first: bool| {
            let normal = Kind { colors_first, ..self }.places(values.len()).0;
            let length2: f64 = values.iter().skip(normal).take(3).map(|x| x * x).sum();
            length2 == 0.0 || (length2.sqrt() - 1.0).abs() <= UNIT_TOLERANCE
        };
        let colors_first = match (has_normal(false), has_normal(true)) {
            (true, true) => self.colors_first,
            (_, is_behind) => is_behind,
        };
        Kind { colors_first, ..self }
    }

    fn name(self) -> String {
        let letters = [(self.texture, "ST"), (self.colors, "C"), (self.normals, "N")];
        letters.iter().filter(|(has, _)| *has).map(|(_, letter)| *letter).chain(["OFF"]).collect()
    }

    fn layout(self, has_fractions: bool) -> Result<Layout, FormatError> {
        let has = |slot| match slot {
            X..NORMAL => true,
            NORMAL..COLOR => self.normals,
            COLOR..INTENSITY => self.colors,
            _ => false,
        };
        Layout::of(has, |_| if has_fractions { Channels::Floats } else { Channels::Whole(u32::MAX) })
    }
}

/// What the file says of itself.
#[derive(Debug, PartialEq, Eq)]
struct Head {
    kind: Kind,
    vertices: u64,
    faces: u64,
}

/// A vertex as it is read.
struct Row {
    values: Values,
    has_more: bool,
    has_fractions: bool,
    /// The kind of the vertices, as this one shows it.
    kind: Kind,
}

struct File<'a> {
    lines: TextLines<'a>,
}

impl<'a> File<'a> {
    /// The next line that holds more than a comment.
    fn next_data(&mut self) -> Option<&'a [u8]> {
        loop {
            let line = self.lines.next_filled()?;
            let length = memchr::memchr(b'#', line).unwrap_or(line.len());
            let data = line[..length].trim_ascii_end();
            if !data.is_empty() {
                return Some(data);
            }
        }
    }

    fn next(
        &mut self,
        declared: impl FnOnce() -> String,
        found: impl FnOnce() -> String,
    ) -> Result<&'a [u8], FormatError> {
        self.next_data().ok_or_else(|| FormatError::Truncated { declared: declared(), found: found() })
    }

    fn wrong(&self, problem: impl Into<String>) -> FormatError {
        FormatError::malformed(format!("line {}", self.lines.number()), problem, REPAIR)
    }

    /// The kind and the counts: `OFF`, then a line with them, or all in one line.
    fn head(&mut self) -> Result<Head, FormatError> {
        let first = self.next_data().unwrap_or_default();
        let no_off = || {
            let begins = if first.is_empty() {
                "this one is empty".into()
            } else {
                format!("this one begins with {}", quote(first))
            };
            let problem = format!("an OFF file begins with OFF, COFF, NOFF or the like; {begins}");
            FormatError::malformed(format!("line {}", self.lines.number()), problem, "send an OFF file in text")
        };
        let end = memchr::memmem::find(&first[..first.len().min(16)], b"OFF").ok_or_else(no_off)?;
        let letters = std::str::from_utf8(&first[..end]).map_err(|_| no_off())?;
        let rest = first[end + 3..].trim_ascii_start();
        if rest.starts_with(b"BINARY") {
            let remedy = "export it as text, or as binary PLY";
            return Err(FormatError::malformed("line 1", "binary OFF files are not read", remedy));
        }
        if letters.ends_with(['4', 'n']) {
            let problem = format!("{letters}OFF has points of another dimension than 3");
            return Err(FormatError::malformed("line 1", problem, "export the file as OFF with three coordinates"));
        }
        let kind = Kind::of(letters).ok_or_else(no_off)?;
        let counts = match rest {
            // some programs leave out the line end, and even the blank: `OFF8 6 0`
            [_, ..] => rest,
            [] => self.next(|| "the numbers of vertices and faces".into(), || "its header".into())?,
        };
        let mut counted = words(counts).map(|word| std::str::from_utf8(word).ok()?.parse().ok());
        match (counted.next().flatten(), counted.next().flatten()) {
            (Some(vertices), Some(faces)) => Ok(Head { kind, vertices, faces }),
            _ => {
                Err(self
                    .wrong(format!("the numbers of vertices and faces are expected, but here is {}", quote(counts))))
            }
        }
    }

    /// The values of a vertex. The colour takes what the other values leave: opacity may be among it.
    fn row(&self, line: &[u8], kind: Kind) -> Result<Row, FormatError> {
        let mut numbers = [0.0; MOST_VALUES];
        let mut count = 0;
        let mut all = words(line);
        for (value, word) in numbers.iter_mut().zip(&mut all) {
            *value = number::parse(word).ok_or_else(|| self.wrong(format!("{} is no number", quote(word))))?;
            count += 1;
        }
        let normals = if kind.normals { 3 } else { 0 };
        let least = 3 + normals + if kind.colors { 3 } else { 0 };
        if count < least {
            return Err(self.wrong(format!("a vertex of {} has {least} numbers, not {count}", kind.name())));
        }
        let mut values = [0.0; SLOTS];
        values[X..X + 3].copy_from_slice(&numbers[..3]);
        let (normal, color) = kind.places(count);
        if kind.normals {
            values[NORMAL..NORMAL + 3].copy_from_slice(&numbers[normal..normal + 3]);
        }
        let mut has_fractions = false;
        if kind.colors {
            values[COLOR..COLOR + 3].copy_from_slice(&numbers[color..color + 3]);
            has_fractions = words(line).skip(color).take(3).any(has_fraction);
        }
        let most = least + usize::from(kind.colors) + if kind.texture { 2 } else { 0 };
        let shown = kind.as_shown(&numbers[..count]);
        Ok(Row { values, has_more: count > most || all.next().is_some(), has_fractions, kind: shown })
    }

    /// The polygons as fans, so many of so many vertices; those that name a vertex which isn't there are counted.
    fn faces(
        &mut self,
        (vertices, faces): (u64, u64),
        limits: &ReadLimits,
        budget: &mut Budget,
        dropped: &mut u64,
    ) -> Result<Vec<[u32; 3]>, FormatError> {
        let mut triangles = Vec::new();
        for face in 0..faces {
            let line = self.next(|| format!("{faces} faces"), || format!("face {face}"))?;
            let mut indices = words(line).map(|word| self.index(word));
            let corners = indices.next().transpose()?.unwrap_or_default();
            let mut fan = [0; 2];
            for corner in 0..corners {
                let short = || self.wrong(format!("a face of {corners} corners has {corner}"));
                let index = indices.next().ok_or_else(short)??;
                match corner {
                    0 | 1 => fan[corner as usize] = index,
                    _ => {
                        if triangles.len() as u64 >= limits.max_faces {
                            let limit = limits.max_faces;
                            return Err(FormatError::TooLarge { what: "faces", found: limit + 1, limit });
                        }
                        budget.take(1, size_of::<[u32; 3]>())?;
                        let triangle = [fan[0], fan[1], index];
                        fan[1] = index;
                        if triangle.iter().all(|vertex| (0..vertices as i64).contains(vertex)) {
                            triangles.push(triangle.map(|vertex| vertex as u32));
                        } else {
                            *dropped += 1;
                        }
                    }
                }
            }
        }
        Ok(triangles)
    }

    fn index(&self, word: &[u8]) -> Result<i64, FormatError> {
        let number = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        number.ok_or_else(|| self.wrong(format!("{} is no index of a vertex", quote(word))))
    }
}

/// Writes a cloud with its normals and colours; numbers are those that are read back as the same values.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    vertices(cloud, 0).into_bytes()
}

/// The head of a file and its vertices.
fn vertices(cloud: &Cloud, faces: usize) -> String {
    let kind = Kind { normals: cloud.normals.is_some(), colors: cloud.colors.is_some(), ..Kind::default() };
    let mut text = format!("{}\n{} {faces} 0\n", kind.name(), cloud.len());
    for (index, point) in cloud.points.iter().enumerate() {
        // writing to a string can't fail
        let _ = write!(text, "{} {} {}", point.x, point.y, point.z);
        if let Some(normals) = &cloud.normals {
            let _ = write!(text, " {} {} {}", normals[index].x, normals[index].y, normals[index].z);
        }
        if let Some(colors) = &cloud.colors {
            let [red, green, blue] = colors[index];
            let _ = write!(text, " {red} {green} {blue} 255");
        }
        text.push('\n');
    }
    text
}

/// Writes a mesh.
pub fn write_mesh(mesh: &Mesh) -> Vec<u8> {
    write_content(&mesh.into())
}

/// Writes a mesh with the normals and colours of its vertices.
fn write_content(content: &MeshContent) -> Vec<u8> {
    let MeshContent { mesh, attributes, .. } = content;
    let cloud = Cloud {
        points: mesh.vertices.clone(),
        normals: attributes.normals.map(|normals| normals.iter().map(|normal| normal.cast()).collect()),
        colors: attributes.colors.map(<[_]>::to_vec),
        intensities: None,
    };
    let mut text = vertices(&cloud, mesh.faces.len());
    for [a, b, c] in &mesh.faces {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text.into_bytes()
}

#[cfg(test)]
mod tests;
