//! How the values of a line are parted, and how their numbers are written.

use crate::number;
use crate::text::words;

/// What parts the values of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    /// Blanks and tabs, as many as there are.
    Blanks,
    Comma,
    Semicolon,
}

/// How a line is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dialect {
    pub(super) separator: Separator,
    /// Whether a comma stands for the decimal point.
    pub(super) decimal_comma: bool,
}

/// More columns than this are no measurements of a point.
pub(super) const MOST_COLUMNS: usize = 1 << 8;
/// Numbers that a line of points has at least.
const LEAST: usize = 3;

impl Dialect {
    /// Of a line by itself: a comma parts values, unless something else parts them already.
    pub(super) fn of(line: &[u8]) -> Self {
        let has = |byte| memchr::memchr(byte, line).is_some();
        let fraction = |word: &[u8]| word.contains(&b',') && with_point(word).is_some_and(|word| is_number(&word));
        if !has(b',') {
            let separator = if has(b';') { Separator::Semicolon } else { Separator::Blanks };
            return Dialect { separator, decimal_comma: false };
        }
        if has(b';') {
            return Dialect { separator: Separator::Semicolon, decimal_comma: true };
        }
        // `1,5 2,5 3` has commas inside of numbers only; those of `1, 2, 3` and `1,2,3` end words or make no number
        let parts_words =
            words(line).count() >= LEAST && words(line).all(|word| !word.contains(&b',') || fraction(word));
        let separator = if parts_words { Separator::Blanks } else { Separator::Comma };
        Dialect { separator, decimal_comma: parts_words }
    }

    /// The values of a line, one more than are allowed at most; where a comma or semicolon parts them, some may be empty.
    pub(super) fn fields<'a>(&self, line: &'a [u8]) -> Vec<&'a [u8]> {
        let most = MOST_COLUMNS + 1;
        match self.separator {
            Separator::Blanks => words(line).map(unquoted).take(most).collect(),
            Separator::Comma => line.split(|byte| *byte == b',').map(unquoted).take(most).collect(),
            Separator::Semicolon => line.split(|byte| *byte == b';').map(unquoted).take(most).collect(),
        }
    }

    /// A value that is a number; an empty one is NaN.
    pub(super) fn number(&self, field: &[u8]) -> Option<f64> {
        let field = unquoted(field);
        if field.is_empty() {
            return Some(f64::NAN);
        }
        match (self.decimal_comma, field.contains(&b',')) {
            (true, true) => number::parse(&with_point(field)?),
            // beside decimal commas a point parts thousands, or is a mistake
            (true, false) if field.contains(&b'.') => None,
            _ => number::parse(field),
        }
    }

    /// Whether a line holds a point: three numbers at least.
    pub(super) fn is_row(&self, line: &[u8]) -> bool {
        let is_number = |field: &&[u8]| !field.is_empty() && self.number(field).is_some();
        self.fields(line).iter().filter(|field| is_number(field)).count() >= LEAST
    }

    /// Whether the byte stands between two values.
    #[inline]
    pub(super) fn parts(&self, byte: u8) -> bool {
        match self.separator {
            Separator::Blanks => byte.is_ascii_whitespace(),
            Separator::Comma => byte == b',',
            Separator::Semicolon => byte == b';',
        }
    }
}

fn is_number(word: &[u8]) -> bool {
    number::parse(word).is_some()
}

/// A number with its one decimal comma as a point.
fn with_point(word: &[u8]) -> Option<Vec<u8>> {
    let place = memchr::memchr(b',', word)?;
    let (whole, fraction) = (&word[..place], &word[place + 1..]);
    let is_plain = whole.last().is_some_and(u8::is_ascii_digit) && fraction.first().is_some_and(u8::is_ascii_digit);
    let is_only = !fraction.contains(&b',') && !word.contains(&b'.');
    (is_plain && is_only).then(|| [whole, b".", fraction].concat())
}

/// A value without blanks and quotes around it.
fn unquoted(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => field,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_what_parts_its_values() {
        let cases: [(&str, Separator, bool, &[f64]); 9] = [
            ("1 2.5\t-3e2", Separator::Blanks, false, &[1.0, 2.5, -300.0]),
            ("1,2.5,-3", Separator::Comma, false, &[1.0, 2.5, -3.0]),
            ("1, 2, 3", Separator::Comma, false, &[1.0, 2.0, 3.0]),
            ("1 ,2 ,3", Separator::Comma, false, &[1.0, 2.0, 3.0]),
            ("1;2;3", Separator::Semicolon, false, &[1.0, 2.0, 3.0]),
            ("1,5; 2;3,25", Separator::Semicolon, true, &[1.5, 2.0, 3.25]),
            ("1,5 2 -3,25", Separator::Blanks, true, &[1.5, 2.0, -3.25]),
            ("1,5\t2,5\t3,5", Separator::Blanks, true, &[1.5, 2.5, 3.5]),
            ("\"1\",\"2\",'3'", Separator::Comma, false, &[1.0, 2.0, 3.0]),
        ];
        for (line, separator, decimal_comma, numbers) in cases {
            let dialect = Dialect::of(line.as_bytes());
            assert_eq!(dialect, Dialect { separator, decimal_comma }, "{line}");
            let found: Vec<_> = dialect.fields(line.as_bytes()).iter().filter_map(|f| dialect.number(f)).collect();
            assert_eq!(found, numbers, "{line}");
            assert!(dialect.is_row(line.as_bytes()), "{line}");
        }
        for line in ["x y z", "1 2", "1,234.5;2", "a,b,c", "2023-01-01 12:00 5"] {
            assert!(!Dialect::of(line.as_bytes()).is_row(line.as_bytes()), "{line}");
        }
    }
}
