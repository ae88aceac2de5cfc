//! The header of a PLY file: how the body is encoded and which elements it holds.

use crate::header_lines::HeaderLines;
use crate::{FormatError, quote};

/// A header longer than this is no header (bytes).
const MAX_HEADER: usize = 1 << 20;

/// A number type of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl ScalarType {
    /// The type of either generation of names (`uchar` and `uint8` alike).
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => ScalarType::I8,
            "uchar" | "uint8" => ScalarType::U8,
            "short" | "int16" => ScalarType::I16,
            "ushort" | "uint16" => ScalarType::U16,
            "int" | "int32" => ScalarType::I32,
            "uint" | "uint32" => ScalarType::U32,
            "int64" => ScalarType::I64,
            "uint64" => ScalarType::U64,
            "float" | "float32" => ScalarType::F32,
            "double" | "float64" => ScalarType::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub(super) fn size(self) -> usize {
        match self {
            ScalarType::I8 | ScalarType::U8 => 1,
            ScalarType::I16 | ScalarType::U16 => 2,
            ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
            ScalarType::I64 | ScalarType::U64 | ScalarType::F64 => 8,
        }
    }

    /// Whether the type holds fractions.
    pub(super) fn is_float(self) -> bool {
        matches!(self, ScalarType::F32 | ScalarType::F64)
    }
}

/// What a property holds in each row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(ScalarType),
    List { count: ScalarType, item: ScalarType },
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// A table of the body: `count` rows of the same properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// `obj_info num_cols` and `num_rows` of an organised scan.
    pub(super) grid_columns: Option<u64>,
    pub(super) grid_rows: Option<u64>,
    /// Where the body begins, bytes from the start of the file.
    pub(super) body_start: usize,
}

impl Element {
    /// The fewest bytes that one row takes in this encoding (0 for a row without properties).
    fn least_row_bytes(&self, encoding: Encoding) -> u64 {
        let least = |property: &Property| match (encoding, property.kind) {
            (Encoding::Ascii, _) => 2, // a digit and what parts it from the next
            (_, Kind::Scalar(scalar)) => scalar.size() as u64,
            (_, Kind::List { count, .. }) => count.size() as u64,
        };
        self.properties.iter().map(least).sum()
    }
}

impl Header {
    /// Checks the declared counts against the bytes that follow the header, before anything is allocated.
    pub(super) fn check_counts(&self, body_bytes: u64) -> Result<(), FormatError> {
        let mut needed = 0u64;
        for element in &self.elements {
            let bytes = element.count.saturating_mul(element.least_row_bytes(self.encoding));
            needed = needed.saturating_add(bytes);
            // the last ASCII row may lack its line end
            if needed > body_bytes.saturating_add(1) {
                return Err(FormatError::Truncated {
                    declared: format!("{} rows of {}", element.count, quote(element.name.as_bytes())),
                    found: format!("the {body_bytes} bytes after its header"),
                });
            }
        }
        Ok(())
    }

    /// The bytes of a binary body, if they are known before it is read: without lists.
    fn body_bytes(&self) -> Option<u64> {
        let mut total = 0u64;
        for element in &self.elements {
            let is_scalar = |property: &Property| matches!(property.kind, Kind::Scalar(_));
            if self.encoding == Encoding::Ascii || !element.properties.iter().all(is_scalar) {
                return None;
            }
            total = total.checked_add(element.count.checked_mul(element.least_row_bytes(self.encoding))?)?;
        }
        Some(total)
    }

    /// Parses everything up to and including `end_header`; the file begins at byte `start`.
    pub(super) fn parse(bytes: &[u8], start: usize) -> Result<Header, FormatError> {
        check_magic(&bytes[start..])?;
        let mut lines = HeaderLines::new(bytes, start, MAX_HEADER);
        let mut encoding = None;
        let mut header = Header {
            encoding: Encoding::Ascii,
            elements: Vec::new(),
            grid_columns: None,
            grid_rows: None,
            body_start: 0,
        };
        loop {
            let (number, line) = lines.next_line().ok_or_else(|| endless(bytes, lines.count()))?;
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            let broken = |problem: &str| {
                let problem = format!("{problem}: {}", quote(line.as_bytes()));
                FormatError::malformed(format!("header line {number}"), problem, "export the file again as PLY 1.0")
            };
            match words.as_slice() {
                ["end_header"] => break,
                ["format", name, ..] => encoding = Some(parse_encoding(name).ok_or_else(|| broken("unknown format"))?),
                ["format"] => return Err(broken("a format line without a format")),
                ["element", name, count] => header.elements.push(Element {
                    name: name.to_string(),
                    count: count.parse().map_err(|_| broken("an element needs a count"))?,
                    properties: Vec::new(),
                }),
                ["element", ..] => return Err(broken("an element line is `element NAME COUNT`")),
                ["property", rest @ ..] => {
                    let property = parse_property(rest).ok_or_else(|| broken("a property that can't be read"))?;
                    let element = header.elements.last_mut();
                    element.ok_or_else(|| broken("a property before any element"))?.properties.push(property);
                }
                ["obj_info", "num_cols", count] => header.grid_columns = count.parse().ok(),
                ["obj_info", "num_rows", count] => header.grid_rows = count.parse().ok(),
                // comments, other obj_info, and the stray lines that scanners left (`bye`)
                _ => {}
            }
        }
        header.encoding = encoding.ok_or_else(|| {
            FormatError::malformed("header", "there is no format line", "export the file again as PLY 1.0")
        })?;
        header.body_start = lines.body_start(header.body_bytes());
        Ok(header)
    }
}

