//! Numbers of files: coordinates that can be used, and the spellings of NaN and infinity.

use std::fmt;

use visage_geometry::MAX_COORDINATE;

/// Why a number is no coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoCoordinate {
    /// NaN or infinite.
    NotFinite,
    /// Finite, but beyond [`MAX_COORDINATE`].
    TooLarge(f64),
}

impl fmt::Display for NoCoordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NoCoordinate::NotFinite => f.write_str("is not finite"),
            NoCoordinate::TooLarge(value) => {
                write!(f, "is {value:e}, which is too large to be a coordinate (they reach to {MAX_COORDINATE:e})")
            }
        }
    }
}

/// A number that can serve as a coordinate, or what is wrong with it.
#[inline]
pub fn checked_coordinate(value: f64) -> Result<f64, NoCoordinate> {
    if value.abs() <= MAX_COORDINATE {
        Ok(value)
    } else if value.is_finite() {
        Err(NoCoordinate::TooLarge(value))
    } else {
        Err(NoCoordinate::NotFinite)
    }
}

/// A number in text, `None` if it is none.
#[inline]
pub(super) fn parse(word: &[u8]) -> Option<f64> {
    match leading(word) {
        Some((value, length)) if length == word.len() => Some(value),
        _ => spelled(word),
    }
}

/// The number with which a text begins, and how many bytes it takes.
#[inline]
pub(super) fn leading(text: &[u8]) -> Option<(f64, usize)> {
    match plain(text) {
        None => fast_float2::parse_partial(text).ok(),
        found => found,
    }
}

/// `0` in each of eight bytes, and what the arithmetic on them needs.
const ZEROS: u64 = 0x3030_3030_3030_3030;
const BEYOND_NINE: u64 = 0x7676_7676_7676_7676;
const HIGH_BITS: u64 = 0x8080_8080_8080_8080;
/// Moves the high bit of each byte into the highest byte, the first byte's lowest.
const GATHER: u64 = 0x0002_0408_1020_4081;
/// Bytes that are looked at together.
const WORD: usize = 8;
/// Whole numbers up to this, and powers of ten up to 22, are exact, so that dividing one by the other rounds once.
const MOST_EXACT: u64 = 1 << 53;
const POWERS: [f64; 2 * WORD] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
const WHOLE_POWERS: [u64; WORD + 1] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// The number with which a text begins if it is written as nearly all are: `-0.123456`, and shorter than sixteen
/// characters. Its digits are taken eight at a time; it is rounded as exactly as by any other way.
#[inline(always)]
pub(super) fn plain(text: &[u8]) -> Option<(f64, usize)> {
    let sign = usize::from(text.first() == Some(&b'-'));
    let both = text.get(sign..sign + 2 * WORD)?;
    let (first, second) = (word(both, 0) ^ ZEROS, word(both, WORD) ^ ZEROS);
    // one bit for each byte that is no digit
    let others = |digits: u64| (((digits.wrapping_add(BEYOND_NINE) | digits) & HIGH_BITS).wrapping_mul(GATHER)) >> 56;
    let others = others(first) | others(second) << WORD;
    let whole = others.trailing_zeros() as usize;
    // the length of a number without a fraction is that of its whole part
    let has_point = both.get(whole) == Some(&b'.');
    let end = if has_point { (others & others.wrapping_sub(1)).trailing_zeros() as usize } else { whole };
    if whole == 0 || whole > WORD || end >= 2 * WORD || both[end] | 0x20 == b'e' || both[end] == b'.' {
        return None;
    }
    let mut mantissa = value_of(first << (8 * (WORD - whole)));
    let fraction = if has_point { end - whole - 1 } else { 0 };
    match fraction {
        0 => {}
        1..=WORD => {
            let digits = word(both, whole + 1) ^ ZEROS;
            mantissa = mantissa * WHOLE_POWERS[fraction] + value_of(digits << (8 * (WORD - fraction)));
        }
        _ => {
            let digits = value_of(word(both, whole + 1) ^ ZEROS);
            let rest = word(both, end - WORD) ^ ZEROS;
            let more = fraction - WORD;
            // the last of eight digits are those that were not yet taken
            let rest = value_of(rest >> (8 * (WORD - more)) << (8 * (WORD - more)));
            mantissa = (mantissa * WHOLE_POWERS[WORD] + digits) * WHOLE_POWERS[more] + rest;
        }
    }
    if mantissa > MOST_EXACT {
        return None;
    }
    let value = mantissa as f64 / POWERS[fraction];
    Some((if sign == 1 { -value } else { value }, sign + end))
}

/// Eight bytes, the first the lowest; those behind the end are zero.
#[inline]
fn word(bytes: &[u8], at: usize) -> u64 {
    match bytes.get(at..).and_then(<[u8]>::first_chunk) {
        Some(bytes) => u64::from_le_bytes(*bytes),
        None => behind(bytes, at),
    }
}

