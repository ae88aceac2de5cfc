//! What is seen at each pixel, before there is light: the mean of its samples.

use rayon::prelude::*;

use super::Grid;
use super::bands::{BAND, Bands, Covering, Key, Samples, of_key};
use super::vector::unit;
use visage_geometry::progress::{Canceled, Progress};

/// What is seen at a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pixel {
    /// The nearest of its samples; 0 where there is nothing.
    pub nearness: f32,
    /// Light of what is there when it is lit in full, 0 to 1 in 16 bits.
    pub light: [u16; 3],
    /// In the axes of the picture, -1 to 1 in 8 bits.
    pub normal: [i8; 3],
    /// Share of the pixel that is covered, 0 to 255.
    pub covered: u8,
    /// Share of that whose inner side is seen, 0 to 255.
    pub inside: u8,
}

impl Pixel {
    pub(super) fn normal(&self) -> [f32; 3] {
        self.normal.map(|x| f32::from(x) / 127.0)
    }

    pub(super) fn light(&self) -> [f32; 3] {
        self.light.map(|x| f32::from(x) / 65535.0)
    }
}

/// What is seen on a picture.
pub(super) struct Seen {
    pub grid: Grid,
    pub pixels: Vec<Pixel>,
}

impl Seen {
    pub(super) fn nearness(&self) -> Vec<f32> {
        self.pixels.iter().map(|pixel| pixel.nearness).collect()
    }
}

/// Draws band by band.
pub(super) fn seen(of: &impl Covering, bands: &Bands, grid: Grid, progress: &Progress) -> Result<Seen, Canceled> {
    let mut pixels = vec![Pixel::default(); grid.width * grid.height];
    pixels.par_chunks_mut(grid.width * BAND).enumerate().try_for_each_init(Vec::new, |keys, (band, pixels)| {
        draw(of, bands.of(band), band, grid, pixels, keys, progress)
    })?;
    Ok(Seen { grid, pixels })
}

/// Things that are drawn between two looks at the flag that stops.
const PATIENCE: usize = 1 << 12;

fn draw(
    of: &impl Covering,
    things: &[u32],
    band: usize,
    grid: Grid,
    pixels: &mut [Pixel],
    keys: &mut Vec<Key>,
    progress: &Progress,
) -> Result<(), Canceled> {
    let rows = pixels.len() / grid.width * grid.fine;
    let first = band * BAND * grid.fine;
    keys.clear();
    keys.resize(rows * grid.columns(), 0);
    let mut samples = Samples { keys, first, rows, columns: grid.columns() };
    for part in things.chunks(PATIENCE) {
        progress.check()?;
        part.iter().for_each(|thing| of.cover(*thing as usize, &mut samples));
    }
    for (row, pixels) in pixels.chunks_exact_mut(grid.width).enumerate() {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            *pixel = resolved(of, &samples, grid.fine, [column, row]);
        }
    }
    Ok(())
}

/// The mean of the samples of a pixel of a band.
#[inline]
fn resolved(of: &impl Covering, samples: &Samples, fine: usize, [column, row]: [usize; 2]) -> Pixel {
    let mut things = [(0u32, 0u32); 4];
    let (mut count, mut covered, mut nearness) = (0, 0, 0f32);
    for sub in 0..fine * fine {
        let place = (row * fine + sub / fine) * samples.columns + column * fine + sub % fine;
        let Some((near, thing)) = of_key(samples.keys[place]) else { continue };
        nearness = nearness.max(near);
        covered += 1;
        match things[..count].iter_mut().find(|(known, _)| *known == thing) {
            Some((_, times)) => *times += 1,
            None => {
                things[count] = (thing, 1);
                count += 1;
            }
        }
    }
    if covered == 0 {
        return Pixel::default();
    }
    let middle = |place: usize, before: usize| (before + place * fine) as f32 + fine as f32 / 2.0;
    let at = [middle(column, 0), middle(row, samples.first)];
    let (mut light, mut normal, mut inside) = ([0f32; 3], [0f32; 3], 0f32);
    for (thing, times) in &things[..count] {
        let look = of.look(*thing as usize, at);
        let share = *times as f32 / covered as f32;
        (0..3).for_each(|k| light[k] += share * look.light[k]);
        (0..3).for_each(|k| normal[k] += share * look.normal[k]);
        inside += if look.is_inside { share } else { 0.0 };
    }
    Pixel {
        nearness,
        light: light.map(|x| (x * 65535.0 + 0.5) as u16),
        normal: unit(normal).unwrap_or([0.0, 0.0, 1.0]).map(|x| (x * 127.0).round() as i8),
        covered: (covered * 255 / (fine * fine)) as u8,
        inside: (inside * 255.0) as u8,
    }
}
