//! Keywords and arrays of numbers, in text or big-endian bytes.

use crate::text::{TextLines, words};
use crate::{FormatError, number, quote};

const REPAIR: &str = "repair the file or export it again";

/// The type of an array's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    Bit,
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

impl Scalar {
    pub(super) fn of(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "bit" => Scalar::Bit,
            "char" | "signed_char" | "vtktypeint8" => Scalar::I8,
            "unsigned_char" | "vtktypeuint8" => Scalar::U8,
            "short" | "vtktypeint16" => Scalar::I16,
            "unsigned_short" | "vtktypeuint16" => Scalar::U16,
            // ids are written as int, whatever they are in memory
            "int" | "vtkidtype" | "vtktypeint32" => Scalar::I32,
            "unsigned_int" | "vtktypeuint32" => Scalar::U32,
            "long" | "vtktypeint64" => Scalar::I64,
            "unsigned_long" | "vtktypeuint64" => Scalar::U64,
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            _ => return None,
        })
    }

    /// Bytes that so many of them take.
    fn bytes(self, count: u64) -> u64 {
        let size = match self {
            Scalar::Bit => return count.div_ceil(8),
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        };
        count.saturating_mul(size)
    }
}

/// Where we are in the file.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    pub(super) position: usize,
    pub(super) is_binary: bool,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], position: usize) -> Self {
        Cursor { bytes, position, is_binary: false }
    }

    pub(super) fn wrong(&self, problem: impl Into<String>) -> FormatError {
        FormatError::malformed(format!("byte {}", self.position), problem, REPAIR)
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.position..).unwrap_or_default()
    }

    /// The next line as it stands, without blanks at its ends; the position then is behind its end.
    pub(super) fn any_line(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        let mut lines = TextLines::new(rest);
        let line = lines.next()?;
        self.position += rest.len() - lines.rest().len();
        Some(line.trim_ascii())
    }

    /// The next line that is not blank.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        loop {
            let line = self.any_line()?;
            if !line.is_empty() {
                return Some(line);
            }
        }
    }

    /// The next line that is not blank, without going there.
    pub(super) fn peek(&self) -> Option<&'a [u8]> {
        Cursor { bytes: self.bytes, ..*self }.line()
    }

    /// Checks that so many numbers can be there, before anything is allocated for them.
    pub(super) fn check(&self, count: u64, scalar: Scalar) -> Result<(), FormatError> {
        // a digit and what parts it from the next; the last may lack that
        let least = if self.is_binary { scalar.bytes(count) } else { count.saturating_mul(2).saturating_sub(1) };
        let left = self.rest().len();
        if least <= left as u64 {
            return Ok(());
        }
        let found = format!("the {left} bytes after byte {}", self.position);
        Err(FormatError::Truncated { declared: format!("{count} numbers"), found })
    }

    /// Calls `take` for each of the next numbers.
    pub(super) fn numbers(&mut self, count: u64, scalar: Scalar, take: impl FnMut(f64)) -> Result<(), FormatError> {
        self.check(count, scalar)?;
        if self.is_binary { self.binary(count, scalar, take) } else { self.text(count, take) }
    }

    /// Passes over numbers.
    pub(super) fn skip(&mut self, count: u64, scalar: Scalar) -> Result<(), FormatError> {
        self.check(count, scalar)?;
        if !self.is_binary {
            return self.text(count, |_| {});
        }
        self.position += scalar.bytes(count) as usize;
        Ok(())
    }

    fn text(&mut self, count: u64, mut take: impl FnMut(f64)) -> Result<(), FormatError> {
        for index in 0..count {
            let rest = self.rest();
            let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(rest.len());
            let word = &rest[start..];
            let word = &word[..word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len())];
            if word.is_empty() {
                return Err(FormatError::Truncated {
                    declared: format!("{count} numbers"),
                    found: format!("number {index} of them"),
                });
            }
            let value = number::parse(word).ok_or_else(|| self.wrong(format!("{} is no number", quote(word))))?;
            self.position += start + word.len();
            take(value);
        }
        Ok(())
    }

    /// Numbers in bytes; their length has been checked.
    fn binary(&mut self, count: u64, scalar: Scalar, mut take: impl FnMut(f64)) -> Result<(), FormatError> {
        let length = scalar.bytes(count) as usize;
        let bytes = self.rest().get(..length).unwrap_or_default();
        self.position += length;
        macro_rules! each {
            ($number:ty) => {
                for chunk in bytes.as_chunks().0 {
                    take(<$number>::from_be_bytes(*chunk) as f64);
                }
            };
        }
        match scalar {
            Scalar::Bit => (0..count as usize).for_each(|bit| take(f64::from(bytes[bit / 8] >> (7 - bit % 8) & 1))),
            Scalar::I8 => each!(i8),
            Scalar::U8 => each!(u8),
            Scalar::I16 => each!(i16),
            Scalar::U16 => each!(u16),
            Scalar::I32 => each!(i32),
            Scalar::U32 => each!(u32),
            Scalar::I64 => each!(i64),
            Scalar::U64 => each!(u64),
            Scalar::F32 => each!(f32),
            Scalar::F64 => each!(f64),
        }
        Ok(())
    }

    /// Passes over texts: each a line, or bytes behind their length.
    pub(super) fn skip_texts(&mut self, count: u64) -> Result<(), FormatError> {
        let cut = |cursor: &Self| FormatError::Truncated {
            declared: format!("{count} texts"),
            found: format!("the {} bytes of the file", cursor.bytes.len()),
        };
        for _ in 0..count {
            if !self.is_binary {
                self.any_line().ok_or_else(|| cut(self))?;
                continue;
            }
            // the two highest bits say how many bytes the length has
            let first = *self.rest().first().ok_or_else(|| cut(self))?;
            let width = 1usize << (3 - (first >> 6));
            let bytes = self.rest().get(..width).ok_or_else(|| cut(self))?;
            let length = bytes.iter().fold(0u64, |sum, byte| sum << 8 | u64::from(*byte));
            let length = length & (u64::MAX >> (64 - 8 * width as u32 + 2));
            let end = length.checked_add((self.position + width) as u64).filter(|end| *end <= self.bytes.len() as u64);
            self.position = end.ok_or_else(|| cut(self))? as usize;
        }
        Ok(())
    }
}

