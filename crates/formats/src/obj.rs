//! OBJ, the Wavefront text format: positions, normals, vertex colours and polygons. Materials, texture
//! coordinates, groups and lines are passed over.

use std::borrow::Cow;
use std::fmt::Write;

use super::budget::Budget;
use super::colors::Channels;
use super::format::{self, BYTES, Content, Format, Writers};
use super::points::{COLOR, INTENSITY, Layout, NONE, NORMAL, Points, SLOTS, X};
use super::text::TextLines;
use super::{FormatError, MeshContent, ReadLimits, Reading, number, quote, text_start};
use visage_geometry::{Cloud, Mesh, Point3, Vector3};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "OBJ",
    endings: &["obj"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Mesh, Content::Normals, Content::Colors],
    reader: format::Reader::Surface(read),
    writers: Writers { cloud: Some(write_cloud), mesh: Some(write_content), ..Writers::NONE },
};

/// Reads an OBJ file: `v x y z` (also with a weight, or with red green blue behind, of any range), `vn` and `f`.
///
/// All objects and groups make one surface, whose vertices keep the order of the file. Faces may name vertices and
/// normals that come later. Polygons are cut into fans. The normal of a vertex is the mean of those that the faces give
/// it.
///
/// # Errors
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// line for the rest: no vertices, words that are no numbers, coordinates that are too large.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let text = &bytes[text_start(bytes)?..];
    let mut reader = Reader::new(limits);
    let mut lines = Lines { parts: TextLines::new(text) };
    while let Some((number, line)) = lines.next() {
        reader.line(&line).map_err(|fault| match fault {
            Fault::Wrong(problem) => {
                FormatError::malformed(format!("line {number}"), problem, "repair the file or export it again")
            }
            Fault::Refused(error) => error,
        })?;
    }
    reader.finish()
}

/// Lines, whatever ends them. A backslash at the end joins a line with the next.
struct Lines<'a> {
    parts: TextLines<'a>,
}

impl<'a> Lines<'a> {
    /// The next line, and the number of its first part.
    fn next(&mut self) -> Option<(usize, Cow<'a, [u8]>)> {
        let mut line = Cow::Borrowed(self.parts.next()?);
        let number = self.parts.number();
        while let Some(continued) = line.trim_ascii_end().strip_suffix(b"\\")
            && !line.trim_ascii_start().starts_with(b"#")
        {
            let mut joined = [continued, b" "].concat();
            let Some(part) = self.parts.next() else { return Some((number, joined.into())) };
            joined.extend_from_slice(part);
            line = joined.into();
        }
        Some((number, line))
    }
}

/// What is wrong with a line.
enum Fault {
    Wrong(String),
    Refused(FormatError),
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Fault::Wrong(problem)
    }
}

impl From<FormatError> for Fault {
    fn from(error: FormatError) -> Self {
        Fault::Refused(error)
    }
}

/// Numbers of a `v` line: a position, perhaps with a weight, or a colour and its opacity.
const MOST_NUMBERS: usize = 7;

/// What has been read so far.
struct Reader<'a> {
    limits: &'a ReadLimits,
    budget: Budget,
    vertices: Vec<[f64; 3]>,
    /// Empty before the first vertex that has one; NaN where a vertex has none.
    colors: Vec<[f32; 3]>,
    normals: Vec<Vector3>,
    /// Vertex and normal of each corner of a face; [`NONE`] for one that can't be there.
    corner_normals: Vec<(u32, u32)>,
    faces: Vec<[u32; 3]>,
}

impl<'a> Reader<'a> {
    fn new(limits: &'a ReadLimits) -> Self {
        Reader {
            limits,
            budget: limits.budget(),
            vertices: Vec::new(),
            colors: Vec::new(),
            normals: Vec::new(),
            corner_normals: Vec::new(),
            faces: Vec::new(),
        }
    }

    fn line(&mut self, line: &[u8]) -> Result<(), Fault> {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let mut words = words.take_while(|word| !word.starts_with(b"#"));
        match words.next() {
            Some(b"v") => self.vertex(words),
            Some(b"vn") => {
                self.budget.take(1, size_of::<Vector3>())?;
                // a normal that is none costs the vertices that have it this normal
                let mut normal = Vector3::repeat(f64::NAN);
                normal.iter_mut().zip(words).for_each(|(x, word)| *x = number::parse(word).unwrap_or(f64::NAN));
                self.normals.push(normal);
                Ok(())
            }
            Some(b"f") => self.face(words),
            _ => Ok(()),
        }
    }

