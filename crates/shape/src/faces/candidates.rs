//! First fits that may be looked at again, and which of them are worth it.

use super::dense_fit::Fit;
use visage_geometry::Point3;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Fits whose corners lie this near to each other stand at one place, mm on the standard.
        same_place_mm: f64 = 6.0,
    }
}

/// A fit that may be looked at again, with the side it was found on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) fit: Fit,
    /// 1, or -1 if the surface's normals point inward.
    pub(crate) sign: f64,
}

impl Candidate {
    /// Whether its standard fits better.
    pub(crate) fn is_better_than(&self, other: &Candidate) -> bool {
        self.fit.residual_mm < other.fit.residual_mm
    }

    /// Whether these corners of the standard lie at about the same places.
    fn stands_with(&self, other: &Candidate, corners: &[Point3]) -> bool {
        let apart = |p: &Point3| (self.fit.pose.point(p) - other.fit.pose.point(p)).norm();
        let most = TUNING.same_place_mm * self.fit.pose.scale;
        self.sign == other.sign && corners.iter().all(|corner| apart(corner) < most)
    }
}

/// The best `most` that stand at places of their own, judged by the standard's `corners`: many triangles lead to the same one.
/// None is `hopeless` times worse than the best. Ties by order.
pub(crate) fn distinct<T: AsRef<Candidate>>(
    mut fitted: Vec<T>,
    corners: &[Point3],
    most: usize,
    hopeless: f64,
) -> Vec<T> {
    let residual = |candidate: &T| candidate.as_ref().fit.residual_mm;
    fitted.sort_by(|a, b| residual(a).total_cmp(&residual(b)));
    let mut kept: Vec<T> = Vec::new();
    for candidate in fitted {
        if kept.len() == most || kept.first().is_some_and(|best| residual(&candidate) > hopeless * residual(best)) {
            break;
        }
        if !kept.iter().any(|other| other.as_ref().stands_with(candidate.as_ref(), corners)) {
            kept.push(candidate);
        }
    }
    kept
}

impl AsRef<Candidate> for Candidate {
    fn as_ref(&self) -> &Candidate {
        self
    }
}
