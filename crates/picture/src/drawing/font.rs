//! Letters: Noto Sans Mono, drawn once and for all in a few sizes.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, RasterizedChar, get_raster, get_raster_width};

/// A size of letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Font(RasterHeight);

impl Font {
    /// The smallest that can be read.
    pub const SMALL: Font = Font(RasterHeight::Size16);
    /// For most things on larger pictures.
    pub const MEDIUM: Font = Font(RasterHeight::Size20);
    /// For titles.
    pub const LARGE: Font = Font(RasterHeight::Size24);
    /// For very large pictures.
    pub const HUGE: Font = Font(RasterHeight::Size32);

    /// What suits a picture whose shorter side has so many pixels.
    pub fn for_side(pixels: u32) -> Font {
        match pixels {
            0..720 => Font::SMALL,
            720..1200 => Font::MEDIUM,
            1200..1800 => Font::LARGE,
            _ => Font::HUGE,
        }
    }

    /// The height of a line.
    pub fn height(self) -> f64 {
        self.0.val() as f64
    }

    /// The width of a letter; all have the same.
    pub fn advance(self) -> f64 {
        get_raster_width(FontWeight::Regular, self.0) as f64
    }

    /// The width of a text.
    pub fn width(self, text: &str) -> f64 {
        self.advance() * text.chars().count() as f64
    }

    /// How dark a letter is at each place; one that is not in the font is a question mark.
    pub(super) fn letter(self, letter: char) -> Option<RasterizedChar> {
        let of = |letter| get_raster(letter, FontWeight::Regular, self.0);
        of(letter).or_else(|| of('?'))
    }
}