    fn vertex<'b>(&mut self, words: impl Iterator<Item = &'b [u8]>) -> Result<(), Fault> {
        let limit = self.limits.most_points();
        if self.vertices.len() as u64 >= limit {
            return Err(FormatError::TooLarge { what: "points", found: limit + 1, limit }.into());
        }
        self.budget.take(1, size_of::<[f64; 3]>())?;
        let mut values = [f64::NAN; MOST_NUMBERS];
        let mut count = 0;
        for (value, word) in values.iter_mut().zip(words) {
            *value = match number::parse(word) {
                Some(value) => value,
                None if count < 3 => return Err(format!("{} is no number", quote(word)).into()),
                None => f64::NAN,
            };
            count += 1;
        }
        if count < 3 {
            return Err(format!("three numbers are needed, there are {count}").into());
        }
        let [x, y, z, red, green, blue, _] = values;
        self.vertices.push([x, y, z]);
        if count >= 6 || !self.colors.is_empty() {
            let missing = self.vertices.len() - self.colors.len();
            self.budget.take(missing as u64, size_of::<[f32; 3]>())?;
            self.colors.resize(self.vertices.len(), [f32::NAN; 3]);
        }
        if let Some(color) = self.colors.last_mut().filter(|_| count >= 6) {
            *color = [red, green, blue].map(|channel| channel as f32);
        }
        Ok(())
    }

    fn face<'b>(&mut self, words: impl Iterator<Item = &'b [u8]>) -> Result<(), Fault> {
        let mut fan = [0u32; 2];
        for (corner, word) in words.enumerate() {
            let mut parts = word.split(|byte| *byte == b'/');
            let vertex = index("vertex", parts.next(), self.vertices.len())?;
            if let Some(normal) = parts.nth(1).filter(|normal| !normal.is_empty()) {
                self.budget.take(1, size_of::<(u32, u32)>())?;
                self.corner_normals.push((vertex, index("normal", Some(normal), self.normals.len())?));
            }
            if corner < 2 {
                fan[corner] = vertex;
                continue;
            }
            let limit = self.limits.max_faces;
            if self.faces.len() as u64 >= limit {
                return Err(FormatError::TooLarge { what: "faces", found: limit + 1, limit }.into());
            }
            self.budget.take(1, size_of::<[u32; 3]>())?;
            self.faces.push([fan[0], fan[1], vertex]);
            fan[1] = vertex;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Reading, FormatError> {
        if self.vertices.is_empty() {
            let problem = "there is no line `v x y z`";
            return Err(FormatError::malformed("the whole file", problem, "send an OBJ file with vertices"));
        }
        let normals = self.vertex_normals()?;
        let has_normals = normals.is_some();
        let has = |slot| match slot {
            X..NORMAL => true,
            NORMAL..COLOR => has_normals,
            COLOR..INTENSITY => !self.colors.is_empty(),
            _ => false,
        };
        let layout = Layout::of(has, |_| Channels::Floats)?;
        self.budget.take(self.vertices.len() as u64, layout.bytes())?;
        let mut points = Points::new(&layout, self.vertices.len());
        let mut values = [0.0; SLOTS];
        for (vertex, position) in self.vertices.iter().enumerate() {
            values[X..X + 3].copy_from_slice(position);
            if let Some(normals) = &normals {
                values[NORMAL..NORMAL + 3].copy_from_slice(normals[vertex].as_slice());
            }
            if let Some(color) = self.colors.get(vertex) {
                values[COLOR..COLOR + 3].copy_from_slice(&color.map(f64::from));
            }
            points.push(&values).map_err(|problem| {
                let place = format!("vertex {}", vertex + 1);
                FormatError::malformed(place, problem, "repair the file or export it again")
            })?;
        }
        // only now are all vertices there that a face may name
        let (count, before) = (self.vertices.len() as u32, self.faces.len());
        self.faces.retain(|face| face.iter().all(|vertex| *vertex < count));
        points.dropped.faces += (before - self.faces.len()) as u64;
        points.finish(self.faces, None, None)
    }

    /// A normal for every vertex, NaN where there is none; `None` if no vertex has one.
    fn vertex_normals(&mut self) -> Result<Option<Vec<Vector3>>, FormatError> {
        if self.faces.is_empty() && self.normals.len() == self.vertices.len() {
            return Ok(Some(std::mem::take(&mut self.normals)));
        }
        if self.corner_normals.is_empty() || self.normals.is_empty() {
            return Ok(None);
        }
        self.budget.take(self.vertices.len() as u64, size_of::<Vector3>())?;
        let mut sums = vec![Vector3::zeros(); self.vertices.len()];
        for (vertex, normal) in &self.corner_normals {
            if let (Some(sum), Some(normal)) = (sums.get_mut(*vertex as usize), self.normals.get(*normal as usize))
                && normal.iter().all(|x| x.is_finite())
            {
                *sum += normal;
            }
        }
        sums.iter_mut().filter(|sum| **sum == Vector3::zeros()).for_each(|sum| sum.fill(f64::NAN));
        Ok(Some(sums))
    }
}

/// An index as OBJ counts, from 1, or back from the last one read so far when negative; [`NONE`] for one that can't be.
fn index(what: &str, word: Option<&[u8]>, count: usize) -> Result<u32, String> {
    let word = word.unwrap_or_default();
    let number = std::str::from_utf8(word).ok().and_then(|text| text.parse::<i64>().ok());
    let number = number.ok_or_else(|| format!("{} is no index of a {what}", quote(word)))?;
    let zero_based = if number < 0 { number.checked_add(count as i64) } else { number.checked_sub(1) };
    Ok(zero_based.and_then(|index| u32::try_from(index).ok()).unwrap_or(NONE))
}

/// Writes a cloud with its normals, and its colours as fractions behind the positions; intensities have no place in OBJ.
/// Numbers are those that are read back as the same values.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    let mut text = String::new();
    for (index, point) in cloud.points.iter().enumerate() {
        write_vertex(&mut text, point, cloud.colors.as_ref().map(|colors| colors[index]));
    }
    for normal in cloud.normals.iter().flatten() {
        let _ = writeln!(text, "vn {} {} {}", normal.x, normal.y, normal.z);
    }
    text.into_bytes()
}

