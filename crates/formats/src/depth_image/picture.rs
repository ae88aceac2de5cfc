//! PNG files: depths and colours, bounded by what their headers declare before anything of them is unpacked.

use std::io::Cursor;

use crate::budget::Budget;
use crate::guard::guarded;
use crate::{FormatError, ReadLimits};

/// The values of a depth image, row by row.
pub(super) struct Depth {
    pub columns: usize,
    pub rows: usize,
    pub values: Vec<u16>,
}

/// The colours of a picture.
pub(super) struct Colors {
    columns: usize,
    rows: usize,
    /// Bytes of a pixel: grey, grey and alpha, RGB, RGBA.
    samples: usize,
    bytes: Vec<u8>,
}

impl Colors {
    /// The colour that the pixel of an image of another size sees.
    pub fn at(&self, row: usize, column: usize, rows: usize, columns: usize) -> [u8; 3] {
        // the middle of the pixel
        let place = |pixel: usize, of: usize, size: usize| {
            ((2 * pixel + 1) * size / (2 * of).max(1)).min(size.saturating_sub(1))
        };
        let pixel = place(row, rows, self.rows) * self.columns + place(column, columns, self.columns);
        match self.bytes.get(pixel * self.samples..(pixel + 1) * self.samples) {
            Some([red, green, blue, ..]) => [*red, *green, *blue],
            Some([grey, ..]) => [*grey; 3],
            _ => [0; 3],
        }
    }
}

type Decoded = (png::OutputInfo, Vec<u8>);

/// Unpacks a PNG of a size that is allowed.
fn decode(
    bytes: &[u8],
    transformations: png::Transformations,
    limits: &ReadLimits,
    budget: &mut Budget,
) -> Result<Decoded, FormatError> {
    let senseless = || FormatError::malformed("the PNG", "it makes no sense", "export or upload it again");
    guarded(|| unpack(bytes, transformations, limits, budget)).unwrap_or_else(|| Err(senseless()))
}

fn unpack(
    bytes: &[u8],
    transformations: png::Transformations,
    limits: &ReadLimits,
    budget: &mut Budget,
) -> Result<Decoded, FormatError> {
    let malformed = |error: png::DecodingError| {
        FormatError::malformed("the PNG", format!("it can't be unpacked: {error}"), "export or upload it again")
    };
    if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        return Err(FormatError::malformed("byte 0", "it is no PNG", "send a PNG"));
    }
    let limit = usize::try_from(limits.max_bytes).unwrap_or(usize::MAX);
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: limit });
    decoder.set_transformations(transformations);
    decoder.set_ignore_text_chunk(true);
    let info = decoder.read_header_info().map_err(malformed)?;
    let pixels = u64::from(info.width) * u64::from(info.height);
    if pixels > limits.most_points() {
        return Err(FormatError::TooLarge { what: "number of pixels", found: pixels, limit: limits.most_points() });
    }
    let mut reader = decoder.read_info().map_err(malformed)?;
    let size = reader.output_buffer_size().unwrap_or(usize::MAX);
    budget.take(1, size)?;
    let mut buffer = vec![0; size];
    let output = reader.next_frame(&mut buffer).map_err(malformed)?;
    buffer.truncate(output.buffer_size());
    Ok((output, buffer))
}

/// The values of a 16-bit grey PNG.
pub(super) fn depth(bytes: &[u8], limits: &ReadLimits, budget: &mut Budget) -> Result<Depth, FormatError> {
    let (info, buffer) = decode(bytes, png::Transformations::IDENTITY, limits, budget)?;
    if info.color_type != png::ColorType::Grayscale || info.bit_depth != png::BitDepth::Sixteen {
        let problem =
            format!("it holds {:?} of {} bits, not depths: 16-bit grey", info.color_type, info.bit_depth as u8);
        let remedy = "export the raw depth, not a picture of it";
        return Err(FormatError::malformed("the depth image", problem, remedy));
    }
    let pairs = buffer.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]));
    Ok(Depth { columns: info.width as usize, rows: info.height as usize, values: pairs.collect() })
}

/// The colours of a PNG of any kind.
pub(super) fn colors(bytes: &[u8], limits: &ReadLimits, budget: &mut Budget) -> Result<Colors, FormatError> {
    let (info, bytes) = decode(bytes, png::Transformations::normalize_to_color8(), limits, budget)?;
    let samples = info.color_type.samples();
    Ok(Colors { columns: info.width as usize, rows: info.height as usize, samples, bytes })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    fn encoded(columns: u32, rows: u32, color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, columns, rows);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.write_header().expect("a header").write_image_data(data).expect("data");
        bytes
    }

    /// A 16-bit grey PNG.
    pub fn grey16(columns: u32, rows: u32, values: &[u16]) -> Vec<u8> {
        let data: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
        encoded(columns, rows, png::ColorType::Grayscale, png::BitDepth::Sixteen, &data)
    }

    /// An RGB PNG.
    pub fn rgb8(columns: u32, rows: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
        let data: Vec<u8> = (0..rows * columns).flat_map(|pixel| color(pixel / columns, pixel % columns)).collect();
        encoded(columns, rows, png::ColorType::Rgb, png::BitDepth::Eight, &data)
    }

    #[test]
    fn colours_are_those_of_the_middle_of_a_pixel() {
        let limits = ReadLimits::default();
        let picture = colors(&rgb8(4, 2, |row, column| [row as u8, column as u8, 9]), &limits, &mut limits.budget());
        let picture = picture.expect("sound");
        assert_eq!(picture.at(0, 1, 2, 4), [0, 1, 9]);
        assert_eq!(picture.at(0, 1, 1, 2), [1, 3, 9]);
        let grey = encoded(1, 1, png::ColorType::Grayscale, png::BitDepth::Eight, &[5]);
        assert_eq!(colors(&grey, &limits, &mut limits.budget()).expect("sound").at(3, 3, 4, 4), [5, 5, 5]);
    }

    #[test]
    fn what_unpacks_to_more_than_is_allowed_is_refused() {
        let bytes = grey16(2000, 500, &vec![0; 1_000_000]);
        assert!(bytes.len() < 20_000);
        let limits = ReadLimits { max_points: 1_000_000, max_faces: 0, max_bytes: 1 << 30 };
        assert!(depth(&bytes, &limits, &mut limits.budget()).is_ok());
        let few = ReadLimits { max_points: 999_999, ..limits };
        assert!(matches!(depth(&bytes, &few, &mut few.budget()), Err(FormatError::TooLarge { .. })));
    }
}
