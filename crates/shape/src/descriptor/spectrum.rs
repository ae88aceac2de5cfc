//! What of an image neither a shift nor a mirror changes: the magnitudes of its Fourier transform, in bands.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use super::maps::{Map, SIDE};

/// Where the bands of frequencies begin along either axis, and where the last ends: each is about as wide as those before it together,
/// since details of that size are where things of one kind differ.
const BANDS: [usize; 5] = [0, 1, 2, 4, 9];
const COUNT: usize = BANDS.len() - 1;
/// Frequencies along an axis.
const FREQUENCIES: usize = BANDS[COUNT];
/// Numbers of a spectrum.
pub(super) const NUMBERS: usize = COUNT * COUNT;

/// Added side by side: as many as fit into the processor's registers.
const LANES: usize = 8;

/// For each width of an image, the cosines and sines along it of each frequency.
struct Waves {
    cosines: Vec<Vec<f32>>,
    sines: Vec<Vec<f32>>,
}

impl Waves {
    fn new(width: usize) -> Waves {
        let wave = |of: fn(f64) -> f64, frequency: usize| {
            let angle = |x: usize| TAU * ((frequency * x) % width) as f64 / width as f64;
            (0..width).map(|x| of(angle(x)) as f32).collect()
        };
        let waves = |of: fn(f64) -> f64| (0..FREQUENCIES).map(|frequency| wave(of, frequency)).collect();
        Waves { cosines: waves(f64::cos), sines: waves(f64::sin) }
    }
}

static ALONG_SIDE: LazyLock<Waves> = LazyLock::new(|| Waves::new(SIDE));
static ALONG_PANORAMA: LazyLock<Waves> = LazyLock::new(|| Waves::new(2 * SIDE));

fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum()
}

/// For each pair of bands along the rows and the columns the mean root of the magnitudes there, times the root of their number.
pub(super) fn spectrum(map: &Map) -> [f32; NUMBERS] {
    let (waves, across) = (if map.width == SIDE { &*ALONG_SIDE } else { &*ALONG_PANORAMA }, &*ALONG_SIDE);
    // of each row, then of the columns of those
    let (mut real, mut imaginary) = (vec![0.0f32; FREQUENCIES * SIDE], vec![0.0f32; FREQUENCIES * SIDE]);
    for (y, row) in map.values.chunks_exact(map.width).enumerate() {
        if row.iter().all(|value| *value == 0.0) {
            continue;
        }
        for v in 0..FREQUENCIES {
            real[v * SIDE + y] = dot(row, &waves.cosines[v]);
            imaginary[v * SIDE + y] = -dot(row, &waves.sines[v]);
        }
    }
    let mut bands = [0.0; NUMBERS];
    for v in 0..FREQUENCIES {
        let (real, imaginary) = (&real[v * SIDE..][..SIDE], &imaginary[v * SIDE..][..SIDE]);
        for u in 0..FREQUENCIES {
            let (cosines, sines) = (&across.cosines[u], &across.sines[u]);
            let [rc, rs, ic, is] =
                [dot(real, cosines), dot(real, sines), dot(imaginary, cosines), dot(imaginary, sines)];
            // what is upside down has the frequencies of the other sign
            let magnitude = 0.5 * ((rc + is).hypot(ic - rs) + (rc - is).hypot(ic + rs));
            bands[COUNT * band(u) + band(v)] += (magnitude / map.values.len() as f32).sqrt();
        }
    }
    for u in 0..COUNT {
        for v in 0..COUNT {
            // a mean, weighed as so many numbers that differ together
            bands[COUNT * u + v] /= ((width(u) * width(v)) as f32).sqrt();
        }
    }
    bands
}

fn width(band: usize) -> usize {
    BANDS[band + 1] - BANDS[band]
}

fn band(frequency: usize) -> usize {
    (0..COUNT).rfind(|band| BANDS[*band] <= frequency).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image without symmetry, moved along its rows, and with its rows or columns backwards.
    fn map(shift: usize, upside_down: bool, mirrored: bool) -> Map {
        let width = 2 * SIDE;
        let value = |place: usize| {
            let (mut y, mut x) = (place / width, (place % width + shift) % width);
            if upside_down {
                y = SIDE - 1 - y;
            }
            if mirrored {
                x = width - 1 - x;
            }
            let (x, y) = (x as f64 / width as f64, y as f64 / SIDE as f64);
            ((6.0 * x + 3.0 * y * y).sin() + (17.0 * x * y).cos() + x * x) as f32
        };
        Map { width, values: (0..width * SIDE).map(value).collect() }
    }

    #[test]
    fn turns_and_mirrors_change_nothing() {
        let own = spectrum(&map(0, false, false));
        for (shift, upside_down, mirrored) in
            [(1, false, false), (50, false, false), (0, true, false), (0, false, true), (9, true, true)]
        {
            let other = spectrum(&map(shift, upside_down, mirrored));
            assert!(own.iter().zip(&other).all(|(a, b)| (a - b).abs() < 2e-3), "{own:?} {other:?}");
        }
    }

    #[test]
    fn it_is_the_fourier_transforms() {
        let map = map(0, false, false);
        let magnitude = |u: f64, v: f64| {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (place, value) in map.values.iter().enumerate() {
                let (y, x) = ((place / map.width) as f64, (place % map.width) as f64);
                let angle = TAU * (u * y / SIDE as f64 + v * x / map.width as f64);
                real += f64::from(*value) * angle.cos();
                imaginary -= f64::from(*value) * angle.sin();
            }
            real.hypot(imaginary) / map.values.len() as f64
        };
        let root = |u: f64, v: f64| (0.5 * (magnitude(u, v) + magnitude(-u, v))).sqrt();
        let found = spectrum(&map);
        assert!((f64::from(found[0]) - root(0.0, 0.0)).abs() < 1e-4);
        assert!((f64::from(found[COUNT + 1]) - root(1.0, 1.0)).abs() < 1e-4);
        // the band of 2 and 3 along the rows, at 1 along the columns: the mean of two times the root of two
        let expected = (root(2.0, 1.0) + root(3.0, 1.0)) / 2f64.sqrt();
        assert!((f64::from(found[2 * COUNT + 1]) - expected).abs() < 1e-4);
    }
}
