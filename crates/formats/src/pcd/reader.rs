//! The data of a PCD file to a [`Surface`](visage_geometry::Surface).

use super::header::{Encoding, Field, Header, NumberType};
use super::lzf;
use crate::budget::Budget;
use crate::colors::Channels;
use crate::header_lines::lines_of;
use crate::number::parse;
use crate::points::{Layout, PACKED, Points, SLOTS, Values, packed_color, packed_color_of, slot_of};
use crate::{FormatError, ReadLimits, Reading, quote};
use visage_geometry::{Point3, RangeGrid};

/// Reads a PCD file: points, normals, colours and intensities, the grid of an organised scan, and where the sensor
/// stood.
///
/// Read of each point: `x y z`, `normal_x normal_y normal_z`, `rgb` (or `rgba`, or `r g b` of any type and range) and
/// `intensity`. Points of which a coordinate is not finite are left out: they stand for pixels that saw nothing. A
/// `VIEWPOINT` at the origin is what programs write that know of none, so it counts only for organised scans.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// point for the rest: no positions, no points, coordinates that are too large, damaged compression.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let header = Header::parse(bytes)?;
    let limit = limits.most_points();
    if header.points() > limit {
        return Err(FormatError::TooLarge { what: "points", found: header.points(), limit });
    }
    let mut budget = limits.budget();
    let columns = Columns::of(&header.fields)?;
    let body = &bytes[header.body_start..];
    let count = header.points() as usize;
    let points = match header.encoding {
        Encoding::Ascii => read_ascii(&header, &columns, body, &mut budget)?,
        Encoding::Binary => {
            check_length(&header, body.len(), header.stride())?;
            let rows = columns.bytes.iter().map(|c| Place { first: c.offset, step: header.stride(), ..*c });
            take_all(&header, &columns, &rows.collect::<Vec<_>>(), body, &mut budget)?
        }
        Encoding::Compressed => {
            check_unpacked(&header, body, limits)?;
            let kept_widths: usize = columns.bytes.iter().map(|c| c.width).sum();
            budget.take(header.points(), kept_widths)?;
            let wanted: Vec<_> = columns.bytes.iter().map(|c| c.offset * count..(c.offset + c.width) * count).collect();
            let unpacked = lzf::unpack(&body[SIZES..][..packed_size(body)], header.stride() * count, &wanted)
                .ok_or_else(|| damaged("the compressed data is damaged".into()))?;
            let mut first = 0;
            let runs = columns.bytes.iter().map(|c| {
                first += c.width * count;
                Place { first: first - c.width * count, step: c.width, ..*c }
            });
            take_all(&header, &columns, &runs.collect::<Vec<_>>(), &unpacked, &mut budget)?
        }
    };
    finish(points, &header, &mut budget)
}

/// Where one slot's value stands in binary data: `first + step * point`.
#[derive(Debug, Clone, Copy)]
struct Place {
    slot: usize,
    number: NumberType,
    size: usize,
    /// Bytes of the fields before it in a point, and of its whole field.
    offset: usize,
    width: usize,
    first: usize,
    step: usize,
}

/// Which values are kept.
struct Columns {
    bytes: Vec<Place>,
    /// For each value of a line: its slot and type, if it is kept.
    words: Vec<Option<(usize, NumberType)>>,
    layout: Layout,
}

impl Columns {
    fn of(fields: &[Field]) -> Result<Self, FormatError> {
        let (mut bytes, mut words): (Vec<Place>, Vec<_>) = (Vec::new(), Vec::new());
        let mut offset = 0;
        for field in fields {
            let slot = slot_of(&field.name).filter(|_| field.count == 1);
            // a packed colour has four bytes
            let slot = slot.filter(|slot| *slot != PACKED || field.size == 4);
            let slot = slot.filter(|slot| bytes.iter().all(|column| column.slot != *slot));
            let (size, width) = (field.size, field.size * field.count);
            if let Some(slot) = slot {
                bytes.push(Place { slot, number: field.number, size, offset, width, first: 0, step: 0 });
            }
            words.extend((0..field.count).map(|_| slot.map(|slot| (slot, field.number))));
            offset += width;
        }
        let column = |slot: usize| bytes.iter().find(|column| column.slot == slot);
        let channels = |slot: usize| column(slot).map_or(Channels::Floats, Place::channels);
        let layout = Layout::of(|slot| column(slot).is_some(), channels)?;
        Ok(Columns { layout, bytes, words })
    }
}

