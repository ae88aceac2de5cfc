//! How sure it is that a probe and a model are the same object, by how the surfaces lie on each other: logistic models, one for each kind of
//! probe. What they were fitted on and how well they hold elsewhere is in docs/results/things.md.

use super::sight::Sighted;
use super::verification::Verified;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Weights of a constant and of the logarithm of the deviation both ways: of two meshes,
        mesh: [f64; 2] = [-6.52, -1.24],
        /// and where one of them is a cloud.
        cloud: [f64; 2] = [-6.65, -1.69],
        /// Of a single scan: a constant, the logarithm of the deviation, and what its scanner speaks against the model.
        scan: [f64; 3] = [-12.1, -3.57, -3.15],
        /// Deviations are not told apart below this.
        least: f64 = 1e-4,
    }
}

/// What the surfaces are that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ProbeKind {
    /// Meshes both.
    Mesh,
    /// One of them is a cloud, with noise and gaps.
    Cloud,
}

/// That two wholes are the same object.
pub(super) fn of_wholes(kind: ProbeKind, verified: &Verified) -> f64 {
    let [constant, slope] = match kind {
        ProbeKind::Mesh => TUNING.mesh,
        ProbeKind::Cloud => TUNING.cloud,
    };
    logistic(constant + slope * logarithm(verified.deviation_of_both()))
}

/// That a single scan is of a model.
pub(super) fn of_scan(verified: &Verified, sighted: &Sighted) -> f64 {
    let [constant, slope, against] = TUNING.scan;
    logistic(constant + slope * logarithm(verified.deviation()) + against * sighted.against())
}

fn logarithm(deviation: f64) -> f64 {
    deviation.max(TUNING.least).ln()
}

fn logistic(odds: f64) -> f64 {
    1.0 / (1.0 + (-odds).exp())
}
