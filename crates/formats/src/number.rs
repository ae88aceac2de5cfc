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
    fast_float2::parse(word).ok().or_else(|| spelled(word))
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