#[cold]
fn behind(bytes: &[u8], at: usize) -> u64 {
    let left = bytes.get(at..).unwrap_or_default();
    left.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// The number of eight digits, a byte each, the first the lowest byte.
#[inline]
fn value_of(digits: u64) -> u64 {
    const PAIRS: u64 = 0x0000_00ff_0000_00ff;
    let tens = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let (odd, even) = (tens & PAIRS, (tens >> 16) & PAIRS);
    let both = odd.wrapping_mul(100 + (1_000_000 << 32)).wrapping_add(even.wrapping_mul(1 + (10_000 << 32)));
    both >> 32
}

/// NaN and infinity as Microsoft's libraries write them: `-nan(ind)`, `1.#QNAN`, `-1.#IND`, `1.#INF`.
#[cold]
pub(super) fn spelled(word: &[u8]) -> Option<f64> {
    let word = word.to_ascii_lowercase();
    let unsigned = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(&word);
    let is_nan = unsigned.starts_with(b"nan(") && unsigned.ends_with(b")");
    match unsigned.strip_prefix(b"1.#") {
        Some(rest) if rest.starts_with(b"inf") => Some(f64::INFINITY),
        Some(rest) => [&b"ind"[..], b"qnan", b"snan", b"nan"].iter().any(|n| rest.starts_with(n)).then_some(f64::NAN),
        None => is_nan.then_some(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_must_be_finite_and_of_this_world() {
        assert_eq!(checked_coordinate(-1e9), Ok(-1e9));
        assert_eq!(checked_coordinate(f64::NAN), Err(NoCoordinate::NotFinite));
        assert_eq!(checked_coordinate(f64::NEG_INFINITY), Err(NoCoordinate::NotFinite));
        let problem = checked_coordinate(-1e20).map_err(|problem| problem.to_string());
        assert_eq!(problem, Err("is -1e20, which is too large to be a coordinate (they reach to 1e12)".to_owned()));
        // the diagonal of the largest box, to the third power
        assert!(((2.0 * MAX_COORDINATE * 3f64.sqrt()).powi(3) as f32).is_finite());
    }

    /// What any way of reading has to give.
    fn exact(text: &[u8]) -> Option<(u64, usize)> {
        fast_float2::parse_partial::<f64, _>(text).ok().map(|(value, length)| (value.to_bits(), length))
    }

    #[test]
    fn numbers_are_those_of_an_exact_parser_bit_by_bit() {
        let mut state = 7u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let mut plain_ones = 0;
        for _ in 0..400_000 {
            let mut text = Vec::new();
            // mostly numbers of all lengths, and what breaks off, repeats or ends them
            let parts = [random(10), random(18)];
            text.extend(&b"-"[..usize::from(random(3) == 0)]);
            text.extend((0..parts[0]).map(|_| b'0' + random(10) as u8));
            text.extend(&b"."[..usize::from(random(5) > 0)]);
            text.extend((0..parts[1]).map(|_| b'0' + random(10) as u8));
            let ends: [&[u8]; 12] = [
                b" ",
                b"\n",
                b"",
                b"e5 ",
                b"E-3",
                b".5",
                b",",
                b"abc",
                b"-",
                b"\xff",
                b"\xb0",
                b" 0.123456 0.123456 0.1",
            ];
            text.extend(ends[random(12) as usize]);
            text.extend(&b"                       "[..random(23) as usize]);
            let found = plain(&text).map(|(value, length)| (value.to_bits(), length));
            plain_ones += u32::from(found.is_some());
            if found.is_some() {
                assert_eq!(found, exact(&text), "{}", text.escape_ascii());
            }
        }
        assert!(plain_ones > 100_000, "{plain_ones}");
        for text in [
            "-0.123456                ",
            "-0                       ",
            "12345678.123456          ",
            "0.                    ",
        ] {
            let found = plain(text.as_bytes()).map(|(value, length)| (value.to_bits(), length));
            assert_eq!((found.is_some(), found), (true, exact(text.as_bytes())), "{text}");
        }
    }

    #[test]
    fn every_spelling_of_no_number_is_read() {
        for word in ["nan", "NaN", "-nan", "-nan(ind)", "nan(snan)", "NAN(0x1)", "-1.#IND", "1.#QNAN0", "1.#IND00"] {
            assert!(parse(word.as_bytes()).is_some_and(f64::is_nan), "{word}");
        }
        for word in ["inf", "-inf", "Infinity", "1.#INF", "-1.#INF00"] {
            assert!(parse(word.as_bytes()).is_some_and(f64::is_infinite), "{word}");
        }
        for word in ["", "-", "nan(", "1.#", "1.#x", "12abc", "nanny"] {
            assert_eq!(parse(word.as_bytes()), None, "{word}");
        }
        assert_eq!(parse(b"-1.5e2"), Some(-150.0));
    }
}