impl Place {
    fn channels(&self) -> Channels {
        match (self.number, self.size) {
            (NumberType::Float, _) => Channels::Floats,
            (NumberType::Unsigned, 1) => Channels::Bytes,
            (_, 1) => Channels::SignedBytes,
            (NumberType::Signed, 2) => Channels::Whole(u32::from(i16::MAX.unsigned_abs())),
            (NumberType::Unsigned, 2) => Channels::Whole(u32::from(u16::MAX)),
            _ => Channels::Whole(u32::MAX),
        }
    }
}

/// Takes all points of binary data, whose length has been checked.
fn take_all(
    header: &Header,
    columns: &Columns,
    places: &[Place],
    data: &[u8],
    budget: &mut Budget,
) -> Result<Points, FormatError> {
    let count = header.points() as usize;
    budget.take(header.points(), columns.layout.bytes())?;
    let mut points = Points::new(&columns.layout, count);
    for point in 0..count {
        let mut values = [0.0; SLOTS];
        for place in places {
            let from = place.first + place.step * point;
            let bytes = data.get(from..from + place.size).unwrap_or_default();
            values[place.slot] = match (place.slot, bytes.try_into()) {
                (PACKED, Ok(bits)) => packed_color(u32::from_le_bytes(bits), place.number == NumberType::Float),
                _ => number(bytes, place.number),
            };
        }
        push(&mut points, &values, || format!("point {point} of {count}"))?;
    }
    Ok(points)
}

fn push(points: &mut Points, values: &Values, place: impl Fn() -> String) -> Result<(), FormatError> {
    points
        .push(values)
        .map_err(|problem| FormatError::malformed(place(), problem, "repair the file or export it again"))
}

fn finish(mut points: Points, header: &Header, budget: &mut Budget) -> Result<Reading, FormatError> {
    if header.has_bad_viewpoint {
        points.dropped.notes.push("VIEWPOINT is not used: it is seven numbers".into());
    }
    let is_organised = header.height > 1;
    let mut grid = None;
    if is_organised {
        budget.take(header.points(), size_of::<u32>())?;
        let (columns, rows) = (header.width as usize, header.height as usize);
        grid = Some(RangeGrid { columns, rows, pixels: (0..points.seen() as u32).collect() });
    }
    let at_origin = |viewpoint: &[f64; 3]| *viewpoint == [0.0; 3];
    let sensor = header.viewpoint.filter(|viewpoint| is_organised || !at_origin(viewpoint));
    points.finish(Vec::new(), grid, sensor.map(Point3::from))
}

/// A number from its bytes, little-endian; 0 from none.
fn number(bytes: &[u8], kind: NumberType) -> f64 {
    let mut wide = [0u8; 8];
    wide[..bytes.len().min(8)].copy_from_slice(&bytes[..bytes.len().min(8)]);
    let bits = u64::from_le_bytes(wide);
    let unused = 64 - 8 * bytes.len().clamp(1, 8) as u32;
    match (kind, bytes.len()) {
        (NumberType::Float, 4) => f32::from_bits(bits as u32).into(),
        (NumberType::Float, 8) => f64::from_bits(bits),
        // there is no float of one or two bytes: not a number
        (NumberType::Float, _) => f64::NAN,
        (NumberType::Unsigned, _) => bits as f64,
        (NumberType::Signed, _) => (((bits << unused) as i64) >> unused) as f64,
    }
}