fn parse_encoding(name: &str) -> Option<Encoding> {
    match name {
        "ascii" => Some(Encoding::Ascii),
        "binary_little_endian" => Some(Encoding::LittleEndian),
        "binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

/// The words after `property`.
fn parse_property(words: &[&str]) -> Option<Property> {
    let (kind, name) = match words {
        ["list", count, item, name] => {
            let count = ScalarType::parse(count).filter(|scalar| !scalar.is_float())?;
            (Kind::List { count, item: ScalarType::parse(item)? }, name)
        }
        [scalar, name] => (Kind::Scalar(ScalarType::parse(scalar)?), name),
        _ => return None,
    };
    Some(Property { name: name.to_string(), kind })
}

/// A file begins with the line `ply`.
fn check_magic(bytes: &[u8]) -> Result<(), FormatError> {
    if let [b'p', b'l', b'y', b'\r' | b'\n' | b' ' | b'\t', ..] = bytes {
        return Ok(());
    }
    let found = if bytes.is_empty() { "is empty".into() } else { format!("begins with {}", quote(bytes)) };
    let problem = format!("a PLY file begins with the line `ply`, this one {found}");
    Err(FormatError::malformed("byte 0", problem, "send a PLY file, ASCII or binary"))
}

/// What is wrong with a header of which so many lines were read.
fn endless(bytes: &[u8], lines: usize) -> FormatError {
    if bytes.len() > MAX_HEADER {
        let problem = format!("there is no end_header in the first {MAX_HEADER} bytes");
        return FormatError::malformed("header", problem, "export the file again as PLY 1.0");
    }
    // `end_header` as the very last word of an empty file still lacks the body
    FormatError::Truncated {
        declared: "a PLY header".into(),
        found: format!("it, before end_header (line {})", lines + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Header, FormatError> {
        Header::parse(text.as_bytes(), 0)
    }

    #[test]
    fn a_scanners_header_with_stray_lines_is_read() {
        let text = "ply\nformat ascii 1.0\nobj_info num_cols 483\nobj_info num_rows 262\nobj_info echo_frames 512\n\
                    bye\nbye\nelement vertex 3\nproperty float x\nelement range_grid 126546\n\
                    property list uchar int vertex_indices\nend_header\n1\n";
        let header = parse(text).expect("the header of a Stanford scan");
        assert_eq!((header.grid_columns, header.grid_rows), (Some(483), Some(262)));
        assert_eq!(header.elements.len(), 2);
        assert_eq!(header.elements[1].properties[0].kind, Kind::List { count: ScalarType::U8, item: ScalarType::I32 });
        assert_eq!(&text[header.body_start..], "1\n");
    }

    #[test]
    fn every_kind_of_line_end_is_read() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["ply", "format binary_big_endian 1.0", "element vertex 0", "end_header", "BODY"].join(end);
            let header = parse(&text).expect("line ends differ");
            assert_eq!(header.encoding, Encoding::BigEndian);
            assert_eq!(&text[header.body_start..], "BODY");
        }
    }

    #[test]
    fn broken_headers_name_the_line() {
        let cases = [
            ("hello", "byte 0: a PLY file begins with the line `ply`, this one begins with \"hello\""),
            ("", "byte 0: a PLY file begins with the line `ply`, this one is empty"),
            ("ply\nformat utf9 1.0\nend_header\n", "header line 2: unknown format: \"format utf9 1.0\""),
            ("ply\nformat ascii 1.0\nelement vertex many\n", "header line 3: an element needs a count"),
            ("ply\nformat ascii 1.0\nelement vertex -1\n", "header line 3: an element needs a count"),
            ("ply\nproperty float x\n", "header line 2: a property before any element"),
            ("ply\nelement vertex 1\nproperty list float int i\n", "header line 3: a property that can't be read"),
            ("ply\nend_header\n", "header: there is no format line"),
            ("ply\nformat ascii 1.0\n", "the file is cut short: it declares a PLY header"),
        ];
        for (text, message) in cases {
            let error = parse(text).expect_err(text).to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }

    #[test]
    fn counts_beyond_the_file_are_found_before_reading() {
        let header =
            parse("ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\nproperty float x\nend_header\n")
                .expect("a sound header");
        let error = header.check_counts(120).expect_err("there are 120 bytes only").to_string();
        assert_eq!(
            error,
            "the file is cut short: it declares 1000000000000 rows of \"vertex\" but ends within the 120 bytes \
             after its header; export or upload it again"
        );
        assert!(header.check_counts(u64::MAX - 1).is_ok());
    }
}
