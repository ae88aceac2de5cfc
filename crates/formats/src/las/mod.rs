//! LAS and LAZ, the formats of lidars in the air: points with intensities and perhaps colours, whole numbers with a
//! scale and an offset. LAZ is the same, compressed.

mod header;
mod laz;
mod units;
mod writer;

#[cfg(test)]
mod tests;

use super::budget::Budget;
use super::colors::Channels;
use super::format::{BYTES, Content, Format, Reader, Writers};
use super::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, X};
use super::{FormatError, ReadLimits, Reading};
use header::Header;

pub use writer::write_cloud;

/// LAS.
pub const LAS: Format = Format {
    name: "LAS",
    endings: &["las"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(read),
    writers: Writers { cloud: Some(write_cloud), ..Writers::NONE },
};

/// LAS, compressed.
pub const LAZ: Format = Format {
    name: "LAZ",
    endings: &["laz"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(read),
    writers: Writers::NONE,
};

const HOLDS: &[Content] = &[Content::Points, Content::Colors, Content::Intensities];

const REPAIR: &str = "repair the file or export it again";

/// Reads a file, compressed or not: which it is, its head says. Coordinates are exact, however far from the origin.
///
/// Withheld points, which the standard wants to be taken for deleted, are left out and noted; colours and intensities
/// that are 0 everywhere are none.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// place for the rest: an unknown point format, scales that are none, coordinates in degrees.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let header = Header::of(bytes)?;
    let (found, limit) = (header.count, limits.most_points());
    if found > limit {
        return Err(FormatError::TooLarge { what: "points", found, limit });
    }
    let unit = units::declared(bytes, &header)?;
    let mut points = Records::new(&header, &mut limits.budget())?;
    if header.is_compressed {
        laz::read(bytes, &header, limits, &mut points)?;
    } else {
        let needed = header.count.saturating_mul(header.record as u64);
        let records = bytes.get(header.start..).unwrap_or_default();
        if needed > records.len() as u64 {
            let declared = format!("{} points of {} bytes", header.count, header.record);
            let found = format!("the {} bytes after its header", records.len());
            return Err(FormatError::Truncated { declared, found });
        }
        points.push(&records[..needed as usize])?;
    }
    let mut reading = points.finish()?;
    reading.unit = unit;
    Ok(reading)
}

/// The records read so far.
struct Records<'a> {
    header: &'a Header,
    points: Points,
    withheld: u64,
}

impl<'a> Records<'a> {
    fn new(header: &'a Header, budget: &mut Budget) -> Result<Self, FormatError> {
        let has_color = header.color.is_some();
        let layout = Layout::of(
            |slot| slot < NORMAL || slot == INTENSITY || (has_color && (COLOR..INTENSITY).contains(&slot)),
            // many programs write bytes into two
            |_| Channels::Whole(65535),
        )?;
        budget.take(header.count, layout.bytes())?;
        Ok(Records { header, points: Points::new(&layout, header.count as usize), withheld: 0 })
    }

    /// Takes whole records.
    fn push(&mut self, records: &[u8]) -> Result<(), FormatError> {
        let Header { scale, offset, color, withheld, record, .. } = self.header;
        let whole = |bytes: &[u8]| i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let short = |bytes: &[u8]| f64::from(u16::from_le_bytes([bytes[0], bytes[1]]));
        for bytes in records.chunks_exact(*record) {
            if bytes[withheld.0] & withheld.1 != 0 {
                self.withheld += 1;
                continue;
            }
            let mut values = [0.0; SLOTS];
            for axis in 0..3 {
                values[X + axis] = scale[axis].of(whole(&bytes[4 * axis..]), offset[axis]);
            }
            values[INTENSITY] = short(&bytes[12..]);
            if let Some(color) = color {
                for channel in 0..3 {
                    values[COLOR + channel] = short(&bytes[color + 2 * channel..]);
                }
            }
            let index = self.points.seen() as u64 + self.withheld;
            self.points
                .push(&values)
                .map_err(|problem| FormatError::malformed(format!("point {index}"), problem, REPAIR))?;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Reading, FormatError> {
        if self.withheld > 0 {
            self.points.dropped.notes.push(format!("{} points that the file withholds", self.withheld));
        }
        let mut reading = self.points.finish(Vec::new(), None, None)?;
        let cloud = &mut reading.surface.cloud;
        // formats that have room for them are used also where there are none
        cloud.colors = cloud.colors.take().filter(|colors| colors.iter().any(|color| *color != [0; 3]));
        cloud.intensities = cloud.intensities.take().filter(|values| values.iter().any(|value| *value != 0.0));
        Ok(reading)
    }
}
