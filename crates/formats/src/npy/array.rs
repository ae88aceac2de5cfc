//! The header of an array, and its numbers.

use crate::{FormatError, quote};

const MAGIC: &[u8] = b"\x93NUMPY";
/// A header longer than this is no header (bytes).
const MAX_HEADER: usize = 1 << 16;
/// Fields of a structured array at most.
const MOST_FIELDS: usize = 256;

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Scalar {
    pub(super) kind: Kind,
    pub(super) size: usize,
    is_big: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Float,
    Signed,
    Unsigned,
    /// Something else, which is passed over.
    Other,
}

impl Scalar {
    /// `<f4`, `|u1`, `>i8`.
    fn of(code: &str) -> Option<Self> {
        let mut signs = code.chars();
        let order = signs.next()?;
        let (kind, size): (char, &str) = (signs.next()?, signs.as_str());
        let size: usize = size.parse().ok()?;
        let kind = match (kind, size) {
            ('f', 2 | 4 | 8) => Kind::Float,
            ('i', 1 | 2 | 4 | 8) => Kind::Signed,
            ('u', 1 | 2 | 4 | 8) | ('b', 1) => Kind::Unsigned,
            // texts of four bytes a sign, and what is kept as it is
            ('U', 0..MAX_HEADER) => return Some(Scalar { kind: Kind::Other, size: size * 4, is_big: false }),
            ('S' | 'V' | 'c' | 'M' | 'm' | 'f', 0..MAX_HEADER) => Kind::Other,
            _ => return None,
        };
        matches!(order, '<' | '>' | '|' | '=').then_some(Scalar { kind, size, is_big: order == '>' })
    }

    /// The number in these bytes.
    #[inline]
    pub(super) fn number(self, bytes: &[u8]) -> f64 {
        let mut wide = [0u8; 8];
        let size = bytes.len().min(8);
        wide[..size].copy_from_slice(&bytes[..size]);
        if self.is_big {
            wide[..size].reverse();
        }
        let bits = u64::from_le_bytes(wide);
        let unused = 64 - 8 * size.max(1) as u32;
        match (self.kind, self.size) {
            (Kind::Float, 2) => half(bits as u16),
            (Kind::Float, 4) => f32::from_bits(bits as u32).into(),
            (Kind::Float, _) => f64::from_bits(bits),
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, _) => (((bits << unused) as i64) >> unused) as f64,
            (Kind::Other, _) => f64::NAN,
        }
    }
}

/// A float of two bytes.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// A column of an array: in a structured one a field has a name, and perhaps several numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    /// Empty in a plain array.
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) count: usize,
}

