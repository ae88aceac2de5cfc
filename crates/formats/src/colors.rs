//! Colours as files have them, in any type and range, as bytes.

/// How the channels of a file's colours are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channels {
    /// A byte each: they stand as they are.
    Bytes,
    /// A signed byte each, by mistake: the same bytes are meant.
    SignedBytes,
    /// Wider whole numbers, which hold at most this.
    Whole(u32),
    /// Fractions of 1, or anything else.
    Floats,
}

/// The largest values that full light has: a byte, two, four.
const FULL: [f32; 3] = [255.0, 65535.0, 4294967295.0];
/// A fraction may be above 1 by this: rounding, no other range.
const ROUNDING: f32 = 1e-3;

/// The colours of a file while it is read. Which range they have is decided by the whole file: floats that reach above
/// 1 are no fractions, whole numbers above 255 no bytes.
#[derive(Debug, Clone)]
pub(super) struct Colors {
    channels: Channels,
    bytes: Vec<[u8; 3]>,
    /// Instead of `bytes`, where the range is not known before the end.
    values: Vec<[f32; 3]>,
    /// How many are not sound.
    pub(super) unsound: u64,
}

impl Colors {
    pub(super) fn new(channels: Channels, count: usize) -> Self {
        let (mut bytes, mut values) = (Vec::new(), Vec::new());
        match channels {
            Channels::Bytes | Channels::SignedBytes => bytes.reserve_exact(count),
            _ => values.reserve_exact(count),
        }
        Colors { channels, bytes, values, unsound: 0 }
    }

    /// Takes the red, green and blue of the next point; one that is not finite makes them unsound.
    #[inline]
    pub(super) fn push(&mut self, color: [f64; 3]) {
        // a sum that is finite has no term that isn't
        let is_sound = (color[0] + color[1] + color[2]).is_finite();
        self.unsound += u64::from(!is_sound);
        let color = if is_sound { color } else { [0.0; 3] };
        match self.channels {
            // `as` from a float saturates
            Channels::Bytes => self.bytes.push(color.map(|channel| channel.round() as u8)),
            Channels::SignedBytes => self.bytes.push(color.map(|channel| channel as i8 as u8)),
            _ => self.values.push(color.map(|channel| channel as f32)),
        }
    }

    /// Takes a colour packed into four bytes, blue first; NaN is none. The channels are bytes.
    #[inline]
    pub(super) fn push_packed(&mut self, packed: f64) {
        let [blue, green, red, _] = (packed as u32).to_le_bytes();
        self.unsound += u64::from(packed.is_nan());
        self.bytes.push([red, green, blue]);
    }

    /// All colours; `None` if none is sound.
    pub(super) fn finish(self) -> Option<Vec<[u8; 3]>> {
        let count = self.bytes.len().max(self.values.len());
        if self.unsound >= count as u64 {
            return None;
        }
        if matches!(self.channels, Channels::Bytes | Channels::SignedBytes) {
            return Some(self.bytes);
        }
        let full = self.full();
        let byte = |channel: f32| (channel.max(0.0) / full * 255.0).round() as u8;
        Some(self.values.iter().map(|color| color.map(byte)).collect())
    }

    /// The value of full light.
    fn full(&self) -> f32 {
        let largest = self.values.iter().flatten().copied().fold(0.0, f32::max);
        let is_shifted = || self.values.iter().flatten().all(|channel| channel % 256.0 == 0.0);
        match self.channels {
            // bytes in the upper half of two
            Channels::Whole(65535) if largest > FULL[0] && is_shifted() => FULL[0] * 256.0,
            Channels::Floats if largest <= 1.0 + ROUNDING => 1.0,
            Channels::Whole(most) if largest > FULL[0] && (most as f32) < FULL[1] => most as f32,
            _ => FULL.into_iter().find(|full| largest <= *full).unwrap_or(largest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(channels: Channels, colors: &[[f64; 3]]) -> Option<Vec<[u8; 3]>> {
        let mut read = Colors::new(channels, colors.len());
        colors.iter().for_each(|color| read.push(*color));
        read.finish()
    }

    #[test]
    fn the_range_is_that_of_the_whole_file() {
        let dark = [0.0, 0.5, 1.0];
        assert_eq!(all(Channels::Floats, &[dark]), Some(vec![[0, 128, 255]]));
        assert_eq!(all(Channels::Floats, &[dark, [200.0, 0.0, 255.0]]), Some(vec![[0, 1, 1], [200, 0, 255]]));
        assert_eq!(all(Channels::Floats, &[[1.0002, 0.2, -0.1]]), Some(vec![[255, 51, 0]]));
        assert_eq!(all(Channels::Whole(65535), &[[257.0, 0.0, 65535.0]]), Some(vec![[1, 0, 255]]));
        assert_eq!(all(Channels::Whole(65535), &[[1.0, 0.0, 255.0]]), Some(vec![[1, 0, 255]]));
        assert_eq!(all(Channels::Whole(65535), &[[256.0, 0.0, 65280.0]]), Some(vec![[1, 0, 255]]));
        assert_eq!(all(Channels::Whole(32767), &[[0.0, 16384.0, 32767.0]]), Some(vec![[0, 128, 255]]));
        assert_eq!(all(Channels::SignedBytes, &[[-1.0, -128.0, 127.0]]), Some(vec![[255, 128, 127]]));
        assert_eq!(all(Channels::Bytes, &[[-1.0, 300.0, 127.0]]), Some(vec![[0, 255, 127]]));
    }

    #[test]
    fn an_unsound_colour_is_black_and_no_sound_one_is_none() {
        let nan = [f64::NAN; 3];
        assert_eq!(all(Channels::Floats, &[nan, [1.0; 3]]), Some(vec![[0; 3], [255; 3]]));
        assert_eq!(all(Channels::Floats, &[nan, nan]), None);
        assert_eq!(all(Channels::Bytes, &[]), None);
    }
}