/// Writes a mesh.
pub fn write_mesh(mesh: &Mesh) -> Vec<u8> {
    write_content(&mesh.into())
}

/// Writes a mesh with the normals and colours of its vertices, as [`write_cloud`] does.
fn write_content(content: &MeshContent) -> Vec<u8> {
    let MeshContent { mesh, attributes, .. } = content;
    let mut text = String::new();
    for (index, point) in mesh.vertices.iter().enumerate() {
        write_vertex(&mut text, point, attributes.colors.map(|colors| colors[index]));
    }
    for normal in attributes.normals.into_iter().flatten() {
        // as exact as they are in other formats
        let [x, y, z] = [normal.x as f32, normal.y as f32, normal.z as f32];
        let _ = writeln!(text, "vn {x} {y} {z}");
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|vertex| u64::from(vertex) + 1);
        let _ = match attributes.normals {
            Some(_) => writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}"),
            None => writeln!(text, "f {a} {b} {c}"),
        };
    }
    text.into_bytes()
}

/// A vertex, with its colour as fractions.
fn write_vertex(text: &mut String, point: &Point3, color: Option<[u8; 3]>) {
    // writing to a string can't fail
    let _ = write!(text, "v {} {} {}", point.x, point.y, point.z);
    if let Some(color) = color {
        let [red, green, blue] = color.map(|channel| f64::from(channel) / 255.0);
        let _ = write!(text, " {red} {green} {blue}");
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Surface;

    #[test]
    fn what_is_written_comes_back() {
        let cloud = Cloud {
            points: vec![Point3::new(1.0 / 3.0, 4.5e6 + 0.001, -1e-9), Point3::origin()],
            normals: Some(vec![nalgebra::Vector3::x(), nalgebra::Vector3::new(0.6, 0.0, 0.8)]),
            colors: Some(vec![[1, 0, 1], [0, 254, 0]]),
            intensities: None,
        };
        assert_eq!(read(&write_cloud(&cloud), &ReadLimits::default()).expect("own files").surface.cloud, cloud);
    }

    fn read_text(text: &str) -> Result<Surface, FormatError> {
        read(text.as_bytes(), &ReadLimits::default()).map(|reading| reading.surface)
    }

    #[test]
    fn objects_share_vertices_and_polygons_become_fans() {
        let surface = read_text(
            "# a square and a triangle\r\nmtllib none.mtl\r\no one\r\nv 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0 # corner\r\n\
             vt 0 0\r\nf 1/1 2/1 3/1 4/1\r\ng two\nusemtl none\nv 0 0 1 1.0\nf -1 1 2 # roof\nl 1 2\nf 1 2\n",
        )
        .expect("sound");
        assert_eq!(surface.cloud.len(), 5);
        assert_eq!(surface.faces, [[0, 1, 2], [0, 2, 3], [4, 0, 1]]);
        assert_eq!(surface.cloud.normals, None);
        assert_eq!(surface.cloud.colors, None);
    }

    #[test]
    fn colors_and_normals_are_kept_if_every_vertex_has_them() {
        let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nvn 0 0 2\nvn 0 0 -1\nf 1//1 2//1 3//1\n";
        let cloud = read_text(text).expect("sound").cloud;
        assert_eq!(cloud.colors, Some(vec![[255, 0, 0], [0, 255, 0], [0, 0, 128]]));
        assert_eq!(cloud.normals, Some(vec![nalgebra::Vector3::z(); 3]));
        let more = text.replace("f 1//1", "v 5 5 5\nf 1//1");
        let reading = read(more.as_bytes(), &ReadLimits::default()).expect("sound");
        assert_eq!((reading.dropped.colors, reading.dropped.normals), (1, 1), "the fourth vertex has neither");
        assert_eq!(reading.surface.cloud.colors.expect("three have one")[2..], [[0, 0, 128], [0; 3]]);
        assert_eq!(reading.surface.cloud.normals.expect("three have one")[3], nalgebra::Vector3::zeros());
        let cloud = read_text("v 0 0 0\nvn 1 0 0\n").expect("a cloud").cloud;
        assert_eq!(cloud.normals, Some(vec![nalgebra::Vector3::x()]));
    }

    #[test]
    fn what_is_wrong_is_named_by_line() {
        let repair = "; repair the file or export it again";
        let cases = [
            ("v 0 0 0\nv 0 1e20 0\n", "vertex 2: y is 1e20, which is too large to be a coordinate"),
            ("v 0 0\n", "line 1: three numbers are needed, there are 2"),
            ("v 0 0 zero\n", "line 1: \"zero\" is no number"),
            ("v 0 0 0\nf a b c\n", "line 2: \"a\" is no index of a vertex"),
        ];
        for (text, message) in cases {
            let error = read_text(text).expect_err(text).to_string();
            assert!(error.starts_with(message), "{error}");
            assert!(error.ends_with(repair), "{error}");
        }
        let error = read_text("this is no OBJ").expect_err("no vertices").to_string();
        assert_eq!(error, "the whole file: there is no line `v x y z`; send an OBJ file with vertices");
    }

    #[test]
    fn faces_may_name_what_comes_later_and_go_when_it_never_does() {
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n";
        for text in [
            format!("f 1//1 2//1 3//1 4//1\n{square}"),
            format!("{square}f 1//1 2//1 \\\n  3//1 4//1\n"),
            format!("\u{feff}{square}f 1//1 2//1 3//1 4//1\n"),
            format!("{square}# a comment \\\nf 1//1 2//1 3//1 4//1 \\").replace('\n', "\r"),
        ] {
            let surface = read_text(&text).expect(&text);
            assert_eq!(surface.faces, [[0, 1, 2], [0, 2, 3]], "{text:?}");
            assert_eq!(surface.cloud.normals, Some(vec![nalgebra::Vector3::z(); 4]), "{text:?}");
        }
        for bad in ["f 1 2 5", "f 1 2 0", "f 1 2 -5", "f 1 2 -9223372036854775808"] {
            let reading =
                read(format!("{square}{bad}\nf 1//9 2//9 3//9\n").as_bytes(), &ReadLimits::default()).expect(bad);
            assert_eq!((reading.surface.faces, reading.dropped.faces), (vec![[0, 1, 2]], 1), "{bad}");
            assert_eq!(reading.surface.cloud.normals, None, "{bad}: there is no normal 9");
        }
    }

    #[test]
    fn limits_hold() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 1 2\n";
        let limited = |max_points, max_faces| {
            read(text.as_bytes(), &ReadLimits { max_points, max_faces, ..ReadLimits::default() })
        };
        assert!(limited(3, 3).is_ok());
        assert_eq!(limited(2, 3), Err(FormatError::TooLarge { what: "points", found: 3, limit: 2 }));
        assert_eq!(limited(3, 2), Err(FormatError::TooLarge { what: "faces", found: 3, limit: 2 }));
    }
}
