//! A bound on dense distances from below that needs no sorting.
//!
//! The distance leaves out the `t` greatest of the squared differences `s_i`. For any ceiling `c`, those left in sum up
//! to at least `sum_i min(s_i, c) - t c`: the ones left out count `c` each at most. So does the sum over some of the
//! points only. It is exact where all points are summed and the ceiling is the least square left out, so a ceiling that
//! fits the reach rules out nearly all there is to rule out.

use visage_shape::faces::dense_signature::{KEPT_SHARE, STEP_MM};

/// Heights of a vector register.
pub(super) const LANES: usize = 16;

/// A distance to be ruled out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// Its square, in steps, a hair greater so that arithmetic decides nothing.
    square: f64,
    /// What differences are capped to, in steps.
    pub ceiling: u8,
}

impl Reach {
    /// Differences are capped to `ceiling` times the distance.
    pub fn new(reach_mm: f64, ceiling: f64) -> Reach {
        let steps = reach_mm.max(0.0) / STEP_MM;
        Reach { square: steps * steps * (1.0 + 1e-9) + 1e-9, ceiling: (ceiling * steps).ceil().clamp(1.0, 255.0) as u8 }
    }

    /// Given the sum of `summed` capped squared differences from a mean that is off by `rest` (at most half a step), of
    /// the `points` that are compared.
    pub fn is_exceeded(&self, capped_squares: u32, summed: usize, points: usize, rest: f64) -> bool {
        let points_kept = (KEPT_SHARE * points as f64).ceil();
        let left_out = points as f64 - points_kept;
        let squares = f64::from(capped_squares);
        // (x - rest)^2 >= x^2 - 2 rest x, and the sum of the x is at most the root of their number times squares
        let least =
            squares - 2.0 * rest * (summed as f64 * squares).sqrt() - left_out * f64::from(self.ceiling).powi(2);
        least > self.square * points_kept
    }
}

/// A mean in whole steps, and how far that is from it.
pub(super) struct Shift {
    pub whole: i16,
    pub rest: f64,
}

impl Shift {
    pub fn new(sum: i32, points: usize) -> Shift {
        // no two heights differ by more; a sum of a damaged file may
        let mean = (f64::from(sum) / points as f64).clamp(-256.0, 256.0);
        Shift { whole: mean.round() as i16, rest: (mean - mean.round()).abs() }
    }
}

/// `min(|a - b - shift|, ceiling)^2`
pub(super) fn capped_square(a: u8, b: u8, shift: i16, ceiling: u8) -> u32 {
    u32::from((i16::from(a) - i16::from(b) - shift).unsigned_abs().min(u16::from(ceiling))).pow(2)
}

/// The sum of the capped squares.
pub(super) fn capped_squares<const COUNT: usize>(a: &[u8; COUNT], b: &[u8; COUNT], shift: i16, ceiling: u8) -> u32 {
    const { assert!(COUNT.is_multiple_of(LANES)) };
    if shift != 0 {
        return a.iter().zip(b).map(|(a, b)| capped_square(*a, *b, shift, ceiling)).sum();
    }
    // register by register, which the compiler turns into vector instructions
    let square = |a: u8, b: u8| {
        let trimmed_lower_bound = i32::from(a.abs_diff(b).min(ceiling));
        trimmed_lower_bound * trimmed_lower_bound
    };
    let registers = a.chunks_exact(LANES).zip(b.chunks_exact(LANES));
    registers.map(|(a, b)| (0..LANES).map(|k| square(a[k], b[k])).sum::<i32>() as u32).sum()
}
