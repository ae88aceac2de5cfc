//! The body of a PLY file as rows of numbers, whatever the encoding.

use super::header::{Kind, Property, ScalarType};
use crate::formats::{FormatError, quote};

/// What is wrong at the current place of a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    /// The bytes ran out.
    End,
    /// Something that should not be there.
    Wrong(String),
}

impl Fault {
    /// The error with its place: the row of an element, and the line or byte.
    #[cold]
    pub(super) fn at(self, element: &str, row: usize, declared: u64, body: &impl Body) -> FormatError {
        // names of elements come from the file: short and printable before they go into a message
        let element = quote(element.as_bytes());
        let place = format!("{} {row} ({})", element.trim_matches('"'), body.place());
        match self {
            Fault::End => FormatError::Truncated { declared: format!("{declared} rows of {element}"), found: place },
            Fault::Wrong(problem) => FormatError::malformed(place, problem, "repair the file or export it again"),
        }
    }
}

/// Rows of numbers, read from front to back.
pub(super) trait Body {
    /// Goes to the start of the next row.
    fn begin_row(&mut self) -> Result<(), Fault>;
    /// The next number of the row.
    fn number(&mut self, scalar: ScalarType) -> Result<f64, Fault>;
    /// The next number of the row, which must be whole.
    fn integer(&mut self, scalar: ScalarType) -> Result<i64, Fault>;
    /// Checks that the row holds no more.
    fn end_row(&mut self) -> Result<(), Fault>;
    /// Where the cursor is, for messages.
    fn place(&self) -> String;

    /// The length of a list that comes next.
    #[inline]
    fn list_length(&mut self, count: ScalarType) -> Result<u64, Fault> {
        let length = self.integer(count)?;
        u64::try_from(length).map_err(|_| Fault::Wrong(format!("a list can't have {length} entries")))
    }

    /// Passes over one property.
    fn skip(&mut self, kind: Kind) -> Result<(), Fault> {
        match kind {
            Kind::Scalar(scalar) => self.number(scalar).map(|_| ()),
            Kind::List { count, item } => {
                for _ in 0..self.list_length(count)? {
                    self.number(item)?;
                }
                Ok(())
            }
        }
    }

    /// Passes over one row.
    fn skip_row(&mut self, properties: &[Property]) -> Result<(), Fault> {
        self.begin_row()?;
        for property in properties {
            self.skip(property.kind)?;
        }
        self.end_row()
    }
}

/// A text body: each row is a line.
pub(super) struct Ascii<'a> {
    bytes: &'a [u8],
    position: usize,
    /// Where the body begins in `bytes`.
    start: usize,
}

impl<'a> Ascii<'a> {
    /// The body of `file` that begins at byte `start`.
    pub(super) fn new(file: &'a [u8], start: usize) -> Self {
        Ascii { bytes: file, position: start, start }
    }

    #[inline]
    fn skip_blanks(&mut self) {
        while let Some(b' ' | b'\t') = self.bytes.get(self.position) {
            self.position += 1;
        }
    }

    /// Goes to the next number of this line.
    #[inline]
    fn begin_number(&mut self) -> Result<&'a [u8], Fault> {
        self.skip_blanks();
        match self.bytes.get(self.position) {
            None => Err(Fault::End),
            Some(b'\n' | b'\r') => Err(Fault::Wrong("the line has fewer numbers than the header declares".into())),
            Some(_) => Ok(&self.bytes[self.position..]),
        }
    }

    /// Accepts a number of `length` bytes if it ends there.
    #[inline]
    fn end_number(&mut self, length: usize) -> Result<(), Fault> {
        match self.bytes.get(self.position + length) {
            None | Some(b' ' | b'\t' | b'\n' | b'\r') => {
                self.position += length;
                Ok(())
            }
            Some(_) => Err(self.no_number("number")),
        }
    }

    #[cold]
    fn no_number(&self, wanted: &str) -> Fault {
        let rest = &self.bytes[self.position..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        Fault::Wrong(format!("{} is no {wanted}", quote(&rest[..length])))
    }
}

impl Body for Ascii<'_> {
    #[inline]
    fn begin_row(&mut self) -> Result<(), Fault> {
        while let Some(b' ' | b'\t' | b'\n' | b'\r') = self.bytes.get(self.position) {
            self.position += 1;
        }
        if self.position < self.bytes.len() { Ok(()) } else { Err(Fault::End) }
    }

    #[inline]
    fn number(&mut self, _scalar: ScalarType) -> Result<f64, Fault> {
        let rest = self.begin_number()?;
        let (value, length) = fast_float2::parse_partial::<f64, _>(rest).map_err(|_| self.no_number("number"))?;
        self.end_number(length)?;
        Ok(value)
    }

    #[inline]
    fn integer(&mut self, _scalar: ScalarType) -> Result<i64, Fault> {
        let rest = self.begin_number()?;
        let negative = rest[0] == b'-';
        let mut value = 0i64;
        let mut length = usize::from(negative);
        while let Some(digit) = rest.get(length).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            // more digits than any declared type has
            if length > 11 {
                return Err(self.no_number("index or count"));
            }
            value = value * 10 + i64::from(digit);
            length += 1;
        }
        if length == usize::from(negative) {
            return Err(self.no_number("whole number"));
        }
        self.end_number(length)?;
        Ok(if negative { -value } else { value })
    }

    #[inline]
    fn end_row(&mut self) -> Result<(), Fault> {
        self.skip_blanks();
        match self.bytes.get(self.position) {
            None | Some(b'\n' | b'\r') => Ok(()),
            Some(_) => Err(Fault::Wrong("the line has more numbers than the header declares".into())),
        }
    }

    fn place(&self) -> String {
        let body = &self.bytes[self.start.min(self.position)..self.position];
        let head = &self.bytes[..self.start.min(self.position)];
        // files of old Macintoshes end their lines with CR alone
        let line_end = if head.contains(&b'\n') { b'\n' } else { b'\r' };
        let count = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == line_end).count();
        format!("line {}", count(head) + count(body) + 1)
    }
}

