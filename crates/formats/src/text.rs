//! Text files: their lines, whatever ends them, and numbers at a place in a line.

use super::number;

/// Lines that end with LF, CR LF or CR.
#[derive(Debug, Clone)]
pub(super) struct TextLines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> TextLines<'a> {
    /// The lines of `text`.
    pub(super) fn new(text: &'a [u8]) -> Self {
        TextLines { rest: text, number: 0 }
    }

    /// Lines so far: the number of the last one, counted from 1.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    /// What comes after the last line.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// The next line that holds more than blanks, without them at its ends.
    #[inline]
    pub(super) fn next_filled(&mut self) -> Option<&'a [u8]> {
        loop {
            let line = self.next()?.trim_ascii();
            if !line.is_empty() {
                return Some(line);
            }
        }
    }
}

impl<'a> Iterator for TextLines<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let length = memchr::memchr2(b'\n', b'\r', self.rest).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(length);
        self.rest = rest.strip_prefix(b"\r\n").or(rest.get(1..)).unwrap_or_default();
        Some(line)
    }
}

/// Words between blanks.
#[inline]
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Whether a number is written as one that has a fraction: `1.0` is a share, `1` a whole number.
pub(super) fn has_fraction(word: &[u8]) -> bool {
    word.iter().any(|byte| matches!(byte, b'.' | b',' | b'e' | b'E'))
}

/// The numbers at the start of a line, as many as there is room for; how many there are.
///
/// # Errors
/// The word that is no number.
#[inline]
pub(super) fn numbers<'a>(line: &'a [u8], values: &mut [f64]) -> Result<usize, &'a [u8]> {
    let mut count = 0;
    for (value, word) in values.iter_mut().zip(words(line)) {
        *value = number::parse(word).ok_or(word)?;
        count += 1;
    }
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_whatever_ends_them() {
        for end in ["\n", "\r\n", "\r"] {
            let text = format!("a b{end}{end}  c {end}d");
            let mut lines = TextLines::new(text.as_bytes());
            assert_eq!((lines.next_filled(), lines.number()), (Some(&b"a b"[..]), 1));
            assert_eq!((lines.next_filled(), lines.number()), (Some(&b"c"[..]), 3));
            assert_eq!((lines.next_filled(), lines.number()), (Some(&b"d"[..]), 4));
            assert_eq!((lines.next_filled(), lines.rest()), (None, &b""[..]));
        }
    }

    #[test]
    fn numbers_stop_at_what_is_none() {
        let mut values = [0.0; 3];
        assert_eq!(numbers(b" 1\t-2e1 ", &mut values), Ok(2));
        assert_eq!(values[..2], [1.0, -20.0]);
        assert_eq!(numbers(b"1 2 3 4", &mut values), Ok(3));
        assert_eq!(numbers(b"1 two", &mut values), Err(&b"two"[..]));
    }
}
