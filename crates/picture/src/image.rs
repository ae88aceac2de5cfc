//! A finished picture, and its bytes as PNG.

use crate::size::Size;

/// Red, green, blue as screens take them (sRGB).
pub type Rgb = [u8; 3];

/// Pixels row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    size: Size,
    pixels: Vec<Rgb>,
}

impl Image {
    /// A picture of one colour.
    pub fn new(size: Size, color: Rgb) -> Image {
        Image { size, pixels: vec![color; size.pixels()] }
    }

    /// A picture of these pixels; what is lacking is black.
    pub(crate) fn of_pixels(size: Size, mut pixels: Vec<Rgb>) -> Image {
        pixels.resize(size.pixels(), [0; 3]);
        Image { size, pixels }
    }

    /// Its size.
    pub fn size(&self) -> Size {
        self.size
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// The colour at a place; `None` outside.
    pub fn at(&self, x: i64, y: i64) -> Option<Rgb> {
        self.pixels.get(self.index(x, y)?).copied()
    }

    /// Lays a colour over a pixel; `share` 1 covers it, 0 leaves it. Nothing happens outside.
    pub fn blend(&mut self, x: i64, y: i64, color: Rgb, share: f32) {
        let Some(pixel) = self.index(x, y).and_then(|index| self.pixels.get_mut(index)) else { return };
        let share = share.clamp(0.0, 1.0);
        for (under, over) in pixel.iter_mut().zip(color) {
            *under = (f32::from(*under) + share * (f32::from(over) - f32::from(*under))).round() as u8;
        }
    }

    /// Puts another picture onto this one, its corner at a place; what is outside is cut off.
    pub fn put(&mut self, left: i64, top: i64, other: &Image) {
        let width = other.size.width() as usize;
        for (row, pixels) in other.pixels.chunks_exact(width).enumerate() {
            for (column, color) in pixels.iter().enumerate() {
                self.blend(left + column as i64, top + row as i64, *color, 1.0);
            }
        }
    }

    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let (width, height) = (i64::from(self.size.width()), i64::from(self.size.height()));
        let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
        is_inside.then_some((y * width + x) as usize)
    }

    /// As a PNG file.
    ///
    /// # Errors
    /// What the encoder says; it has nothing to say of a picture that is held in memory.
    pub fn to_png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size.width(), self.size.height());
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
        encoder.set_compression(png::Compression::Balanced);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let mut image = Image::new(Size::clamped(20, 17), [10, 20, 30]);
        image.blend(3, 2, [210, 220, 230], 0.5);
        image.blend(-1, 2, [0; 3], 1.0);
        image.blend(20, 2, [0; 3], 1.0);
        let bytes = image.to_png().expect("written");
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        let frame = reader.next_frame(&mut pixels).expect("whole");
        assert_eq!((frame.width, frame.height), (20, 17));
        assert_eq!(&pixels, image.pixels().as_flattened());
        assert_eq!(image.at(3, 2), Some([110, 120, 130]));
        assert_eq!(image.at(4, 2), Some([10, 20, 30]));
        assert_eq!(image.at(20, 2), None);
    }
}
