//! Pictures that textures are in: PNG and JPEG, unpacked within the budget.

use std::io::Cursor;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::FormatError;
use crate::budget::Budget;
use crate::guard::guarded;

/// No texture is wider or higher.
const MOST_SIDE: usize = 1 << 16;
/// Bytes of a pixel while it is unpacked: its channels, and as much again on the way.
const PIXEL: usize = 8;

/// A picture, row by row from the top.
pub(crate) struct Image {
    width: usize,
    height: usize,
    /// Bytes of a pixel: grey, grey and opacity, colour, colour and opacity.
    channels: usize,
    bytes: Vec<u8>,
}

impl Image {
    /// Unpacks a picture; why it can't be read, in words, is the inner error: that costs colours and not the file.
    pub(crate) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Result<Image, String>, FormatError> {
        let unpack = if bytes.starts_with(b"\x89PNG") {
            png
        } else if bytes.starts_with(b"\xff\xd8") {
            jpeg
        } else {
            let begin = crate::quote(&bytes[..bytes.len().min(8)]);
            return Ok(Err(format!("is neither PNG nor JPEG: it begins with {begin}")));
        };
        guarded(|| unpack(bytes, budget)).unwrap_or_else(|| Ok(Err("is a picture that makes no sense".into())))
    }

    /// The colour of the pixel at a place, both coordinates from 0 to 1 and from the top left.
    pub(crate) fn color(&self, u: f64, v: f64) -> Option<[u8; 3]> {
        if !(u.is_finite() && v.is_finite()) {
            return None;
        }
        let pixel = |x: f64, size: usize| ((x * size as f64) as usize).min(size.saturating_sub(1));
        let start = (pixel(v, self.height) * self.width + pixel(u, self.width)) * self.channels;
        match *self.bytes.get(start..start + self.channels)? {
            [grey] | [grey, _] => Some([grey; 3]),
            [red, green, blue] | [red, green, blue, _] => Some([red, green, blue]),
            _ => None,
        }
    }
}

/// A coordinate of a texture that repeats. Its far edge is that of the picture, and not the next one's first.
pub(crate) fn repeated(place: f64) -> f64 {
    if (0.0..=1.0).contains(&place) { place } else { place.rem_euclid(1.0) }
}

fn take(width: usize, height: usize, budget: &mut Budget) -> Result<Result<(), String>, FormatError> {
    if width.max(height) > MOST_SIDE || width.min(height) == 0 {
        return Ok(Err(format!("has {width} x {height} pixels")));
    }
    budget.take_description((width * height) as u64, PIXEL).map(Ok)
}

fn png(bytes: &[u8], budget: &mut Budget) -> Result<Result<Image, String>, FormatError> {
    let broken = |error: png::DecodingError| Ok(Err(format!("is no sound PNG: {error}")));
    let limits = png::Limits { bytes: 64 << 20 };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let mut reader = match decoder.read_info() {
        Ok(reader) => reader,
        Err(error) => return broken(error),
    };
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    if let Err(problem) = take(width, height, budget)? {
        return Ok(Err(problem));
    }
    let Some(size) = reader.output_buffer_size().filter(|size| *size <= width * height * 4) else {
        return Ok(Err("has pixels of a kind that is not read".into()));
    };
    let mut pixels = vec![0; size];
    match reader.next_frame(&mut pixels) {
        Ok(frame) => Ok(Ok(Image { width, height, channels: frame.color_type.samples(), bytes: pixels })),
        Err(error) => broken(error),
    }
}

fn jpeg(bytes: &[u8], budget: &mut Budget) -> Result<Result<Image, String>, FormatError> {
    let options = DecoderOptions::default()
        .set_max_width(MOST_SIDE)
        .set_max_height(MOST_SIDE)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    if let Err(error) = decoder.decode_headers() {
        return Ok(Err(format!("is no sound JPEG: {error}")));
    }
    let Some((width, height)) = decoder.dimensions() else { return Ok(Err("has no size".into())) };
    if let Err(problem) = take(width, height, budget)? {
        return Ok(Err(problem));
    }
    match decoder.decode() {
        Ok(pixels) if pixels.len() == width * height * 3 => Ok(Ok(Image { width, height, channels: 3, bytes: pixels })),
        Ok(_) => Ok(Err("has pixels of a kind that is not read".into())),
        Err(error) => Ok(Err(format!("is no sound JPEG: {error}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadLimits;

    fn png_of(width: u32, height: u32, color: png::ColorType, pixels: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().expect("a header");
        writer.write_image_data(pixels).expect("pixels");
        writer.finish().expect("an end");
        bytes
    }

    #[test]
    fn a_place_is_a_pixel() {
        let bytes = png_of(2, 2, png::ColorType::Rgb, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        let picture = Image::read(&bytes, &mut ReadLimits::default().budget()).expect("small").expect("sound");
        let colors = [(0.0, 0.0), (0.9, 0.1), (0.2, 0.7), (1.0, 1.0)].map(|(u, v)| picture.color(u, v));
        assert_eq!(colors, [Some([1, 2, 3]), Some([4, 5, 6]), Some([7, 8, 9]), Some([10, 11, 12])]);
        assert_eq!(picture.color(f64::NAN, 0.0), None);
        assert_eq!((repeated(1.0), repeated(1.25), repeated(-0.25)), (1.0, 0.25, 0.75));
        let grey = png_of(1, 1, png::ColorType::GrayscaleAlpha, &[7, 0]);
        let picture = Image::read(&grey, &mut ReadLimits::default().budget()).expect("small").expect("sound");
        assert_eq!(picture.color(0.5, 0.5), Some([7; 3]));
    }

    #[test]
    fn a_large_picture_is_refused_before_it_is_unpacked() {
        let bytes = png_of(4000, 4000, png::ColorType::Grayscale, &vec![0; 16_000_000]);
        let mut budget = ReadLimits { max_points: 1000, max_faces: 0, max_bytes: 0 }.budget();
        assert!(matches!(Image::read(&bytes, &mut budget), Err(FormatError::TooManyBytes { .. })));
    }

    #[test]
    fn what_is_no_picture_is_said() {
        for bytes in [&b""[..], b"RIFF", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0"] {
            assert!(Image::read(bytes, &mut ReadLimits::default().budget()).expect("small").is_err());
        }
    }
}
