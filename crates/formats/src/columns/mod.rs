//! Points as columns of numbers in text: XYZ, PTS, CSV and their kin, which no standard describes.
//!
//! What parts the values, and which of them are what, is told from the first rows; names in a header line decide, and a
//! file that leaves doubt is read without what is in doubt, with a note, or refused where the doubt is about positions.

mod dialect;
pub(super) mod guess;
mod layout;
mod names;
mod reader;
mod writer;

pub use writer::write_cloud;

use super::format::{BYTES, Content, Format, Reader, Writers};
use super::{FormatError, ReadLimits, Reading};

const HOLDS: &[Content] = &[Content::Points, Content::Normals, Content::Colors, Content::Intensities];

/// XYZ and all that looks like it. A text that is given as a scan is one: those given as poses have no ending of their own.
pub const XYZ: Format = Format {
    name: "XYZ",
    endings: &["xyz", "asc", "csv", "txt"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(read),
    writers: Writers { cloud: Some(write_cloud), ..Writers::NONE },
};

/// Positions and normals.
pub const XYZN: Format = Format {
    name: "XYZN",
    endings: &["xyzn"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(|bytes, limits| {
        reader::read(bytes, limits, |columns| (columns == 6).then_some(&["x", "y", "z", "nx", "ny", "nz"]))
    }),
    writers: Writers::NONE,
};

/// Positions and colours, which Open3D writes as fractions.
pub const XYZRGB: Format = Format {
    name: "XYZRGB",
    endings: &["xyzrgb"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(|bytes, limits| {
        reader::read(bytes, limits, |columns| (columns == 6).then_some(&["x", "y", "z", "r", "g", "b"]))
    }),
    writers: Writers::NONE,
};

/// PTS of Leica: the number of points, then positions, intensities and colours.
pub const PTS: Format = Format {
    name: "PTS",
    endings: &["pts"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(|bytes, limits| {
        reader::read(bytes, limits, |columns| matches!(columns, 4 | 7).then_some(&["x", "y", "z", "intensity"]))
    }),
    writers: Writers::NONE,
};

/// Reads points from columns of text: positions first, or where a header line names them.
///
/// Blanks, commas or semicolons part the values; a comma may be the decimal point where it parts nothing. Lines that begin
/// with `#`, `//`, `%` or `;` are comments; a header may be one. A line with one whole number says how many points follow.
/// Columns without a name are a colour if they are whole numbers up to 255, a normal if they have the length 1, and
/// nothing else may be meant.
///
/// # Errors
/// [`FormatError::Truncated`] when fewer points follow than are declared, [`FormatError::TooLarge`] and
/// [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the line for the rest: no rows, rows
/// with more or fewer values than the first one, a header without x, y and z, words that are no numbers.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    reader::read(bytes, limits, |_| None)
}

#[cfg(test)]
mod tests;