/// An array as its header describes it, with the bytes of its numbers, whose length has been checked.
#[derive(Debug)]
pub(super) struct Array<'a> {
    pub(super) shape: Vec<u64>,
    is_fortran: bool,
    pub(super) fields: Vec<Field>,
    /// Whether the fields have names.
    pub(super) is_structured: bool,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, FormatError> {
        let wrong = |problem: String| FormatError::malformed("header", problem, "save the array again with numpy.save");
        let cut = || FormatError::Truncated {
            declared: "the header of an array".into(),
            found: format!("its {} bytes", bytes.len()),
        };
        if !bytes.starts_with(MAGIC) {
            let begins = if bytes.is_empty() { "is empty".to_owned() } else { format!("begins with {}", quote(bytes)) };
            let problem = format!("an array of NumPy begins with \\x93NUMPY, this file {begins}");
            return Err(FormatError::malformed("byte 0", problem, "save the array with numpy.save"));
        }
        let rest = &bytes[MAGIC.len()..];
        let (length, start) = match rest {
            [1, _, a, b, ..] => (usize::from(u16::from_le_bytes([*a, *b])), 4),
            [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 6),
            [_, _, _, _, ..] => return Err(wrong(format!("its version is {}, which is not known here", rest[0]))),
            _ => return Err(cut()),
        };
        if length > MAX_HEADER {
            return Err(wrong(format!("it is longer than {MAX_HEADER} bytes")));
        }
        let header = rest.get(start..start + length).ok_or_else(cut)?;
        let header = std::str::from_utf8(header).map_err(|_| wrong("it is no text".into()))?;
        let value = |key: &str| {
            let found = header.find(&format!("'{key}':")).map(|place| header[place + key.len() + 3..].trim_start());
            found.ok_or_else(|| wrong(format!("there is no {key} in it")))
        };
        let is_fortran = value("fortran_order")?.starts_with("True");
        let broken = |key: &str| wrong(format!("its {key} can't be read: {}", quote(header.as_bytes())));
        let shape = shape_of(value("shape")?).ok_or_else(|| broken("shape"))?;
        let descr = value("descr")?;
        let is_structured = descr.starts_with('[');
        let fields = fields_of(descr).ok_or_else(|| {
            let problem = format!("its type can't be read: {}", quote(descr.as_bytes()));
            FormatError::malformed("header", problem, "save an array of floats or whole numbers")
        })?;
        let mut array = Array { shape, is_fortran, fields, is_structured, data: &rest[start + length..] };
        let needed = array.shape.iter().try_fold(array.stride() as u64, |bytes, length| bytes.checked_mul(*length));
        match needed.filter(|needed| *needed <= array.data.len() as u64) {
            Some(needed) => array.data = &array.data[..needed as usize],
            None => {
                return Err(FormatError::Truncated {
                    declared: format!("an array of {:?}", array.shape),
                    found: format!("the {} bytes after its header", array.data.len()),
                });
            }
        }
        Ok(array)
    }

    /// Bytes of an element.
    fn stride(&self) -> usize {
        self.fields.iter().map(|field| field.scalar.size * field.count).sum()
    }

    /// Rows: points, if it is an array of points.
    pub(super) fn rows(&self) -> u64 {
        match self.shape[..] {
            [.., _] if !self.is_structured => self.shape[..self.shape.len() - 1].iter().product(),
            _ => self.shape.iter().product(),
        }
    }

    /// Numbers of a row.
    pub(super) fn columns(&self) -> usize {
        match self.shape.last() {
            Some(columns) if !self.is_structured => usize::try_from(*columns).unwrap_or(usize::MAX),
            _ => self.fields.iter().map(|field| field.count).sum(),
        }
    }

    /// The type of a column.
    pub(super) fn scalar(&self, column: usize) -> Option<Scalar> {
        self.place(column).map(|(scalar, _)| scalar)
    }

    /// The type of a column, and where it begins in a row that stands in one piece.
    fn place(&self, column: usize) -> Option<(Scalar, usize)> {
        if !self.is_structured {
            let scalar = self.fields.first()?.scalar;
            return Some((scalar, scalar.size * column));
        }
        let (mut first, mut offset) = (0, 0);
        for field in &self.fields {
            if column < first + field.count {
                return Some((field.scalar, offset + (column - first) * field.scalar.size));
            }
            first += field.count;
            offset += field.scalar.size * field.count;
        }
        None
    }

    /// Reads a column of any row.
    pub(super) fn column(&self, column: usize) -> impl Fn(u64) -> f64 + use<'_, 'a> {
        let place = self.place(column);
        let rows = self.rows() as usize;
        move |row| {
            let Some((scalar, offset)) = place else { return f64::NAN };
            let start = match (self.is_structured, self.is_fortran) {
                (true, _) => self.stride() * row as usize + offset,
                _ if self.shape.len() < 2 => scalar.size * row as usize,
                (false, false) => scalar.size * self.columns() * row as usize + offset,
                // column by column; of more than two dimensions there is none of points
                (false, true) => scalar.size * (rows * column + row as usize),
            };
            self.data.get(start..start + scalar.size).map_or(f64::NAN, |bytes| scalar.number(bytes))
        }
    }

    /// Whether the rows of an array of more dimensions stand one after the other.
    pub(super) fn has_rows(&self) -> bool {
        !self.is_fortran || self.shape.len() <= 2 || self.is_structured
    }
}

