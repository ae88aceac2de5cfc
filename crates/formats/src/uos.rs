//! The `.3d` files of 3DTK (format `uos`): a point a line, in centimetres and a left-handed frame, perhaps with its
//! reflectance or colour behind.
//!
//! Coordinates stay as they are. A left-handed frame shows a scan mirrored, which does not matter to scans of one kind among
//! each other; it is said.

use super::format::{BYTES, Content, Format, Reader, Writers};
use super::{DeclaredUnit, FormatError, ReadLimits, Reading, columns};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "3DTK",
    endings: &["3d"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Colors, Content::Normals, Content::Intensities],
    reader: Reader::Surface(read),
    writers: Writers::NONE,
};

/// Reads a scan of 3DTK. A first line that is no point, such as the size of the scan, is passed over.
///
/// # Errors
/// As [`columns::read`].
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let mut reading = columns::read(bytes, limits)?;
    let centimetre = DeclaredUnit { metres: 0.01 };
    if reading.unit.is_none() {
        reading.unit = Some(centimetre);
    }
    reading.dropped.notes.push("the axes are left-handed, as 3DTK has them: the shape is mirrored".into());
    Ok(reading)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Unit;

    #[test]
    fn points_are_in_centimetres_and_as_they_stand() {
        for text in ["1.5 2 300\n4 5 -6\n", "# a scan\n1.5 2 300\n4 5 -6\n", "2 x 1\n1.5 2 300\n4 5 -6\n"] {
            let reading = read(text.as_bytes(), &ReadLimits::default()).expect(text);
            assert_eq!(reading.surface.cloud.points[0].coords.as_slice(), [1.5, 2.0, 300.0], "{text}");
            assert_eq!(reading.unit.and_then(DeclaredUnit::unit), Some(Unit::Cm), "{text}");
            assert!(reading.dropped.notes.iter().any(|note| note.contains("left-handed")), "{text}");
        }
    }
}
