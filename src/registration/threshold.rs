//! The adaptive convergence threshold [P1], [P2].

/// The paper's modified threshold [P2]: `e_thr = ((1 - N_p/N_t) sqrt(2)/2 L_r)^2 + R_e^2`.
///
/// `overlap` is N_p/N_t of the view that ICP moves, `spacing` L_r and `range_accuracy` R_e are lengths in one unit.
/// The result is a *squared* length: compare it with the mean squared distance of the kept correspondences.
pub fn adaptive_threshold(overlap: f64, spacing: f64, range_accuracy: f64) -> f64 {
    let lateral = (1.0 - overlap) * std::f64::consts::FRAC_1_SQRT_2 * spacing;
    lateral * lateral + range_accuracy * range_accuracy
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
    fn full_overlap_leaves_the_range_accuracy() {
        assert!((adaptive_threshold(1.0, 0.54, 0.2) - 0.04).abs() < 1e-15);
    }
}
