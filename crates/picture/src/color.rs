//! Colours: between screens' values and light, and maps from figures to colours that look as even as the figures are.

use crate::image::Rgb;

/// The ground of all pictures.
pub const GROUND: Rgb = [250, 250, 249];
/// Text and lines.
pub const INK: Rgb = [38, 40, 46];
/// Less important lines.
pub const FAINT: Rgb = [206, 208, 212];
/// What has no colour of its own: plaster.
pub const PLAIN: Rgb = [206, 201, 194];
/// What nothing is known of.
pub const UNKNOWN: Rgb = [150, 152, 156];
/// What needs a look.
pub const ALARM: Rgb = [200, 62, 42];
/// What is as it should be.
pub const CALM: Rgb = [38, 108, 170];

/// A screen's value as light, 0 to 1.
pub(crate) fn light_of(value: u8) -> f32 {
    let x = f32::from(value) / 255.0;
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// Light, 0 to 1, as a screen's value.
pub(crate) fn value_of(light: f32) -> u8 {
    let x = light.clamp(0.0, 1.0);
    let value = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * value).round() as u8
}

/// Both as tables, for the many.
pub(crate) struct Tables {
    lights: [f32; 256],
    values: Vec<u8>,
}

impl Tables {
    const STEPS: usize = 4096;

    pub(crate) fn new() -> Tables {
        let lights = std::array::from_fn(|value| light_of(value as u8));
        let values = (0..=Tables::STEPS).map(|step| value_of(step as f32 / Tables::STEPS as f32)).collect();
        Tables { lights, values }
    }

    #[inline]
    pub(crate) fn light(&self, color: Rgb) -> [f32; 3] {
        color.map(|value| self.lights[usize::from(value)])
    }

    #[inline]
    pub(crate) fn color(&self, light: [f32; 3]) -> Rgb {
        light.map(|x| {
            let step = (x.clamp(0.0, 1.0) * Tables::STEPS as f32 + 0.5) as usize;
            self.values.get(step).copied().unwrap_or(u8::MAX)
        })
    }
}

/// A colour by lightness (0 to 1), chroma, and hue (degrees) in Oklab, where equal steps look equal.
/// Chroma is lowered until the colour can be shown.
pub fn oklch(lightness: f64, chroma: f64, hue: f64) -> Rgb {
    let (sine, cosine) = hue.to_radians().sin_cos();
    let light = |chroma: f64| light_of_oklab([lightness, chroma * cosine, chroma * sine]);
    let is_shown = |chroma: f64| light(chroma).iter().all(|x| (-1e-4..=1.0001).contains(x));
    let (mut low, mut high) = if is_shown(chroma) { (chroma, chroma) } else { (0.0, chroma) };
    for _ in 0..20 {
        let middle = (low + high) / 2.0;
        if is_shown(middle) { low = middle } else { high = middle }
    }
    light(low).map(|x| value_of(x as f32))
}

/// Ottosson's Oklab to light.
fn light_of_oklab([lightness, a, b]: [f64; 3]) -> [f64; 3] {
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
}

/// From figures to colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Map {
    /// From dark (0) to bright (1): blue over green to yellow, evenly in lightness.
    Sequential,
    /// Blue (0), nearly white (0.5), red (1).
    Diverging,
}

impl Map {
    /// The colour of a share, 0 to 1; [`UNKNOWN`] for what is no number.
    pub fn color(self, share: f64) -> Rgb {
        if share.is_nan() {
            return UNKNOWN;
        }
        let share = share.clamp(0.0, 1.0);
        match self {
            Map::Sequential => oklch(0.30 + 0.62 * share, 0.13 + 0.02 * share, 285.0 - 180.0 * share),
            Map::Diverging => {
                let size = (2.0 * share - 1.0).abs();
                let hue = if share < 0.5 { 255.0 } else { 29.0 };
                oklch(0.96 - 0.46 * size, 0.19 * size, hue)
            }
        }
    }

    /// The same for many: a table of 256 steps.
    pub fn table(self) -> Vec<Rgb> {
        (0..256).map(|step| self.color(f64::from(step) / 255.0)).collect()
    }

    /// The colours of many figures between two bounds.
    pub fn colors(self, figures: &[f64], [least, most]: [f64; 2]) -> Vec<Rgb> {
        let table = self.table();
        let range = most - least;
        let color = |figure: &f64| {
            let share = if range > 0.0 { (figure - least) / range } else { 0.5 };
            if share.is_nan() { UNKNOWN } else { table[(share.clamp(0.0, 1.0) * 255.0).round() as usize] }
        };
        figures.iter().map(color).collect()
    }
}

/// The colour of one of several things that have no order. Neighbours differ most; thirty and more can be told apart.
pub fn category(index: usize) -> Rgb {
    // hues go round by the golden angle, lightness by thirds, so that what shares a hue differs in lightness
    const LIGHTNESS: [f64; 3] = [0.64, 0.80, 0.50];
    const CHROMA: [f64; 3] = [0.17, 0.13, 0.14];
    let hue = 250.0 + 137.507_764 * index as f64;
    oklch(LIGHTNESS[index % 3], CHROMA[index % 3], hue % 360.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lightness(color: Rgb) -> f32 {
        let [red, green, blue] = color.map(light_of);
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }

    #[test]
    fn light_and_back_is_the_same_value() {
        let tables = Tables::new();
        for value in 0..=255 {
            assert_eq!(value_of(light_of(value)), value);
            let through = tables.color(tables.light([value; 3]))[0];
            assert!(through.abs_diff(value) <= 1, "{value}: {through}");
        }
    }

    #[test]
    fn the_sequential_map_never_becomes_darker_and_has_no_step() {
        let table = Map::Sequential.table();
        assert!(table.windows(2).all(|pair| lightness(pair[1]) >= lightness(pair[0]) - 0.004), "{table:?}");
        let step = |pair: &[Rgb]| (0..3).map(|c| pair[0][c].abs_diff(pair[1][c])).max();
        assert!(
            table.windows(2).all(|pair| step(pair) < Some(12)),
            "{:?}",
            table.windows(2).map(step).collect::<Vec<_>>()
        );
    }

    #[test]
    fn the_diverging_map_is_brightest_in_its_middle() {
        let [low, middle, high] = [0.0, 0.5, 1.0].map(|share| Map::Diverging.color(share));
        assert!(low[2] > low[0] && high[0] > high[2] && middle.iter().all(|value| *value > 225), "{middle:?}");
        assert_eq!(Map::Diverging.color(f64::NAN), UNKNOWN);
        assert_eq!(
            Map::Diverging.colors(&[0.0, f64::NAN, 3.0], [-1.0, 1.0])[1..],
            [UNKNOWN, Map::Diverging.color(1.0)]
        );
    }

    #[test]
    fn twenty_things_are_told_apart() {
        let colors: Vec<Rgb> = (0..20).map(category).collect();
        for (index, one) in colors.iter().enumerate() {
            for other in &colors[..index] {
                let apart: u32 = (0..3).map(|c| u32::from(one[c].abs_diff(other[c])).pow(2)).sum();
                assert!(apart > 24 * 24, "{one:?} {other:?}");
            }
        }
    }
}
