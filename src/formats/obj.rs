//! OBJ, the Wavefront text format: positions, normals, vertex colours and polygons. Materials, texture
//! coordinates, groups and lines are passed over.

use super::{FormatError, ReadLimits, checked_coordinate, quote};
use crate::geometry::{Cloud, Point3, Surface, Vector3};

/// Reads an OBJ file: `v x y z` (also with a weight, or with red green blue in 0 to 1 behind), `vn` and `f`.
///
/// All objects and groups make one surface, whose vertices keep the order of the file. Polygons are cut into fans.
/// The normal of a vertex is the mean of those that the faces give it; they are kept if every vertex has one.
///
/// # Errors
/// [`FormatError::TooLarge`] beyond the limits, [`FormatError::Malformed`] with the line for the rest: no
/// vertices, coordinates that are not finite, indices of vertices that don't exist.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Surface, FormatError> {
    let mut reader = Reader::new(limits);
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        reader.line(line).map_err(|fault| match fault {
            Fault::Wrong(problem) => {
                FormatError::malformed(format!("line {}", index + 1), problem, "repair the file or export it again")
            }
            Fault::TooLarge(what, found, limit) => FormatError::TooLarge { what, found, limit },
        })?;
    }
    reader.finish()
}

/// What is wrong with a line.
enum Fault {
    Wrong(String),
    TooLarge(&'static str, u64, u64),
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Fault::Wrong(problem)
    }
}

/// What has been read so far.
struct Reader<'a> {
    limits: &'a ReadLimits,
    points: Vec<Point3>,
    /// As long as `points` while every vertex had a colour.
    colors: Vec<[u8; 3]>,
    normals: Vec<Vector3>,
    /// Vertex and normal of each corner of a face.
    corner_normals: Vec<(u32, u32)>,
    faces: Vec<[u32; 3]>,
}

impl<'a> Reader<'a> {
    fn new(limits: &'a ReadLimits) -> Self {
        let (points, colors, normals) = (Vec::new(), Vec::new(), Vec::new());
        Reader { limits, points, colors, normals, corner_normals: Vec::new(), faces: Vec::new() }
    }

    fn line(&mut self, line: &[u8]) -> Result<(), Fault> {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let mut words = words.take_while(|word| !word.starts_with(b"#"));
        match words.next() {
            Some(b"v") => self.vertex(words),
            Some(b"vn") => {
                let [x, y, z] = three(&numbers(words)?)?;
                self.normals.push(Vector3::new(x, y, z));
                Ok(())
            }
            Some(b"f") => self.face(words),
            _ => Ok(()),
        }
    }

    fn vertex<'b>(&mut self, words: impl Iterator<Item = &'b [u8]>) -> Result<(), Fault> {
        let limit = self.limits.max_points.min(u64::from(u32::MAX) - 1);
        if self.points.len() as u64 >= limit {
            return Err(Fault::TooLarge("points", limit + 1, limit));
        }
        let values = numbers(words)?;
        if values.len() >= 6 && self.colors.len() == self.points.len() {
            self.colors.push([values[3], values[4], values[5]].map(|channel| (channel * 255.0).round() as u8));
        }
        self.points.push(Point3::from(three(&values)?));
        Ok(())
    }

    fn face<'b>(&mut self, words: impl Iterator<Item = &'b [u8]>) -> Result<(), Fault> {
        let mut fan = [0u32; 2];
        for (corner, word) in words.enumerate() {
            let mut parts = word.split(|byte| *byte == b'/');
            let vertex = index("vertex", parts.next(), self.points.len())?;
            if let Some(normal) = parts.nth(1).filter(|normal| !normal.is_empty()) {
                self.corner_normals.push((vertex, index("normal", Some(normal), self.normals.len())?));
            }
            if corner < 2 {
                fan[corner] = vertex;
                continue;
            }
            if self.faces.len() as u64 >= self.limits.max_faces {
                return Err(Fault::TooLarge("faces", self.limits.max_faces + 1, self.limits.max_faces));
            }
            self.faces.push([fan[0], fan[1], vertex]);
            fan[1] = vertex;
        }
        Ok(())
    }

    fn finish(self) -> Result<Surface, FormatError> {
        if self.points.is_empty() {
            let problem = "there is no line `v x y z`";
            return Err(FormatError::malformed("the whole file", problem, "send an OBJ file with vertices"));
        }
        let normals = self.vertex_normals();
        let colors = (self.colors.len() == self.points.len()).then_some(self.colors);
        let cloud = Cloud { points: self.points, normals, colors, intensities: None };
        Ok(Surface { cloud, faces: self.faces, grid: None, sensor: None })
    }

    /// A unit normal for every vertex, or `None` if some vertex has none.
    fn vertex_normals(&self) -> Option<Vec<nalgebra::Vector3<f32>>> {
        let mut sums = vec![Vector3::zeros(); self.points.len()];
        if self.faces.is_empty() && self.normals.len() == self.points.len() {
            sums.clone_from(&self.normals);
        }
        for (vertex, normal) in &self.corner_normals {
            sums[*vertex as usize] += self.normals[*normal as usize];
        }
        sums.iter().map(|sum| sum.try_normalize(f64::MIN_POSITIVE).map(|normal| normal.cast())).collect()
    }
}

