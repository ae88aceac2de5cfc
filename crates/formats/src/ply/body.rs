//! The body of a PLY file as rows of numbers, whatever the encoding.

use super::header::{Kind, Property, ScalarType};
use crate::points::{packed_color, packed_color_of};
use crate::{FormatError, number, quote};

/// What is wrong at the current place of a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    /// The bytes ran out.
    End,
    /// Something that should not be there.
    Wrong(String),
    /// More than is allowed; it names no place.
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
            Fault::Refused(error) => error,
        }
    }
}

/// Rows of numbers, read from front to back.
pub(super) trait Body {
    /// Comes to the rows of the next element.
    fn begin_element(&mut self) {}
    /// Checks how the rows of an element stand in the file, after the last one.
    fn end_element(&mut self) -> Result<(), Fault> {
        Ok(())
    }
    /// Checks what comes after the last element.
    fn end(&mut self) -> Result<(), Fault> {
        Ok(())
    }
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

    /// Takes the next row if it is a line of these numbers as nearly all are written; else nothing is taken, and the row is
    /// read number by number, which also says what is wrong with it.
    #[inline]
    fn plain_row(&mut self, _slots: &[usize], _values: &mut [f64]) -> bool {
        false
    }

    /// The next number of the row, a colour packed into four bytes.
    fn packed(&mut self, scalar: ScalarType) -> Result<f64, Fault>;

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

/// A text body. Each row is a line, unless the lines are `FREE`: then a row may take several lines, or a line hold
/// several rows, if all rows of an element are alike in that. What is neither may lack a number, and would be read
/// shifted.
pub(super) struct Ascii<'a, const FREE: bool> {
    bytes: &'a [u8],
    position: usize,
    /// Where the body begins in `bytes`.
    start: usize,
    lines: Lines,
}

/// How the rows of an element stand in lines.
#[derive(Debug, Clone, Default)]
struct Lines {
    /// Numbers of this row so far, and after which of them (below 64) a line ended.
    numbers: u32,
    breaks: u64,
    /// The same of the first row.
    first: Option<(u32, u64)>,
    /// Whether every row so far began with a line, was parted as the first one, was in one line.
    all_begin_lines: bool,
    all_alike: bool,
    all_whole: bool,
}

impl<'a, const FREE: bool> Ascii<'a, FREE> {
    /// The body of `file` that begins at byte `start`.
    pub(super) fn new(file: &'a [u8], start: usize) -> Self {
        Ascii { bytes: file, position: start, start, lines: Lines::default() }
    }

    #[inline]
    fn skip_blanks(&mut self) {
        while let Some(b' ' | b'\t') = self.bytes.get(self.position) {
            self.position += 1;
        }
    }

    /// Passes over blanks and the ends of lines; whether there was one of these.
    fn skip_lines(&mut self) -> bool {
        let mut line_ended = false;
        while let Some(byte @ (b' ' | b'\t' | b'\n' | b'\r')) = self.bytes.get(self.position) {
            line_ended |= matches!(byte, b'\n' | b'\r');
            self.position += 1;
        }
        line_ended
    }

    /// Goes to the next number of this line.
    #[inline]
    fn begin_number(&mut self) -> Result<&'a [u8], Fault> {
        if FREE {
            if self.skip_lines() && self.lines.numbers > 0 {
                self.lines.breaks |= 1u64.checked_shl(self.lines.numbers).unwrap_or(1);
            }
            self.lines.numbers += 1;
        } else {
            self.skip_blanks();
        }
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

    /// The word at the cursor.
    fn word(&self) -> &'a [u8] {
        let rest = &self.bytes[self.position..];
        &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())]
    }

    /// A number in another spelling.
    #[cold]
    fn spelled(&mut self) -> Result<f64, Fault> {
        let word = self.word();
        let value = number::spelled(word).ok_or_else(|| self.no_number("number"))?;
        self.position += word.len();
        Ok(value)
    }

    #[cold]
    fn no_number(&self, wanted: &str) -> Fault {
        Fault::Wrong(format!("{} is no {wanted}", quote(self.word())))
    }
}