/// `(3, 4)`, `(3,)`, `()`.
fn shape_of(text: &str) -> Option<Vec<u64>> {
    let inner = text.strip_prefix('(')?.split(')').next()?;
    // numbers of Python 2 may end with L
    let lengths = inner.split(',').map(|word| word.trim().trim_end_matches('L')).filter(|word| !word.is_empty());
    lengths.map(|word| word.parse().ok()).collect()
}

/// `'<f4'`, or `[('x', '<f4'), ('normal', '<f4', (3,))]`.
fn fields_of(text: &str) -> Option<Vec<Field>> {
    if !text.starts_with('[') {
        let (code, _) = quoted(text)?;
        let scalar = Scalar::of(code).filter(|scalar| scalar.kind != Kind::Other)?;
        return Some(vec![Field { name: String::new(), scalar, count: 1 }]);
    }
    let mut fields = Vec::new();
    let mut rest = text[1..].trim_start();
    while let Some(field) = rest.strip_prefix('(') {
        let (name, after) = quoted(field.trim_start())?;
        let (code, after) = quoted(after.trim_start().strip_prefix(',')?.trim_start())?;
        let mut after = after.trim_start();
        let mut count = 1usize;
        if let Some(shape) = after.strip_prefix(',').map(str::trim_start).filter(|shape| shape.starts_with('(')) {
            for length in shape_of(shape)? {
                count = count.checked_mul(usize::try_from(length).ok()?).filter(|count| *count <= MAX_HEADER)?;
            }
            after = shape[shape.find(')')? + 1..].trim_start();
        }
        fields.push(Field { name: name.to_owned(), scalar: Scalar::of(code)?, count });
        if fields.len() > MOST_FIELDS {
            return None;
        }
        rest = after.strip_prefix(')')?.trim_start().trim_start_matches(',').trim_start();
    }
    (rest.starts_with(']') && !fields.is_empty()).then_some(fields)
}

/// A text in quotes, and what follows.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let sign = text.chars().next().filter(|sign| matches!(sign, '\'' | '"'))?;
    text[1..].split_once(sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_and_shapes_are_read() {
        let scalar = |code: &str| Scalar::of(code).expect(code);
        assert_eq!(scalar("<f4").number(&1.5f32.to_le_bytes()), 1.5);
        assert_eq!(scalar(">f8").number(&1.5f64.to_be_bytes()), 1.5);
        assert_eq!(scalar(">i2").number(&(-2i16).to_be_bytes()), -2.0);
        assert_eq!(scalar("|u1").number(&[200]), 200.0);
        assert_eq!(scalar("<u8").number(&u64::MAX.to_le_bytes()), u64::MAX as f64);
        assert_eq!(["<f2"; 4].map(scalar).map(|half| half.number(&[0, 0xc1])), [-2.5; 4]);
        assert_eq!((half(0x7c00), half(0x0001)), (f64::INFINITY, 2f64.powi(-24)));
        for code in ["", "f4", "<g8", "<O", "<i16", "?f4"] {
            assert_eq!(Scalar::of(code), None, "{code}");
        }
        assert_eq!(shape_of("(3, 4L), }"), Some(vec![3, 4]));
        assert_eq!((shape_of("(7,)"), shape_of("()"), shape_of("(x,)")), (Some(vec![7]), Some(vec![]), None));
        let fields = fields_of("[('x', '<f4'), ('n', '<f4', (3,)), ('name', '<U5')], ").expect("structured");
        assert_eq!(
            fields.iter().map(|f| (f.name.as_str(), f.count, f.scalar.size)).collect::<Vec<_>>(),
            [("x", 1, 4), ("n", 3, 4), ("name", 1, 20)]
        );
        for text in ["[]", "[('x')]", "[('x', '<f4'", "'O'", "[('x', '|O')]", "[('x', [('y', '<f4')])]"] {
            assert_eq!(fields_of(text), None, "{text}");
        }
    }
}
