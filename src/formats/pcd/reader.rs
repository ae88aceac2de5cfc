//! The data of a PCD file to a [`Surface`].

use super::header::{Encoding, Field, Header, NumberType};
use super::lzf;
use crate::formats::{FormatError, ReadLimits, checked_coordinate, quote};
use crate::geometry::{Cloud, Point3, RangeGrid, Surface};

/// Reads a PCD file: points, normals, colours and intensities, the grid of an organised scan, and where the sensor stood.
///
/// Read of each point: `x y z`, `normal_x normal_y normal_z`, `rgb` (or `rgba`) and `intensity`. Points of which a
/// coordinate is NaN are left out: they stand for pixels that saw nothing. A `VIEWPOINT` at the origin is what programs
/// write that know of none, so it counts only for organised scans.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] beyond the limits, [`FormatError::Malformed`] with the point for the rest: no positions,
/// no points, coordinates that are infinite, damaged compression.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Surface, FormatError> {
    let header = Header::parse(bytes)?;
    // u32 indexes points, and its largest value marks an empty pixel
    let limit = limits.max_points.min(u64::from(u32::MAX) - 1);
    if header.points() > limit {
        return Err(FormatError::TooLarge { what: "points", found: header.points(), limit });
    }
    let columns = Columns::of(&header.fields)?;
    let body = &bytes[header.body_start..];
    let mut points = Points::new(&header, &columns);
    match header.encoding {
        Encoding::Ascii => read_ascii(&header, &columns, body, &mut points)?,
        Encoding::Binary => {
            check_length(&header, body.len(), header.stride())?;
            let rows = columns.bytes.iter().map(|c| Place { first: c.offset, step: header.stride(), ..*c });
            points.take_all(&rows.collect::<Vec<_>>(), body)?;
        }
        Encoding::Compressed => {
            let unpacked = unpack(&header, body)?;
            let count = header.points() as usize;
            let runs = columns.bytes.iter().map(|c| Place { first: c.offset * count, step: c.width, ..*c });
            points.take_all(&runs.collect::<Vec<_>>(), &unpacked)?;
        }
    }
    points.finish(&header)
}

/// Slots of a point's values.
const X: usize = 0;
const NORMAL: usize = 3;
const INTENSITY: usize = 6;
const RGB: usize = 7;
const SLOTS: usize = 8;
const SLOT_NAMES: [&str; SLOTS] = ["x", "y", "z", "normal_x", "normal_y", "normal_z", "intensity", "rgb"];

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
}

impl Columns {
    fn of(fields: &[Field]) -> Result<Self, FormatError> {
        let mut columns = Columns { bytes: Vec::new(), words: Vec::new() };
        let mut offset = 0;
        for field in fields {
            let name = if field.name == "rgba" { "rgb" } else { field.name.as_str() };
            let slot = SLOT_NAMES.iter().position(|slot| *slot == name).filter(|_| field.count == 1);
            // a packed colour has four bytes
            let slot = slot.filter(|slot| *slot != RGB || field.size == 4);
            let slot = slot.filter(|slot| !columns.has(*slot));
            let (size, width) = (field.size, field.size * field.count);
            if let Some(slot) = slot {
                let place = Place { slot, number: field.number, size, offset, width, first: 0, step: 0 };
                columns.bytes.push(place);
            }
            columns.words.extend((0..field.count).map(|_| slot.map(|slot| (slot, field.number))));
            offset += width;
        }
        if (X..X + 3).all(|slot| columns.has(slot)) {
            Ok(columns)
        } else {
            let problem = "the points have no x, y and z";
            Err(FormatError::malformed("header", problem, "export the file with positions"))
        }
    }

    fn has(&self, slot: usize) -> bool {
        self.bytes.iter().any(|column| column.slot == slot)
    }
}

/// The points read so far.
struct Points {
    count: usize,
    cloud: Cloud,
    /// For each point of the file its index among those kept.
    pixels: Vec<u32>,
}

impl Points {
    /// Nothing is reserved: what is declared has not been seen yet.
    fn new(header: &Header, columns: &Columns) -> Self {
        let cloud = Cloud {
            points: Vec::new(),
            normals: (NORMAL..NORMAL + 3).all(|slot| columns.has(slot)).then(Vec::new),
            colors: columns.has(RGB).then(Vec::new),
            intensities: columns.has(INTENSITY).then(Vec::new),
        };
        Points { count: header.points() as usize, cloud, pixels: Vec::new() }
    }

    /// Takes all points of binary data, whose length has been checked.
    fn take_all(&mut self, places: &[Place], data: &[u8]) -> Result<(), FormatError> {
        for point in 0..self.count {
            let mut values = [0.0; SLOTS];
            let mut color = 0;
            for place in places {
                let from = place.first + place.step * point;
                let bytes = data.get(from..from + place.size).unwrap_or_default();
                if place.slot == RGB {
                    color = bytes.try_into().map_or(0, u32::from_le_bytes);
                } else {
                    values[place.slot] = number(bytes, place.number);
                }
            }
            self.take(point, &values, color)?;
        }
        Ok(())
    }