fn check_length(header: &Header, found: usize, stride: usize) -> Result<(), FormatError> {
    let needed = header.points().checked_mul(stride as u64);
    if needed.is_some_and(|needed| needed <= found as u64) {
        return Ok(());
    }
    Err(FormatError::Truncated {
        declared: format!("{} points", header.points()),
        found: format!("the {found} bytes after its header"),
    })
}

/// Bytes before the compressed data: its size, and what it unpacks to.
const SIZES: usize = 8;

fn damaged(problem: String) -> FormatError {
    FormatError::malformed("data", problem, "export the file again")
}

/// The size of the compressed data; the body has been checked.
fn packed_size(body: &[u8]) -> usize {
    body.first_chunk().map_or(0, |size| u32::from_le_bytes(*size) as usize)
}

/// Checks what compressed data unpacks to, before it is: the values of the first field for all points, then those of
/// the second, and so on.
fn check_unpacked(header: &Header, body: &[u8], limits: &ReadLimits) -> Result<(), FormatError> {
    let [_, _, _, _, u0, u1, u2, u3, packed @ ..] = body else {
        return Err(damaged("the sizes of the compressed data are missing".into()));
    };
    let size = u32::from_le_bytes([*u0, *u1, *u2, *u3]);
    if packed_size(body) > packed.len() {
        return Err(FormatError::Truncated {
            declared: format!("{} bytes of compressed data", packed_size(body)),
            found: format!("the {} bytes after its header", body.len()),
        });
    }
    let needed = header.points().checked_mul(header.stride() as u64);
    if needed != Some(u64::from(size)) || size as usize > packed_size(body).saturating_mul(lzf::MAX_GROWTH) {
        return Err(damaged(format!("{size} bytes of data don't make {} points", header.points())));
    }
    if u64::from(size) > limits.max_bytes {
        let found = u64::from(size);
        return Err(FormatError::TooManyBytes { what: "unpacked, it has", found, limit: limits.max_bytes });
    }
    Ok(())
}

fn read_ascii(header: &Header, columns: &Columns, body: &[u8], budget: &mut Budget) -> Result<Points, FormatError> {
    // the shortest value has a digit and what parts it from the next; the last may lack that
    let least = 2 * columns.words.len();
    check_length(header, body.len().saturating_add(1), least)?;
    budget.take(header.points(), columns.layout.bytes())?;
    let mut points = Points::new(&columns.layout, header.points() as usize);
    let mut position = 0;
    for point in 0..header.points() {
        let Some(line) = next_line(body, &mut position) else {
            return Err(FormatError::Truncated {
                declared: format!("{} points", header.points()),
                found: format!("point {point}"),
            });
        };
        let place = || format!("point {point} (line {})", header.lines + 1 + lines_of(&body[..position]));
        let values = line_values(line, columns)
            .map_err(|problem| FormatError::malformed(place(), problem, "repair the file or export it again"))?;
        push(&mut points, &values, place)?;
    }
    Ok(points)
}

/// The next line from `position` on that isn't blank; `position` then is where it ends.
fn next_line<'a>(body: &'a [u8], position: &mut usize) -> Option<&'a [u8]> {
    let start = *position + body[*position..].iter().position(|byte| !byte.is_ascii_whitespace())?;
    let rest = &body[start..];
    let length = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
    *position = start + length;
    Some(&rest[..length])
}

fn line_values(line: &[u8], columns: &Columns) -> Result<Values, String> {
    let mut values = [0.0; SLOTS];
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    for column in &columns.words {
        let word = words.next().ok_or("the line has fewer numbers than the header declares")?;
        let Some((slot, kind)) = *column else { continue };
        let value = parse(word).ok_or_else(|| format!("{} is no number", quote(word)))?;
        values[slot] = if slot == PACKED { packed_color_of(value, kind == NumberType::Float) } else { value };
    }
    Ok(values)
}

#[cfg(test)]
mod tests;
