//! STL, the format of 3D printing: triangles, each with its three corners; ASCII and binary. It knows neither unit nor
//! colour.
//!
//! Corners with equal coordinates are one vertex. Normals of facets are passed over: programs write zeros, and the
//! corners say the same.

use super::budget::Budget;
use super::format::{self, BYTES, Content, Format, Writers};
use super::header_lines::lines_of;
use super::points::Points;
use super::weld::Weld;
use super::{Dropped, FormatError, ReadLimits, Reading, checked_coordinate, number, quote, text_start};
use visage_geometry::{Mesh, Vector3};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "STL",
    endings: &["stl"],
    media_type: BYTES,
    holds: &[Content::Mesh],
    reader: format::Reader::Surface(read),
    writers: Writers { mesh: Some(|content| write_mesh(content.mesh)), ..Writers::NONE },
};

/// Bytes before the number of facets in a binary file: anything, even `solid`.
const HEADER: usize = 80;
/// Bytes before the first facet.
const HEAD: usize = HEADER + 4;
/// Bytes of a facet: normal, three corners, two bytes that some programs use for a colour.
const FACET: usize = 50;

const REPAIR: &str = "repair the file or export it again";

/// Reads an STL file. A binary file may begin with `solid`, as a text does: what it is, its length says.
///
/// A facet of which a coordinate is not finite is left out and counted.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// facet for the rest: no facets, words that are no numbers, coordinates that are too large.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let declared = bytes.get(HEADER..HEAD).and_then(|count| count.try_into().ok()).map_or(0, u32::from_le_bytes);
    let needed = HEAD as u64 + u64::from(declared) * FACET as u64;
    let found = bytes.len() as u64;
    // the number of facets that the letters of a text would be is in the hundreds of millions
    if bytes.len() >= HEAD && needed <= found {
        return read_binary(bytes, declared, limits);
    }
    let text = &bytes[text_start(bytes)?..];
    let mut words = Words { text, position: 0 };
    let first = words.next().unwrap_or_default();
    // a small number has a zero among its four bytes
    let is_text = !bytes[..bytes.len().min(HEAD)].contains(&0);
    if is_text && ["solid", "facet"].iter().any(|word| first.eq_ignore_ascii_case(word.as_bytes())) {
        return read_text(text, limits);
    }
    if is_text || bytes.len() < HEAD {
        let begins = if bytes.is_empty() {
            "this one is empty".into()
        } else {
            format!("this one begins with {}", quote(bytes))
        };
        let problem =
            format!("an STL file begins with `solid`, or with {HEADER} bytes and the number of its facets; {begins}");
        return Err(FormatError::malformed("byte 0", problem, "send an STL file, ASCII or binary"));
    }
    Err(FormatError::Truncated {
        declared: format!("{declared} facets"),
        found: format!("the {} bytes after its header", bytes.len() - HEAD),
    })
}

/// The facets read so far.
struct Facets<'a> {
    limits: &'a ReadLimits,
    budget: Budget,
    weld: Weld,
    dropped: Dropped,
    /// Facets of the file, with those that were left out.
    seen: u64,
}

impl<'a> Facets<'a> {
    /// None yet; about so many will come, for which there are bytes.
    fn new(limits: &'a ReadLimits, expected: usize) -> Result<Self, FormatError> {
        // a closed surface has half as many vertices as facets
        let vertices = (expected / 2).min(limits.most_points() as usize);
        let mut budget = limits.budget();
        let weld = Weld::new(vertices, expected, limits.most_points(), &mut budget)?;
        Ok(Facets { limits, budget, weld, dropped: Dropped::default(), seen: 0 })
    }

    /// Takes the next facet; `place` says where it is.
    #[inline]
    fn push(&mut self, corners: &[[f64; 3]; 3], place: impl Fn() -> String) -> Result<(), FormatError> {
        self.seen += 1;
        let is_coordinate = |x: &f64| checked_coordinate(*x).is_ok();
        if !corners.iter().flatten().all(is_coordinate) {
            return self.leave_out(corners, place);
        }
        let limit = self.limits.max_faces;
        if self.weld.faces.len() as u64 >= limit {
            return Err(FormatError::TooLarge { what: "faces", found: limit + 1, limit });
        }
        self.budget.take(1, size_of::<[u32; 3]>())?;
        self.weld.push(corners, &mut self.budget)
    }

