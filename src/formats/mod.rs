//! Bytes to geometry and back: every input from outside is hostile until it has passed here.
//!
//! Readers take a byte slice and a name (for messages) and give typed errors that name the place and the remedy.
//! They check declared counts against the bytes that are there before they allocate.
//!
//! - [`ply`]: scans, models and range grids, ASCII and binary, read and written
//! - [`obj`]: models, read
//! - [`pcd`]: scans, organised or not, read
//! - [`poses`]: Stanford `.conf`, JSON and text blocks, read and written

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod obj;
pub mod pcd;
pub mod ply;
pub mod poses;

use crate::geometry::Surface;

/// Why a file could not be read. Messages name the place in the file and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FormatError {
    /// The name's extension is none that is read here.
    #[error("files ending in {extension:?} are not read; send PLY, PCD or OBJ")]
    UnknownExtension {
        /// The part of the name after the last dot.
        extension: String,
    },
    /// The bytes are not what the format demands.
    #[error("{place}: {problem}; {remedy}")]
    Malformed {
        /// "header line 3", "vertex 17", "byte 1024".
        place: String,
        /// What is wrong there.
        problem: String,
        /// What to do about it.
        remedy: String,
    },
    /// The file ends before what its header declares.
    #[error("the file is cut short: it declares {declared} but ends within {found}; export or upload it again")]
    Truncated {
        /// What the header promises.
        declared: String,
        /// What was being read when the bytes ran out.
        found: String,
    },
    /// The file is sound but larger than is allowed.
    #[error("{what} {found} exceeds the limit of {limit}; thin the scan or raise the limit")]
    TooLarge {
        /// The thing counted.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// How many there may be.
        limit: u64,
    },
}

impl FormatError {
    /// Shorthand for [`FormatError::Malformed`].
    pub(crate) fn malformed(place: impl Into<String>, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        FormatError::Malformed { place: place.into(), problem: problem.into(), remedy: remedy.into() }
    }
}

/// The largest coordinate that is taken for a measurement: squares and cubes of it stay finite.
pub(crate) const MAX_COORDINATE: f64 = 1e30;

/// A number that can serve as a coordinate, or what is wrong with it.
pub(crate) fn checked_coordinate(value: f64) -> Result<f64, &'static str> {
    if value.abs() <= MAX_COORDINATE {
        Ok(value)
    } else if value.is_finite() {
        Err("is too large to be a coordinate")
    } else {
        Err("is not finite")
    }
}

/// A few bytes of hostile text, fit for a message: printable and short.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const MOST: usize = 24;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST)]);
    let dots = if bytes.len() > MOST { "..." } else { "" };
    format!("\"{}{dots}\"", text.escape_debug())
}

/// Bounds on what a reader accepts.
#[derive(Debug, Clone, Copy)]
pub struct ReadLimits {
    /// Points in one file.
    pub max_points: u64,
    /// Faces in one file.
    pub max_faces: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        ReadLimits { max_points: 20_000_000, max_faces: 40_000_000 }
    }
}

/// Extensions (lower case, no dot) of the files that are read as scans or models.
pub const EXTENSIONS: &[&str] = &["ply", "pcd", "obj"];

/// Reads a scan or model; the format is told by the extension of `name`.
pub fn read_surface(name: &str, bytes: &[u8], limits: &ReadLimits) -> Result<Surface, FormatError> {
    let extension = name.rsplit_once('.').map_or("", |(_, extension)| extension).to_ascii_lowercase();
    match extension.as_str() {
        "ply" => ply::read(bytes, limits),
        "pcd" => pcd::read(bytes, limits),
        "obj" => obj::read(bytes, limits),
        _ => Err(FormatError::UnknownExtension { extension }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_extension_is_named_with_the_remedy() {
        for name in ["scan.xyz", "scan.XYZ"] {
            let error = read_surface(name, b"", &ReadLimits::default()).expect_err("xyz is not read");
            assert_eq!(error.to_string(), "files ending in \"xyz\" are not read; send PLY, PCD or OBJ");
        }
        assert!(matches!(read_surface("ply", b"", &ReadLimits::default()), Err(FormatError::UnknownExtension { .. })));
    }

    #[test]
    fn quoted_bytes_are_short_and_printable() {
        assert_eq!(quote(b"a\x00\xff\n"), "\"a\\0\u{fffd}\\n\"");
        assert_eq!(quote(&[b'x'; 100]).len(), 24 + 2 + 3);
    }

    #[test]
    fn coordinates_must_be_finite_and_of_this_world() {
        assert_eq!(checked_coordinate(-1e9), Ok(-1e9));
        assert_eq!(checked_coordinate(f64::NAN), Err("is not finite"));
        assert_eq!(checked_coordinate(f64::NEG_INFINITY), Err("is not finite"));
        assert_eq!(checked_coordinate(1e200), Err("is too large to be a coordinate"));
    }
}
