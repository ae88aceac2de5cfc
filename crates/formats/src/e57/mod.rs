//! E57, the exchange format of terrestrial laser scanners: several scans in a file, each with its pose; in metres.
//!
//! What describes the scans is read by the crate `e57`. Their points are read here: a few bytes of a hostile file can
//! make the crate's reader keep values without end.

mod packets;
mod pages;
mod scan;
mod writer;

#[cfg(test)]
mod tests;

use std::io::Cursor;

use super::format::{BYTES, Content, Format, Reader, Writers};
use super::guard::guarded;
use super::{DeclaredUnit, FormatError, ReadLimits, ScanReading};

pub use writer::{WrittenScan, write_cloud, write_scans};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "E57",
    endings: &["e57"],
    media_type: BYTES,
    holds: &[
        Content::Points,
        Content::Normals,
        Content::Colors,
        Content::Intensities,
        Content::Grid,
        Content::Sensor,
        Content::Poses,
    ],
    reader: Reader::Scans(read),
    writers: Writers { cloud: Some(write_cloud), ..Writers::NONE },
};

const REPAIR: &str = "repair the file or export it again";

/// Bytes of the head of a file.
const HEAD: usize = 48;
/// The most attributes that an element may have: looking for doubled ones takes the square of it.
const MOST_ATTRIBUTES: usize = 256;
/// What an element, an attribute or a text of the description takes (bytes).
const NODE: usize = 160;

/// Reads all scans of a file, each in its own frame.
///
/// Points whose state says that they are invalid, or directions without a range, are left out and counted. Row and
/// column indices make a range grid.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// page or the scan for the rest: wrong checksums, no scans, no coordinates.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Vec<ScanReading>, FormatError> {
    let mut budget = limits.budget();
    check_description(bytes, &mut budget)?;
    let file = guarded(|| e57::E57Reader::new(Cursor::new(bytes)))
        .ok_or_else(|| FormatError::malformed("the description", "it makes no sense", REPAIR))?
        .map_err(|error| described("the description", &error))?;
    let clouds = file.pointclouds();
    drop(file);
    let mut scans: Vec<ScanReading> = Vec::new();
    let (mut points, mut empty, mut unread) = (0u64, 0, bytes.len() as u64);
    let limit = limits.most_points();
    for (index, cloud) in clouds.iter().enumerate() {
        if cloud.records == 0 {
            empty += 1;
            continue;
        }
        points = points.saturating_add(cloud.records);
        if points > limit {
            return Err(FormatError::TooLarge { what: "points", found: points, limit });
        }
        let place = format!("scan {}", index + 1);
        if let Some(mut scan) = scan::read(bytes, cloud, &place, &mut unread, &mut budget)? {
            scan.reading.unit = Some(DeclaredUnit::METRE);
            scans.push(scan);
        } else {
            empty += 1;
        }
    }
    match scans.first_mut() {
        Some(first) if empty > 0 => {
            first.reading.dropped.notes.push(format!("{empty} other scans of the file have no points"));
        }
        Some(_) => {}
        None => {
            let problem = format!("none of its {} scans has points", clouds.len());
            return Err(FormatError::malformed("the whole file", problem, "send a file with scans"));
        }
    }
    Ok(scans)
}

/// Checks what the crate doesn't before it reads the description: that its bytes are there, and what it may take.
fn check_description(bytes: &[u8], budget: &mut super::budget::Budget) -> Result<(), FormatError> {
    let number = |at: usize| bytes.get(at..at + 8).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
    let found = bytes.len() as u64;
    if !bytes.starts_with(b"ASTM-E57") {
        let problem = format!("an E57 file begins with ASTM-E57, this one with {}", super::quote(bytes));
        return Err(FormatError::malformed("byte 0", problem, "send an E57 file"));
    }
    let (Some(length), Some(start), Some(size), Some(_)) = (number(16), number(24), number(32), number(40)) else {
        return Err(FormatError::Truncated { declared: format!("a head of {HEAD} bytes"), found: format!("{found}") });
    };
    if length > found || start.saturating_add(size) > found {
        let declared = format!("{} bytes", length.max(start.saturating_add(size)));
        return Err(FormatError::Truncated { declared, found: format!("the {found} that are there") });
    }
    let text = pages::Pages::new(bytes)?.read(start, size as usize, "the description")?;
    let tags = memchr::memchr_iter(b'<', &text);
    let mut nodes = 0;
    for tag in tags {
        let length = memchr::memchr(b'>', &text[tag..]).unwrap_or(text.len() - tag);
        let attributes = memchr::memchr_iter(b'=', &text[tag..tag + length]).count();
        if attributes > MOST_ATTRIBUTES && !text[tag..].starts_with(b"<!") {
            let problem = format!("an element of the description has {attributes} attributes");
            return Err(FormatError::malformed("the description", problem, REPAIR));
        }
        nodes += 1 + attributes as u64;
    }
    budget.take_description(nodes, NODE)
}

/// What the crate says is wrong, short enough for a message.
fn described(place: &str, error: &e57::Error) -> FormatError {
    let text: String = error.to_string().escape_debug().take(200).collect();
    FormatError::malformed(place, text, REPAIR)
}
