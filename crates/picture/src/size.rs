//! How large a picture is.

use std::fmt;
use std::str::FromStr;

/// Width and height in pixels, each within bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    width: u32,
    height: u32,
}

impl Size {
    /// No side is shorter.
    pub const LEAST: u32 = 16;
    /// No side is longer.
    pub const MOST: u32 = 4096;

    /// A size, if both sides are within bounds.
    pub fn new(width: u32, height: u32) -> Option<Size> {
        let is_sound = |side: u32| (Size::LEAST..=Size::MOST).contains(&side);
        (is_sound(width) && is_sound(height)).then_some(Size { width, height })
    }

    /// A size that is brought within bounds.
    pub fn clamped(width: u32, height: u32) -> Size {
        let within = |side: u32| side.clamp(Size::LEAST, Size::MOST);
        Size { width: within(width), height: within(height) }
    }

    /// Pixels in a row.
    pub fn width(self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(self) -> u32 {
        self.height
    }

    /// All pixels.
    pub(crate) fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Why a text is no size.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("give width x height in pixels, each from {} to {}, such as 800x600", Size::LEAST, Size::MOST)]
pub struct SizeError;

impl FromStr for Size {
    type Err = SizeError;

    fn from_str(text: &str) -> Result<Size, SizeError> {
        let (width, height) = text.split_once('x').ok_or(SizeError)?;
        let side = |digits: &str| {
            let is_plain = !digits.is_empty() && digits.len() <= 4 && digits.bytes().all(|byte| byte.is_ascii_digit());
            if is_plain { digits.parse().map_err(|_| SizeError) } else { Err(SizeError) }
        };
        Size::new(side(width)?, side(height)?).ok_or(SizeError)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_bounds_and_one_spelling() {
        assert_eq!("800x600".parse(), Ok(Size { width: 800, height: 600 }));
        assert_eq!("16x4096".parse::<Size>().map(|size| size.to_string()), Ok("16x4096".to_owned()));
        for wrong in
            ["", "x", "800", "15x600", "800x4097", "+80x60", "80 x60", "80x60x3", "99999999999x60", "-8x60", "8e2x60"]
        {
            assert_eq!(wrong.parse::<Size>(), Err(SizeError), "{wrong}");
        }
    }
}