/// The words of a line of keywords.
pub(super) fn text_words(line: &[u8]) -> Vec<&str> {
    const MOST: usize = 16;
    words(line).map(|word| std::str::from_utf8(word).unwrap_or("")).take(MOST).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(bytes: &[u8], is_binary: bool, count: u64, scalar: Scalar) -> Result<Vec<f64>, FormatError> {
        let mut cursor = Cursor { bytes, position: 0, is_binary };
        let mut values = Vec::new();
        cursor.numbers(count, scalar, |value| values.push(value))?;
        Ok(values)
    }

    #[test]
    fn numbers_are_text_or_big_endian() {
        assert_eq!(all(b"1 2.5\n-3", false, 3, Scalar::F32), Ok(vec![1.0, 2.5, -3.0]));
        assert_eq!(all(&[0, 1, 255, 254], true, 2, Scalar::I16), Ok(vec![1.0, -2.0]));
        assert_eq!(all(&1.5f64.to_be_bytes(), true, 1, Scalar::F64), Ok(vec![1.5]));
        assert_eq!(all(&[0b1010_0000], true, 3, Scalar::Bit), Ok(vec![1.0, 0.0, 1.0]));
        assert!(all(b"1 2", false, u64::MAX, Scalar::F32).is_err());
        assert!(all(b"1 two", false, 2, Scalar::F32).is_err());
        assert!(all(&[0; 7], true, 1, Scalar::F64).is_err());
    }

    #[test]
    fn texts_are_passed_over() {
        let bytes = [&[0xc2, b'a', b'b'][..], &[0x80, 3], b"abc", b"END"].concat();
        let mut cursor = Cursor { bytes: &bytes, position: 0, is_binary: true };
        assert_eq!((cursor.skip_texts(2), cursor.rest()), (Ok(()), &b"END"[..]));
        let mut cursor = Cursor { bytes: b"one\n\ntwo\nEND", position: 0, is_binary: false };
        assert_eq!((cursor.skip_texts(3), cursor.rest()), (Ok(()), &b"END"[..]));
        let mut cursor = Cursor { bytes: &[0x3f; 9], position: 0, is_binary: true };
        assert!(cursor.skip_texts(1).is_err());
    }
}
