//! The header of a PCD file: which fields each point has and how they are stored.

use crate::header_lines::HeaderLines;
use crate::{FormatError, quote, text_start};

/// A header longer than this is no header (bytes).
const MAX_HEADER: usize = 1 << 16;
/// More values than this are no measurement of a point.
const MAX_VALUES: usize = 1 << 12;

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberType {
    Signed,
    Unsigned,
    Float,
}

/// One field of a point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: NumberType,
    /// Bytes of one value.
    pub(super) size: usize,
    /// Values it has.
    pub(super) count: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    /// Points in a row.
    pub(super) width: u64,
    /// Rows; 1 for a cloud that is not organised.
    pub(super) height: u64,
    /// Position of the sensor in the frame of the points.
    pub(super) viewpoint: Option<[f64; 3]>,
    /// Whether there is a viewpoint that can't be read.
    pub(super) has_bad_viewpoint: bool,
    pub(super) encoding: Encoding,
    /// Where the data begins, bytes from the start of the file.
    pub(super) body_start: usize,
    /// Lines before the data.
    pub(super) lines: usize,
}

impl Header {
    /// Points, those that are NaN included; checked against overflow when the header was parsed.
    pub(super) fn points(&self) -> u64 {
        self.width * self.height
    }

    /// Bytes of binary data that is not compressed.
    fn body_bytes(&self) -> Option<u64> {
        let is_plain = self.encoding == Encoding::Binary;
        self.points().checked_mul(self.stride() as u64).filter(|_| is_plain)
    }

    /// Bytes of a point in binary data.
    pub(super) fn stride(&self) -> usize {
        self.fields.iter().map(|field| field.size * field.count).sum()
    }

    /// Parses everything up to and including the `DATA` line.
    pub(super) fn parse(bytes: &[u8]) -> Result<Header, FormatError> {
        let mut draft = Draft::default();
        let mut lines = HeaderLines::new(bytes, text_start(bytes)?, MAX_HEADER);
        while let Some((number, line)) = lines.next_line() {
            // a comment may stand behind the values too
            let values = line.split('#').next().unwrap_or_default();
            let words: Vec<&str> = values.split_ascii_whitespace().collect();
            match draft.take(&words) {
                Ok(None) => {}
                Ok(Some(encoding)) => {
                    let mut header = draft.finish(encoding)?;
                    header.body_start = lines.body_start(header.body_bytes());
                    header.lines = lines.count();
                    return Ok(header);
                }
                Err(problem) => {
                    let problem = format!("{problem}: {}", quote(line.as_bytes()));
                    return Err(malformed(format!("header line {number}"), problem));
                }
            }
        }
        Err(malformed("header", "there is no DATA line"))
    }
}

fn malformed(place: impl Into<String>, problem: impl Into<String>) -> FormatError {
    FormatError::malformed(place, problem, "export the file again as PCD 0.7")
}

/// What has been read of a header so far.
#[derive(Default)]
struct Draft {
    names: Vec<String>,
    sizes: Vec<usize>,
    types: Vec<NumberType>,
    counts: Option<Vec<usize>>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    viewpoint: Option<[f64; 3]>,
    has_bad_viewpoint: bool,
}

impl Draft {
    /// Takes a line; answers with the encoding if it was the last one.
    fn take(&mut self, words: &[&str]) -> Result<Option<Encoding>, &'static str> {
        let Some((keyword, values)) = words.split_first() else { return Ok(None) };
        match *keyword {
            "FIELDS" | "COLUMNS" => self.names = values.iter().map(|name| name.to_ascii_lowercase()).collect(),
            "SIZE" => self.sizes = parsed(values, |size| matches!(size, 1 | 2 | 4 | 8))?,
            "TYPE" => self.types = values.iter().map(|name| number_type(name)).collect::<Result<_, _>>()?,
            "COUNT" => self.counts = Some(parsed(values, |count| (1..=MAX_VALUES).contains(count))?),
            "WIDTH" => self.width = Some(single(values)?),
            "HEIGHT" => self.height = Some(single(values)?),
            "POINTS" => self.points = Some(single(values)?),
            "VIEWPOINT" => {
                let numbers: Vec<f64> = values.iter().filter_map(|value| value.parse().ok()).collect();
                match numbers[..] {
                    [x, y, z, _, _, _, _] if numbers.iter().all(|v| v.is_finite()) => self.viewpoint = Some([x, y, z]),
                    _ => self.has_bad_viewpoint = true,
                }
            }
            "DATA" => {
                return match values {
                    ["ascii"] => Ok(Some(Encoding::Ascii)),
                    ["binary"] => Ok(Some(Encoding::Binary)),
                    ["binary_compressed"] => Ok(Some(Encoding::Compressed)),
                    _ => Err("unknown kind of data"),
                };
            }
            // comments, the version, and what later versions may add
            _ => {}
        }
        Ok(None)
    }

    fn finish(self, encoding: Encoding) -> Result<Header, FormatError> {
        let counts = self.counts.unwrap_or_else(|| vec![1; self.names.len()]);
        let same = [self.sizes.len(), self.types.len(), counts.len()].iter().all(|n| *n == self.names.len());
        if self.names.is_empty() || !same {
            return Err(malformed("header", "FIELDS, SIZE, TYPE and COUNT don't have the same number of entries"));
        }
        if counts.iter().sum::<usize>() > MAX_VALUES {
            return Err(malformed("header", format!("a point has more than {MAX_VALUES} values")));
        }
        let fields = self.names.into_iter().zip(self.types).zip(self.sizes.into_iter().zip(counts));
        let fields = fields.map(|((name, number), (size, count))| Field { name, number, size, count }).collect();
        // files of version 0.5 may state the points alone; some programs leave 0 in the other two
        let is_stated = |count: &u64| *count > 0 || self.points.is_none();
        let size = self.width.filter(is_stated).zip(self.height.or(Some(1)).filter(is_stated));
        let (width, height) = match size.or(self.points.map(|points| (points, 1))) {
            Some(size) => size,
            None => return Err(malformed("header", "there is no WIDTH line")),
        };
        let points = width.checked_mul(height);
        if points.is_none() || self.points.is_some_and(|stated| Some(stated) != points) {
            let stated = self.points.unwrap_or(u64::MAX);
            return Err(malformed("header", format!("WIDTH {width} x HEIGHT {height} does not give {stated} POINTS")));
        }
        Ok(Header {
            fields,
            width,
            height,
            viewpoint: self.viewpoint,
            has_bad_viewpoint: self.has_bad_viewpoint,
            encoding,
            body_start: 0,
            lines: 0,
        })
    }
}