    /// Passes over a facet with a corner that is none; finite coordinates that are too large are an error.
    #[cold]
    fn leave_out(&mut self, corners: &[[f64; 3]; 3], place: impl Fn() -> String) -> Result<(), FormatError> {
        if corners.iter().flatten().any(|x| !x.is_finite()) {
            self.dropped.faces += 1;
            return Ok(());
        }
        for (axis, value) in corners.iter().flat_map(|corner| ["x", "y", "z"].into_iter().zip(corner)) {
            checked_coordinate(*value)
                .map_err(|problem| FormatError::malformed(place(), format!("{axis} {problem}"), REPAIR))?;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Reading, FormatError> {
        if self.seen == 0 {
            let problem = "there are no facets";
            return Err(FormatError::malformed("the whole file", problem, "send an STL file with facets"));
        }
        self.weld.settle(&mut self.budget)?;
        let Weld { positions, faces, .. } = self.weld;
        let mut points = Points::of(positions);
        points.dropped = self.dropped;
        points.finish(faces, None, None)
    }
}

/// Reads a binary file that is long enough for the facets that it declares.
fn read_binary(bytes: &[u8], count: u32, limits: &ReadLimits) -> Result<Reading, FormatError> {
    let (found, limit) = (u64::from(count), limits.max_faces);
    if found > limit {
        return Err(FormatError::TooLarge { what: "faces", found, limit });
    }
    let mut facets = Facets::new(limits, count as usize)?;
    let (records, rest) = bytes[HEAD..].split_at((count as usize * FACET).min(bytes.len() - HEAD));
    for (index, record) in records.as_chunks().0.iter().enumerate() {
        facets.push(&corners_of(record), || format!("facet {index} (byte {})", HEAD + index * FACET))?;
    }
    if !rest.is_empty() {
        facets.dropped.notes.push(format!("{} bytes behind the last facet are not read", rest.len()));
    }
    facets.finish()
}

/// The corners of a facet, behind its normal.
#[inline]
fn corners_of(record: &[u8; FACET]) -> [[f64; 3]; 3] {
    let mut corners = [[0.0; 3]; 3];
    // filled in place: corners that are returned by one closure after the other wait for memory
    for (x, bytes) in corners.as_flattened_mut().iter_mut().zip(record[12..].as_chunks().0) {
        *x = f64::from(f32::from_le_bytes(*bytes));
    }
    corners
}

/// Words between blanks and line ends of whatever kind.
struct Words<'a> {
    text: &'a [u8],
    /// Where the last word ends.
    position: usize,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.position + self.text[self.position..].iter().position(|byte| !byte.is_ascii_whitespace())?;
        let rest = &self.text[start..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.position = start + length;
        Some(&rest[..length])
    }

    /// Passes over the name of a solid: to the end of the line, or to the first facet where all is in one line.
    fn skip_name(&mut self) {
        loop {
            let rest = &self.text[self.position..];
            let is_blank = |byte: &&u8| byte.is_ascii_whitespace() && !matches!(byte, b'\n' | b'\r');
            let blanks = rest.iter().take_while(is_blank).count();
            let length = rest[blanks..].iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
            if length == 0 || rest[blanks..][..length].eq_ignore_ascii_case(b"facet") {
                return;
            }
            self.position += blanks + length;
        }
    }

    /// The line of the last word, counted from 1.
    fn line(&self) -> usize {
        1 + lines_of(&self.text[..self.position])
    }
}

fn read_text(text: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let mut facets = Facets::new(limits, 0)?;
    let mut words = Words { text, position: 0 };
    let (mut corners, mut count) = ([[0.0; 3]; 3], 0);
    let mut is_ended = false;
    while let Some(word) = words.next() {
        let index = facets.seen;
        let wrong = |words: &Words, problem: String| {
            FormatError::malformed(format!("facet {index} (line {})", words.line()), problem, REPAIR)
        };
        if word.eq_ignore_ascii_case(b"vertex") {
            let Some(corner) = corners.get_mut(count) else {
                return Err(wrong(&words, "it has more than three corners".into()));
            };
            for x in corner {
                let cut = || FormatError::Truncated { declared: "a vertex".into(), found: format!("facet {index}") };
                let word = words.next().ok_or_else(cut)?;
                *x = number::parse(word).ok_or_else(|| wrong(&words, format!("{} is no number", quote(word))))?;
            }
            count += 1;
        } else if word.eq_ignore_ascii_case(b"endloop") {
            if count != 3 {
                return Err(wrong(&words, format!("it has {count} corners, not three")));
            }
            facets.push(&corners, || format!("facet {index} (line {})", words.line()))?;
            count = 0;
        } else if word.eq_ignore_ascii_case(b"solid") || word.eq_ignore_ascii_case(b"endsolid") {
            is_ended = word.len() > b"solid".len();
            words.skip_name();
        } else if count > 0 {
            return Err(wrong(&words, format!("{} stands where a vertex or endloop is expected", quote(word))));
        }
    }
    if count > 0 {
        return Err(FormatError::Truncated { declared: "endloop".into(), found: format!("facet {}", facets.seen) });
    }
    if !is_ended {
        facets.dropped.notes.push("there is no endsolid: the file may be cut short".into());
    }
    facets.finish()
}

/// Writes a mesh as binary STL. Coordinates are `f32`, whatever the distance from the origin; vertices that no face has
/// are not in it. The same mesh always gives the same bytes.
pub fn write_mesh(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEAD + FACET * mesh.faces.len());
    // it must not begin with `solid`
    bytes.extend(b"binary STL");
    bytes.resize(HEADER, b' ');
    bytes.extend((mesh.faces.len() as u32).to_le_bytes());
    for index in 0..mesh.faces.len() {
        let normal = mesh.area_normal(index).try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        let [a, b, c] = mesh.corners(index).map(|corner| corner.coords);
        for x in [normal, a, b, c].iter().flat_map(Vector3::iter) {
            bytes.extend((*x as f32).to_le_bytes());
        }
        bytes.extend([0, 0]);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Point3;

    const TEXT: &str = "solid a facet of rock\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   \
        vertex 0 1 0\n  endloop\n endfacet\n facet normal 9 9 9\n  outer loop\n   vertex 1 0 0\n   vertex 1 1 0\n   \
        vertex -0 1e0 0.0\n  endloop\n endfacet\nendsolid a\n";

    fn read_all(bytes: &[u8]) -> Result<Reading, FormatError> {
        read(bytes, &ReadLimits::default())
    }

    fn square() -> Mesh {
        let place = |x: f64, y: f64| Point3::new(x, y, 0.0);
        let vertices = vec![place(0.0, 0.0), place(1.0, 0.0), place(0.0, 1.0), place(1.0, 1.0)];
        Mesh { vertices, faces: vec![[0, 1, 2], [1, 3, 2]] }
    }

    #[test]
    fn text_and_bytes_say_the_same() {
        let of_text = read_all(TEXT.as_bytes()).expect("sound");
        assert_eq!(of_text.surface.mesh(), Some(square()));
        assert_eq!((of_text.surface.cloud.normals.clone(), of_text.surface.cloud.colors.clone()), (None, None));
        assert!(of_text.dropped.is_empty());
        assert_eq!(read_all(&write_mesh(&square())), Ok(of_text));
    }

    #[test]
    fn a_binary_file_may_begin_with_solid() {
        let mut bytes = write_mesh(&square());
        for header in ["solid", "solid model\nfacet normal 0 0 1\nouter loop\n"] {
            bytes[..header.len()].copy_from_slice(header.as_bytes());
            assert_eq!(read_all(&bytes).expect("binary").surface.mesh(), Some(square()));
            let cut = read_all(&bytes[..bytes.len() - 1]).expect_err("cut short").to_string();
            assert!(cut.contains("it declares 2 facets but ends within the 99 bytes after its header"), "{cut}");
        }
        bytes.extend(b"tail");
        let reading = read_all(&bytes).expect("binary");
        assert_eq!(reading.surface.mesh(), Some(square()));
        assert_eq!(reading.dropped.notes, ["4 bytes behind the last facet are not read"]);
    }

    #[test]
    fn blanks_line_ends_letters_and_several_solids_do_not_matter() {
        let two = format!("{TEXT}\n{}", TEXT.replace("vertex 1 0 0", "vertex 1 0 5"));
        assert_eq!(read_all(two.as_bytes()).expect("two solids").surface.faces.len(), 4);
        for text in [
            TEXT.replace('\n', "\r\n"),
            TEXT.replace('\n', "\r"),
            TEXT.to_uppercase(),
            TEXT.replace(" a facet of rock\n", " ").replace('\n', " "),
            format!("\u{feff}\n {TEXT}"),
            TEXT.replace("solid a facet of rock\n", "solid vertex endloop\n"),
        ] {
            let reading = read_all(text.as_bytes()).expect(&text);
            assert_eq!(reading.surface.mesh(), Some(square()), "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_by_facet_and_line() {
        let repair = "; repair the file or export it again";
        let cases = [
            (TEXT.replace("vertex 1 1 0", "vertex 1 one 0"), "facet 1 (line 12): \"one\" is no number"),
            (TEXT.replace("vertex 1 1 0", "vertex 1 1e20 0"), "facet 1 (line 14): y is 1e20, which is too large to be"),
            (TEXT.replace("   vertex 1 1 0\n", ""), "facet 1 (line 13): it has 2 corners, not three"),
            (
                TEXT.replace("vertex 1 1 0", "vertex 1 1 0 vertex 2 2 2"),
                "facet 1 (line 13): it has more than three corners",
            ),
            (
                TEXT.replace("vertex 1 1 0", "vertx 1 1 0"),
                "facet 1 (line 12): \"vertx\" stands where a vertex or endloop",
            ),
        ];
        for (text, message) in cases {
            let error = read_all(text.as_bytes()).expect_err(&text).to_string();
            assert!(error.starts_with(message) && error.ends_with(repair), "{error}");
        }
        let message = |text: &[u8]| read_all(text).expect_err("refused").to_string();
        for empty in [&b"solid a\nendsolid a\n"[..], &[0; HEAD]] {
            assert_eq!(message(empty), "the whole file: there are no facets; send an STL file with facets");
        }
        assert!(message(b"").ends_with("this one is empty; send an STL file, ASCII or binary"));
        assert!(message(b"Dear scanner,\n").contains("this one begins with \"Dear scanner,\\n\""));
        let cut = &TEXT[..TEXT.find("1 1 0").expect("it is there")];
        assert!(
            message(cut.as_bytes()).starts_with("the file is cut short: it declares a vertex but ends within facet 1")
        );
        let cut = &TEXT[..TEXT.rfind("endloop").expect("it is there")];
        assert!(
            message(cut.as_bytes()).starts_with("the file is cut short: it declares endloop but ends within facet 1")
        );
    }

    #[test]
    fn what_is_not_sound_costs_its_facet() {
        let reading = read_all(TEXT.replace("vertex 1 1 0", "vertex 1 nan 0").as_bytes()).expect("one is sound");
        assert_eq!((reading.surface.cloud.len(), reading.surface.faces.len(), reading.dropped.faces), (3, 1, 1));
        let cut = TEXT.replace("endsolid a\n", "");
        let notes = read_all(cut.as_bytes()).expect("whole facets").dropped.notes;
        assert_eq!(notes, ["there is no endsolid: the file may be cut short"]);
        let none = TEXT.replace("vertex 0 0 0", "vertex inf 0 0").replace("vertex 1 1 0", "vertex nan 1 0");
        assert!(read_all(none.as_bytes()).expect_err("nothing").to_string().contains("no coordinates are finite"));
    }

    #[test]
    fn limits_hold() {
        let limited = |bytes: &[u8], max_points, max_faces| {
            read(bytes, &ReadLimits { max_points, max_faces, ..ReadLimits::default() })
        };
        for bytes in [TEXT.as_bytes(), &write_mesh(&square())] {
            assert!(limited(bytes, 4, 2).is_ok());
            assert_eq!(limited(bytes, 3, 2), Err(FormatError::TooLarge { what: "points", found: 4, limit: 3 }));
            assert_eq!(limited(bytes, 4, 1), Err(FormatError::TooLarge { what: "faces", found: 2, limit: 1 }));
        }
    }

    #[test]
    fn what_is_written_begins_as_no_text_and_has_normals() {
        let bytes = write_mesh(&square());
        assert_eq!(bytes.len(), HEAD + 2 * FACET);
        assert!(!bytes.starts_with(b"solid"));
        assert_eq!(bytes[HEAD + 8..HEAD + 12], 1.0f32.to_le_bytes(), "z of the first normal");
    }
}
