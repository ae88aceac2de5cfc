//! How much a residual is believed: the farther from zero, the less.

use nalgebra::RealField;

/// The kernel of Geman and McClure ("Statistical methods for tomographic image reconstruction", 1987): a residual r
/// costs `s^2 r^2 / (s^2 + r^2)`, so that one far beyond the scale s costs `s^2` and pulls no more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustKernel<T> {
    scale2: T,
}

impl<T: RealField + Copy> RobustKernel<T> {
    /// With the square of the scale, a squared residual.
    #[inline]
    pub fn with_squared_scale(scale2: T) -> Self {
        RobustKernel { scale2 }
    }

    /// For correspondences that are searched for within `reach`: half of them at most are believed by less than a
    /// quarter if residuals are spread evenly.
    #[inline]
    pub fn within(reach: T) -> Self {
        let scale = nalgebra::convert::<f64, T>(0.5) * reach;
        RobustKernel { scale2: scale * scale }
    }

    /// The weight of a residual in iterated least squares: 1 at zero, a quarter at the scale.
    #[inline]
    pub fn weight(&self, residual: T) -> T {
        let share = self.scale2 / (self.scale2 + residual * residual);
        share * share
    }

    /// The derivative of `weight(r) r` by r: what one more unit of residual still pulls.
    #[inline]
    pub fn slope(&self, residual: T) -> T {
        let u = residual * residual / self.scale2;
        (T::one() - nalgebra::convert::<f64, T>(3.0) * u) / (T::one() + u).powi(3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_at_the_scale_counts_a_quarter_and_the_slope_is_that_of_the_pull() {
        let kernel = RobustKernel::with_squared_scale(4.0);
        assert_eq!([0.0, 2.0, -2.0].map(|r| kernel.weight(r)), [1.0, 0.25, 0.25]);
        assert_eq!(RobustKernel::within(4.0), kernel);
        for r in [0.0, 0.7, -1.9, 5.0] {
            let pull = |r: f64| kernel.weight(r) * r;
            let measured = (pull(r + 1e-6) - pull(r - 1e-6)) / 2e-6;
            assert!((kernel.slope(r) - measured).abs() < 1e-8, "{r}");
        }
    }
}