fn number_type(name: &str) -> Result<NumberType, &'static str> {
    match name {
        "I" => Ok(NumberType::Signed),
        "U" => Ok(NumberType::Unsigned),
        "F" => Ok(NumberType::Float),
        _ => Err("a type is I, U or F"),
    }
}

fn parsed(values: &[&str], is_allowed: impl Fn(&usize) -> bool) -> Result<Vec<usize>, &'static str> {
    let number = |value: &&str| value.parse().ok().filter(&is_allowed).ok_or("a number that is not allowed here");
    values.iter().map(number).collect()
}

fn single(values: &[&str]) -> Result<u64, &'static str> {
    match values {
        [value] => value.parse().map_err(|_| "a count is needed"),
        _ => Err("one count is needed"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOUND: &str = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\n\
                         TYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 4\nHEIGHT 2\nVIEWPOINT 0.5 0 -1 1 0 0 0\nPOINTS 8\nDATA binary\n";

    #[test]
    fn a_header_is_read_to_the_byte_where_the_data_begins() {
        let header = Header::parse(SOUND.as_bytes()).expect("sound");
        assert_eq!((header.width, header.height, header.points(), header.stride()), (4, 2, 8, 16));
        assert_eq!((header.encoding, header.body_start, header.lines), (Encoding::Binary, SOUND.len(), 11));
        assert_eq!(header.viewpoint, Some([0.5, 0.0, -1.0]));
        assert_eq!(header.fields[3].number, NumberType::Unsigned);
    }

    #[test]
    fn comments_behind_values_empty_sizes_and_bad_viewpoints_are_passed_over() {
        let text = SOUND.replace("z rgb", "z rgb # XYZ data").replace("POINTS 8", "POINTS 8#");
        assert_eq!(Header::parse(text.as_bytes()).expect("comments").fields.len(), 4);
        for size in ["WIDTH 0\nHEIGHT 0", "WIDTH 8\nHEIGHT 0", "HEIGHT 1", ""] {
            let header = Header::parse(SOUND.replace("WIDTH 4\nHEIGHT 2", size).as_bytes()).expect(size);
            assert_eq!((header.width, header.height), (8, 1), "{size}");
        }
        let header = Header::parse(SOUND.replace("VIEWPOINT 0.5 0 -1 1", "VIEWPOINT 0").as_bytes()).expect("sound");
        assert!(header.has_bad_viewpoint && header.viewpoint.is_none());
    }

    #[test]
    fn broken_headers_name_the_line() {
        let cases = [
            ("SIZE 4 4 4 4", "SIZE 4 4 4 3", "header line 4: a number that is not allowed here"),
            ("TYPE F F F U", "TYPE F F F X", "header line 5: a type is I, U or F"),
            ("COUNT 1 1 1 1", "COUNT 1 1 1", "header: FIELDS, SIZE, TYPE and COUNT"),
            ("COUNT 1 1 1 1", "COUNT 1 1 1 99999999", "header line 6: a number that is not allowed here"),
            ("WIDTH 4", "WIDTH many", "header line 7: a count is needed"),
            ("HEIGHT 2", "HEIGHT 3", "header: WIDTH 4 x HEIGHT 3 does not give 8 POINTS"),
            ("WIDTH 4", "WIDTH 18446744073709551615", "header: WIDTH"),
            ("DATA binary", "DATA zip", "header line 11: unknown kind of data"),
            ("DATA binary\n", "", "header: there is no DATA line"),
        ];
        for (sound, broken, message) in cases {
            let text = SOUND.replace(sound, broken);
            let error = Header::parse(text.as_bytes()).expect_err(broken).to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