/// All numbers of a line.
fn numbers<'b>(words: impl Iterator<Item = &'b [u8]>) -> Result<Vec<f64>, String> {
    let number = |word: &[u8]| {
        let value = fast_float2::parse::<f64, _>(word).map_err(|_| format!("{} is no number", quote(word)))?;
        checked_coordinate(value).map_err(|problem| format!("{} {problem}", quote(word)))
    };
    words.map(number).collect()
}

fn three(values: &[f64]) -> Result<[f64; 3], String> {
    values.first_chunk().copied().ok_or_else(|| format!("three numbers are needed, there are {}", values.len()))
}

/// An index as OBJ counts: from 1, or back from the last one read so far when negative.
fn index(what: &str, word: Option<&[u8]>, count: usize) -> Result<u32, String> {
    let word = word.unwrap_or_default();
    let number = std::str::from_utf8(word).ok().and_then(|text| text.parse::<i64>().ok());
    let number = number.ok_or_else(|| format!("{} is no index of a {what}", quote(word)))?;
    let zero_based = if number < 0 { number.checked_add(count as i64) } else { number.checked_sub(1) };
    zero_based
        .and_then(|index| u32::try_from(index).ok())
        .filter(|index| (*index as usize) < count)
        .ok_or_else(|| format!("there is no {what} {number} among the {count} read so far"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Surface, FormatError> {
        read(text.as_bytes(), &ReadLimits::default())
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
        let cloud = read_text(&text.replace("f 1//1", "v 5 5 5\nf 1//1")).expect("sound").cloud;
        assert_eq!((cloud.colors, cloud.normals), (None, None));
        let cloud = read_text("v 0 0 0\nvn 1 0 0\n").expect("a cloud").cloud;
        assert_eq!(cloud.normals, Some(vec![nalgebra::Vector3::x()]));
    }

    #[test]
    fn what_is_wrong_is_named_by_line() {
        let repair = "; repair the file or export it again";
        let cases = [
            ("v 0 0 0\nv 0 nan 0\n", "line 2: \"nan\" is not finite"),
            ("v 0 0\n", "line 1: three numbers are needed, there are 2"),
            ("v 0 0 zero\n", "line 1: \"zero\" is no number"),
            ("v 0 0 0\nf 1 1 2\n", "line 2: there is no vertex 2 among the 1 read so far"),
            ("v 0 0 0\nf 1 1 0\n", "line 2: there is no vertex 0 among the 1 read so far"),
            ("v 0 0 0\nf 1 1 -2\n", "line 2: there is no vertex -2 among the 1 read so far"),
            ("v 0 0 0\nf 1 1 -9223372036854775808\n", "line 2: there is no vertex -9223372036854775808 among"),
            ("v 0 0 0\nf 1//1 1 1\n", "line 2: there is no normal 1 among the 0 read so far"),
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
    fn limits_hold() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 1 2\n";
        let limited = |max_points, max_faces| read(text.as_bytes(), &ReadLimits { max_points, max_faces });
        assert!(limited(3, 3).is_ok());
        assert_eq!(limited(2, 3), Err(FormatError::TooLarge { what: "points", found: 3, limit: 2 }));
        assert_eq!(limited(3, 2), Err(FormatError::TooLarge { what: "faces", found: 3, limit: 2 }));
    }
}