    fn take(&mut self, point: usize, values: &[f64; SLOTS], color: u32) -> Result<(), FormatError> {
        if values[X..X + 3].iter().any(|value| value.is_nan()) {
            self.pixels.push(RangeGrid::EMPTY);
            return Ok(());
        }
        for slot in X..X + 3 {
            checked_coordinate(values[slot]).map_err(|problem| {
                let place = format!("point {point} of {}", self.count);
                let problem = format!("{} {problem}", SLOT_NAMES[slot]);
                FormatError::malformed(place, problem, "repair the file or export it again")
            })?;
        }
        self.pixels.push(self.cloud.points.len() as u32);
        self.cloud.points.push(Point3::new(values[X], values[X + 1], values[X + 2]));
        if let Some(normals) = &mut self.cloud.normals {
            let normal = nalgebra::Vector3::new(values[NORMAL], values[NORMAL + 1], values[NORMAL + 2]);
            let unit = normal.try_normalize(f64::MIN_POSITIVE).filter(|normal| normal.iter().all(|x| x.is_finite()));
            normals.push(unit.unwrap_or_default().cast());
        }
        if let Some(colors) = &mut self.cloud.colors {
            let [blue, green, red, _] = color.to_le_bytes();
            colors.push([red, green, blue]);
        }
        if let Some(intensities) = &mut self.cloud.intensities {
            let intensity = values[INTENSITY] as f32;
            intensities.push(if intensity.is_finite() { intensity } else { 0.0 });
        }
        Ok(())
    }

    fn finish(self, header: &Header) -> Result<Surface, FormatError> {
        if self.cloud.is_empty() {
            return Err(FormatError::malformed("data", "there are no points", "send a file with points"));
        }
        let is_organised = header.height > 1;
        let (columns, rows) = (header.width as usize, header.height as usize);
        let at_origin = |viewpoint: &[f64; 3]| *viewpoint == [0.0; 3];
        let sensor = header.viewpoint.filter(|viewpoint| is_organised || !at_origin(viewpoint));
        Ok(Surface {
            cloud: self.cloud,
            faces: Vec::new(),
            grid: is_organised.then_some(RangeGrid { columns, rows, pixels: self.pixels }),
            sensor: sensor.map(Point3::from),
        })
    }
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

/// Unpacks compressed data: the values of the first field for all points, then those of the second, and so on.
fn unpack(header: &Header, body: &[u8]) -> Result<Vec<u8>, FormatError> {
    let damaged = |problem: String| FormatError::malformed("data", problem, "export the file again");
    let [p0, p1, p2, p3, u0, u1, u2, u3, packed @ ..] = body else {
        return Err(damaged("the sizes of the compressed data are missing".into()));
    };
    let packed_size = u32::from_le_bytes([*p0, *p1, *p2, *p3]) as usize;
    let size = u32::from_le_bytes([*u0, *u1, *u2, *u3]) as usize;
    let Some(packed) = packed.get(..packed_size) else {
        return Err(FormatError::Truncated {
            declared: format!("{packed_size} bytes of compressed data"),
            found: format!("the {} bytes after its header", body.len()),
        });
    };
    let needed = header.points().checked_mul(header.stride() as u64);
    if needed != Some(size as u64) || size > packed.len().saturating_mul(lzf::MAX_GROWTH) {
        return Err(damaged(format!("{size} bytes of data don't make {} points", header.points())));
    }
    lzf::unpack(packed, size).ok_or_else(|| damaged("the compressed data is damaged".into()))
}

fn read_ascii(header: &Header, columns: &Columns, body: &[u8], points: &mut Points) -> Result<(), FormatError> {
    // the shortest value has a digit and what parts it from the next; the last may lack that
    let least = 2 * columns.words.len();
    check_length(header, body.len().saturating_add(1), least)?;
    let lines = body.split(|byte| *byte == b'\n').enumerate();
    let mut lines =
        lines.map(|(k, line)| (header.lines + k + 1, line.trim_ascii())).filter(|(_, line)| !line.is_empty());
    for point in 0..points.count {
        let Some((line_number, line)) = lines.next() else {
            return Err(FormatError::Truncated {
                declared: format!("{} points", header.points()),
                found: format!("point {point}"),
            });
        };
        let (values, color) = line_values(line, columns).map_err(|problem| {
            let place = format!("point {point} (line {line_number})");
            FormatError::malformed(place, problem, "repair the file or export it again")
        })?;
        points.take(point, &values, color)?;
    }
    Ok(())
}

fn line_values(line: &[u8], columns: &Columns) -> Result<([f64; SLOTS], u32), String> {
    let mut values = [0.0; SLOTS];
    let mut color = 0;
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    for column in &columns.words {
        let word = words.next().ok_or("the line has fewer numbers than the header declares")?;
        let Some((slot, kind)) = *column else { continue };
        let value: f64 = fast_float2::parse(word).map_err(|_| format!("{} is no number", quote(word)))?;
        if slot == RGB {
            // packed into the bits of a float, or a whole number
            color = if kind == NumberType::Float { (value as f32).to_bits() } else { value as i64 as u32 };
        } else {
            values[slot] = value;
        }
    }
    Ok((values, color))
}

#[cfg(test)]
mod tests;
