//! How far two surfaces agree under a pose, by distances to the surfaces themselves.

use super::{Placeable, Pose};
use visage_geometry::Point3;
use visage_geometry::progress::{Canceled, Progress};
use visage_surface::deviation::Reference;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Samples of either surface that are measured.
        samples: usize = 2000,
        /// Surfaces agree where they are this near to each other, in mean distances of the smaller from its centroid: some 1 % of its
        /// diagonal.
        tolerance: f64 = 0.03,
        /// What is farther off counts as this many tolerances.
        reach: f64 = 5.0,
    }
}

/// How far two surfaces agree. Lengths are in the unit of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verified {
    /// The share of the probe that lies on the model.
    pub probe_overlap: f64,
    /// The share of the model that the probe covers.
    pub model_overlap: f64,
    /// The root mean square distance of the probe's surface from the model's where it lies on it; `None` if it lies nowhere on it.
    pub residual: Option<f64>,
    /// How near surfaces are that agree.
    pub tolerance: f64,
    /// The root mean square distances of all of the probe from the model, and of the model from the probe, in tolerances; what is far off
    /// counts as far as [`Verified::deviation`] tells.
    deviations: [f64; 2],
}

impl Verified {
    /// Measures both ways.
    pub(super) fn of(
        probe: &Placeable,
        model: &Placeable,
        pose: &Pose,
        progress: &Progress,
    ) -> Result<Verified, Canceled> {
        let tolerance = TUNING.tolerance * model.size().min(probe.size() * pose.scale);
        let forth: Vec<Point3> = spread(&probe.shape.points).map(|p| pose.point(p)).collect();
        let forth = Side::of(&model.reference, &forth, tolerance, progress)?;
        let back: Vec<Point3> = spread(&model.shape.points).map(|p| pose.probe_point(p)).collect();
        let back = Side::of(&probe.reference, &back, tolerance / pose.scale, progress)?;
        Ok(Verified {
            probe_overlap: forth.overlap,
            model_overlap: back.overlap,
            residual: forth.residual.map(|residual| residual * tolerance),
            tolerance,
            deviations: [forth.deviation, back.deviation],
        })
    }

    /// How far the probe is from the model, as a share of the smaller one's size (its mean distance from its centroid): a root mean square
    /// of all of it, in which what is far off counts 0.15.
    pub fn deviation(&self) -> f64 {
        self.deviations[0] * TUNING.tolerance
    }

    /// The same both ways, the greater.
    pub fn deviation_of_both(&self) -> f64 {
        self.deviations[0].max(self.deviations[1]) * TUNING.tolerance
    }
}

/// Lengths are in tolerances.
struct Side {
    overlap: f64,
    residual: Option<f64>,
    deviation: f64,
}

impl Side {
    fn of(reference: &Reference, points: &[Point3], tolerance: f64, progress: &Progress) -> Result<Side, Canceled> {
        let distances = reference.distances(points, TUNING.reach * tolerance, progress)?;
        let squares: Vec<f64> = distances
            .iter()
            .map(|distance| if distance.is_nan() { TUNING.reach.powi(2) } else { (distance / tolerance).powi(2) })
            .collect();
        let near: Vec<f64> = squares.iter().copied().filter(|square| *square <= 1.0).collect();
        let root_mean = |squares: &[f64]| (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        Ok(Side {
            overlap: near.len() as f64 / squares.len().max(1) as f64,
            residual: (!near.is_empty()).then(|| root_mean(&near)),
            deviation: root_mean(&squares),
        })
    }
}

fn spread(points: &[Point3]) -> impl Iterator<Item = &Point3> {
    let step = (points.len() / TUNING.samples).max(1);
    points.iter().skip(step / 2).step_by(step)
}