/// A binary body; `BIG` tells the byte order.
pub(super) struct Binary<'a, const BIG: bool> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    /// The body of `file` that begins at byte `start`.
    pub(super) fn new(file: &'a [u8], start: usize) -> Self {
        Binary { bytes: file, position: start }
    }

    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut taken = *self.bytes.get(self.position..).and_then(<[u8]>::first_chunk::<N>).ok_or(Fault::End)?;
        self.position += N;
        if BIG {
            taken.reverse();
        }
        Ok(taken)
    }
}

impl<const BIG: bool> Body for Binary<'_, BIG> {
    #[inline]
    fn begin_row(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    #[inline]
    fn number(&mut self, scalar: ScalarType) -> Result<f64, Fault> {
        match scalar {
            ScalarType::F32 => self.take().map(|bytes| f64::from(f32::from_le_bytes(bytes))),
            ScalarType::F64 => self.take().map(f64::from_le_bytes),
            _ => self.integer(scalar).map(|value| value as f64),
        }
    }

    #[inline]
    fn integer(&mut self, scalar: ScalarType) -> Result<i64, Fault> {
        Ok(match scalar {
            ScalarType::I8 => i64::from(i8::from_le_bytes(self.take()?)),
            ScalarType::U8 => i64::from(u8::from_le_bytes(self.take()?)),
            ScalarType::I16 => i64::from(i16::from_le_bytes(self.take()?)),
            ScalarType::U16 => i64::from(u16::from_le_bytes(self.take()?)),
            ScalarType::I32 => i64::from(i32::from_le_bytes(self.take()?)),
            ScalarType::U32 => i64::from(u32::from_le_bytes(self.take()?)),
            ScalarType::F32 | ScalarType::F64 => {
                return Err(Fault::Wrong("a list of indices can't be of a floating type".into()));
            }
        })
    }

    #[inline]
    fn end_row(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    fn place(&self) -> String {
        format!("byte {}", self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_rows_must_have_as_many_numbers_as_declared() {
        let mut body = Ascii::new(b"1 2\r\n  -3\n", 0);
        body.begin_row().expect("a first row");
        assert_eq!(body.number(ScalarType::F32), Ok(1.0));
        assert_eq!(body.end_row(), Err(Fault::Wrong("the line has more numbers than the header declares".into())));
        assert_eq!(body.integer(ScalarType::I32), Ok(2));
        assert!(matches!(body.number(ScalarType::F32), Err(Fault::Wrong(problem)) if problem.contains("fewer")));
        body.begin_row().expect("a second row");
        assert_eq!(body.integer(ScalarType::I32), Ok(-3));
        assert_eq!(body.place(), "line 2");
        assert_eq!(body.begin_row(), Err(Fault::End));
    }

    #[test]
    fn text_that_is_no_number_is_quoted() {
        let mut body = Ascii::new(b"12abc 7", 0);
        assert_eq!(body.number(ScalarType::F32), Err(Fault::Wrong("\"12abc\" is no number".into())));
        assert_eq!(body.integer(ScalarType::I32), Err(Fault::Wrong("\"12abc\" is no number".into())));
        let mut body = Ascii::new(b"99999999999999999999 -", 0);
        assert!(matches!(body.integer(ScalarType::U32), Err(Fault::Wrong(_))));
        let mut body = Ascii::new(b"-", 0);
        assert_eq!(body.integer(ScalarType::U32), Err(Fault::Wrong("\"-\" is no whole number".into())));
    }

    #[test]
    fn both_byte_orders_are_read() {
        let bytes = 258u16.to_be_bytes();
        assert_eq!(Binary::<true>::new(&bytes, 0).number(ScalarType::U16), Ok(258.0));
        assert_eq!(Binary::<false>::new(&bytes, 0).number(ScalarType::U16), Ok(513.0));
        let bytes = (-1.5f32).to_be_bytes();
        assert_eq!(Binary::<true>::new(&bytes, 0).number(ScalarType::F32), Ok(-1.5));
        assert_eq!(Binary::<true>::new(&bytes, 1).number(ScalarType::F32), Err(Fault::End));
        assert_eq!(Binary::<true>::new(&bytes, 9).number(ScalarType::F32), Err(Fault::End));
    }
}
