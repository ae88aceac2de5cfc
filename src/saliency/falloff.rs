//! `exp(-x)` for the small x of Gaussian weights: a few multiplications instead of a call of the library, which would
//! cost more than the rest of a weighted sum. The same bits on every machine.

/// `exp(-x)` for x in [0, 2], relative error below 1e-5: the series of `exp(-x / 4)` to the fourth power.
#[inline]
pub fn falloff(x: f64) -> f64 {
    let t = -0.25 * x;
    let series =
        1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0))))));
    let squared = series * series;
    squared * squared
}

/// The same in f32, for sums over lanes: relative error below 1e-5.
#[inline]
pub fn falloff_lane(x: f32) -> f32 {
    let t = -0.25 * x;
    let series =
        1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0))))));
    let squared = series * series;
    squared * squared
}

/// `exp(-x)` for x in [0, 1/2], in f32, relative error below 2e-6: all that a Gaussian cut off at its sigma needs. The
/// polynomial of degree 4 with the least greatest relative error there.
#[inline(always)]
pub fn near_falloff_lane(x: f32) -> f32 {
    0.999_999_5 + x * (-0.999_952_87 + x * (0.499_275_7 + x * (-0.162_670_94 + x * 0.032_365_627)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest argument it is made for.
    const MOST: f64 = 2.0;

    #[test]
    fn it_is_the_exponential() {
        for k in 0..=200 {
            let x = MOST * f64::from(k) / 200.0;
            assert!((falloff(x) / (-x).exp() - 1.0).abs() < 1e-5, "{x}");
            assert!((f64::from(falloff_lane(x as f32)) / (-x).exp() - 1.0).abs() < 1e-5, "{x}");
        }
        assert_eq!(falloff(0.0), 1.0);
        for k in 0..=200 {
            let x = 0.5 * f64::from(k) / 200.0;
            assert!((f64::from(near_falloff_lane(x as f32)) / (-x).exp() - 1.0).abs() < 2e-6, "{x}");
        }
    }
}
