//! `exp(-x)` for the small x of Gaussian weights: a few multiplications instead of a call of the library, which would
//! cost more than the rest of a weighted sum. The same bits on every machine.

use wide::f32x4;

/// `exp(-x)` for x in [0, 2], relative error below 1e-5: the series of `exp(-x / 4)` to the fourth power.
#[inline]
pub fn falloff(x: f64) -> f64 {
    let t = -0.25 * x;
    let series =
        1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0))))));
    let squared = series * series;
    squared * squared
}

/// The same for four in f32: `exp(-x / 4)` to the fourth power.
#[inline(always)]
pub fn falloff_lanes(x: f32x4) -> f32x4 {
    let root = near_falloff_lanes(f32x4::splat(0.25) * x);
    let squared = root * root;
    squared * squared
}

/// `exp(-x)` for x in [0, 1/2], in f32, relative error below 2e-6: all that a Gaussian cut off at its sigma needs. The
/// polynomial of degree 4 with the least greatest relative error there.
#[inline(always)]
pub fn near_falloff_lanes(x: f32x4) -> f32x4 {
    let [a, b, c, d, e] = [0.999_999_5, -0.999_952_87, 0.499_275_7, -0.162_670_94, 0.032_365_627].map(f32x4::splat);
    a + x * (b + x * (c + x * (d + x * e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest argument it is made for.
    const MOST: f64 = 2.0;

    fn of_lanes(falloff: fn(f32x4) -> f32x4, x: f64) -> f64 {
        f64::from(falloff(f32x4::splat(x as f32)).to_array()[0])
    }

    #[test]
    fn it_is_the_exponential() {
        for k in 0..=200 {
            let x = MOST * f64::from(k) / 200.0;
            assert!((falloff(x) / (-x).exp() - 1.0).abs() < 1e-5, "{x}");
            assert!((of_lanes(falloff_lanes, x) / (-x).exp() - 1.0).abs() < 1e-5, "{x}");
        }
        assert_eq!(falloff(0.0), 1.0);
        for k in 0..=200 {
            let x = 0.5 * f64::from(k) / 200.0;
            assert!((of_lanes(near_falloff_lanes, x) / (-x).exp() - 1.0).abs() < 2e-6, "{x}");
        }
    }
}
