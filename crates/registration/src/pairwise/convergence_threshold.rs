//! The adaptive convergence threshold [P1], [P2].

/// The paper's modified threshold [P2]: `e_thr = ((1 - N_p/N_t) sqrt(2)/2 L_r)^2 + R_e^2`.
///
/// `overlap` is N_p/N_t of the view that ICP moves, `spacing` L_r and `range_accuracy` R_e are lengths in one unit.
/// The result is a *squared* length: compare it with the mean squared distance of the kept correspondences.
pub fn adaptive_threshold(overlap: f64, spacing: f64, range_accuracy: f64) -> f64 {
    let lateral = (1.0 - overlap) * std::f64::consts::FRAC_1_SQRT_2 * spacing;
    lateral * lateral + range_accuracy * range_accuracy
}

/// The paper's threshold for arrays [P1]: `e_thr = ((1 - N_p/N_t) sqrt(2)/2 L_r)^2 + (N_t/N_p R_e)^2`, for scans whose
/// grids give L_r. As [`adaptive_threshold`] otherwise; an overlap of 0 makes it infinite.
pub fn array_threshold(overlap: f64, spacing: f64, range_accuracy: f64) -> f64 {
    adaptive_threshold(overlap, spacing, range_accuracy / overlap)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grows_as_the_overlap_shrinks() {
        let loose = adaptive_threshold(0.5, 0.54, 0.1);
        let tight = adaptive_threshold(0.9, 0.54, 0.1);
        assert!(tight < loose);
        assert!((loose - (0.5f64 * 0.5 * 0.5 * 0.54 * 0.54 + 0.01)).abs() < 1e-12);
    }

    #[test]
    fn arrays_weigh_the_range_accuracy_by_the_overlap() {
        let (cloud, array) = (adaptive_threshold(0.5, 0.54, 0.2), array_threshold(0.5, 0.54, 0.2));
        assert!((array - cloud - 3.0 * 0.04).abs() < 1e-12);
        assert_eq!(array_threshold(1.0, 0.54, 0.2), adaptive_threshold(1.0, 0.54, 0.2));
    }

    #[test]
    fn full_overlap_leaves_the_range_accuracy() {
        assert!((adaptive_threshold(1.0, 0.54, 0.2) - 0.04).abs() < 1e-15);
    }
}