impl<const FREE: bool> Body for Ascii<'_, FREE> {
    fn begin_element(&mut self) {
        self.lines = Lines { all_begin_lines: true, all_alike: true, all_whole: true, ..Lines::default() };
    }

    #[inline]
    fn begin_row(&mut self) -> Result<(), Fault> {
        // the body begins a line
        let line_began = self.position == self.start;
        let line_ended = self.skip_lines();
        if FREE {
            self.lines.all_begin_lines &= line_began || line_ended;
            (self.lines.numbers, self.lines.breaks) = (0, 0);
        }
        if self.position < self.bytes.len() { Ok(()) } else { Err(Fault::End) }
    }

    #[inline]
    fn number(&mut self, _scalar: ScalarType) -> Result<f64, Fault> {
        let rest = self.begin_number()?;
        let Some((value, length)) = number::leading(rest) else { return self.spelled() };
        match self.end_number(length) {
            Ok(()) => Ok(value),
            Err(_) => self.spelled(),
        }
    }

    #[inline]
    fn plain_row(&mut self, slots: &[usize], values: &mut [f64]) -> bool {
        if FREE {
            return false;
        }
        let mut at = self.position;
        // the end of the line before it
        at += usize::from(self.bytes.get(at) == Some(&b'\r'));
        at += usize::from(self.bytes.get(at) == Some(&b'\n'));
        for slot in slots {
            let rest = self.bytes.get(at..).unwrap_or_default();
            let (Some((value, length)), Some(slot)) = (number::plain(rest), values.get_mut(*slot)) else {
                return false;
            };
            *slot = value;
            at += length;
            match rest.get(length) {
                Some(b' ') => at += 1,
                Some(b'\n' | b'\r') => {}
                _ => return false,
            }
        }
        // a line that ended too early has been left here, too
        if !matches!(self.bytes.get(at), Some(b'\n' | b'\r')) {
            return false;
        }
        self.position = at;
        true
    }

    fn packed(&mut self, scalar: ScalarType) -> Result<f64, Fault> {
        Ok(packed_color_of(self.number(scalar)?, scalar.is_float()))
    }

    #[inline]
    fn integer(&mut self, _scalar: ScalarType) -> Result<i64, Fault> {
        let rest = self.begin_number()?;
        let negative = rest[0] == b'-';
        let mut value = 0i64;
        let mut length = usize::from(negative);
        while let Some(digit) = rest.get(length).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            let next = value.checked_mul(10).and_then(|tens| tens.checked_add(i64::from(digit)));
            value = next.ok_or_else(|| self.no_number("index or count"))?;
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
        if FREE {
            let lines = &mut self.lines;
            let row = (lines.numbers, lines.breaks);
            lines.all_alike &= *lines.first.get_or_insert(row) == row;
            lines.all_whole &= lines.breaks == 0;
            return Ok(());
        }
        self.skip_blanks();
        match self.bytes.get(self.position) {
            None | Some(b'\n' | b'\r') => Ok(()),
            Some(_) => Err(Fault::Wrong("the line has more numbers than the header declares".into())),
        }
    }

    fn end_element(&mut self) -> Result<(), Fault> {
        let Lines { all_begin_lines, all_alike, all_whole, .. } = self.lines;
        if !FREE || all_whole || (all_begin_lines && all_alike) {
            return Ok(());
        }
        Err(Fault::Wrong("rows don't stand in lines alike".into()))
    }

    fn end(&mut self) -> Result<(), Fault> {
        if FREE {
            self.skip_lines();
            if self.position < self.bytes.len() {
                return Err(Fault::Wrong("there are more numbers than the header declares".into()));
            }
        }
        Ok(())
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
            ScalarType::U64 => self.take().map(|bytes| u64::from_le_bytes(bytes) as f64),
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
            ScalarType::I64 => i64::from_le_bytes(self.take()?),
            // what is beyond i64 is no count and no index
            ScalarType::U64 => i64::try_from(u64::from_le_bytes(self.take()?)).unwrap_or(i64::MAX),
            ScalarType::F32 | ScalarType::F64 => {
                return Err(Fault::Wrong("a list of indices can't be of a floating type".into()));
            }
        })
    }

    fn packed(&mut self, scalar: ScalarType) -> Result<f64, Fault> {
        match scalar.size() {
            // as bits: a float's way through f64 may change those of a NaN
            4 => self.take().map(|bytes| packed_color(u32::from_le_bytes(bytes), scalar.is_float())),
            _ => self.number(scalar).map(|value| packed_color_of(value, scalar.is_float())),
        }
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
        let mut body = Ascii::<false>::new(b"1 2\r\n  -3\n", 0);
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
        let mut body = Ascii::<false>::new(b"12abc 7", 0);
        assert_eq!(body.number(ScalarType::F32), Err(Fault::Wrong("\"12abc\" is no number".into())));
        assert_eq!(body.integer(ScalarType::I32), Err(Fault::Wrong("\"12abc\" is no number".into())));
        let mut body = Ascii::<false>::new(b"99999999999999999999 -", 0);
        assert!(matches!(body.integer(ScalarType::U32), Err(Fault::Wrong(_))));
        let mut body = Ascii::<false>::new(b"-", 0);
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
