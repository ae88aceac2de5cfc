//! From a surface to its facial triangles, over all scale levels and, where it is open, both sides; then the dense
//! check of the best of them.

use rayon::prelude::*;

use super::candidates::Candidate;
use super::dense_fit::{Fit, KEPT_SHARE, RIGID_PROPORTIONS, Search};
use super::dense_signature::DenseSignature;
use super::landmarks::Landmarks;
use super::levels::{Level, sampled_levels};
use super::refinement::{GOOD_ENOUGH_MM, Refinement};
use super::sampled_surface::SampledSurface;
use super::similarity::Similarity;
use super::standard::{FaceStandard, INNER_EYE_DISTANCE_MM};
use super::template;
use super::triangle_candidates::{TriangleCandidate, candidates};
use crate::saliency::{Samples, Side};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Motion, Unit};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Expected inner-eye distances as shares of the bounding box's diagonal, for files of unknown unit: from a
        /// torso up to a mask from brow to mouth (the faces of the public set: 0.048 to 0.16).
        levels_of_diagonal: [f64; 6] = [0.045, 0.06, 0.08, 0.106, 0.141, 0.188],
        /// The same where the unit is known, as shares of the standard's inner-eye distance: people differ, and a nose or an
        /// eye corner that is missed at one scale is met at the next.
        levels_of_true_size: [f64; 3] = [0.85, 1.0, 1.18],
        /// A surface resolves a face if it has so many points from eye to eye: some five hundred on the whole face.
        points_from_eye_to_eye: f64 = 5.0,
        /// Of levels smaller than this share of a face no triangle is as large as its own.
        least_level_of_face: f64 = 0.65,
        /// Triangles dearer than this are not worth a closer look. The cheapest of every face of the public set costs less than 3;
        /// with 4 here, eight of their copies with holes, bits around them or shoulders were lost.
        most_cost: f64 = 7.0,
    }
}

/// Where the unit is known, a face must have this size relative to the standard (74 faces: 0.85 to 1.16).
const TRUE_SIZES: std::ops::RangeInclusive<f64> = 0.75..=1.3;
/// A level that would need more samples than this is skipped, unless the surface resolves such a face: it would be a detail
/// of the object. A closer look at a solid full of walls makes do with coarser ones.
pub(crate) const MOST_SAMPLES: usize = 80_000;
/// Samples of a level that is resolved, at most: a standing person's with arms and legs apart.
const MOST_RESOLVED_SAMPLES: usize = 5 * MOST_SAMPLES;

/// The first look, on the level's samples.
const FIRST_LOOK: Search = Search {
    points: 60,
    rounds: 4,
    most_growth: 1.3,
    proportion_weight: RIGID_PROPORTIONS,
    kept_share: KEPT_SHARE,
    rigid_rounds: 4,
};

/// What the cheap part found, and what became of the best of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// The facial triangles of the levels that were searched, cheapest first; see [`detect`].
    pub candidates: Vec<TriangleCandidate>,
    /// The best fit of the standard's surface, if any triangle was worth a closer look.
    pub face: Option<FoundFace>,
}

/// The place where the standard's surface fits best, and what can be read off the surface there.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundFace {
    /// How the standard's surface fits.
    pub fit: Fit,
    /// The landmarks, refined on the surface.
    pub landmarks: Landmarks,
    /// What tells this face from others.
    pub dense: DenseSignature,
}

impl Detection {
    /// Whether what was found can only be a face.
    pub fn has_face(&self) -> bool {
        self.face.as_ref().is_some_and(|face| face.fit.residual_mm < GOOD_ENOUGH_MM)
    }

    /// The same on the moved surface.
    pub fn moved(&self, motion: &Motion) -> Detection {
        Detection {
            candidates: self.candidates.iter().map(|candidate| candidate.moved(motion)).collect(),
            face: self.face.as_ref().map(|face| face.moved(motion)),
        }
    }
}

impl FoundFace {
    /// The same on the moved surface.
    pub fn moved(&self, motion: &Motion) -> FoundFace {
        FoundFace {
            fit: Fit { pose: self.fit.pose.moved(motion), ..self.fit },
            landmarks: self.landmarks.map(|place| motion * place),
            dense: self.dense.clone(),
        }
    }
}

/// Finds the facial triangles and verifies the best, from the coarsest level to the finest. Once a face is found, finer
/// levels are searched for its own triangles only. `progress` is asked between levels.
pub fn detect(
    surface: &SampledSurface,
    unit: Unit,
    standard: &FaceStandard,
    progress: &Progress,
) -> Result<Detection, Canceled> {
    let (mut candidates, mut fitted) = (Vec::new(), Vec::new());
    let mut looks = Refinement::new(surface, unit, standard);
    for (expected, samples) in levels_of(surface, unit, progress)?.iter().rev() {
        progress.check()?;
        let face = looks.face();
        if face.is_some_and(|face| *expected < TUNING.least_level_of_face * INNER_EYE_DISTANCE_MM * face.fit.pose.scale)
        {
            break;
        }
        let level = Level::new(samples, *expected);
        if let Some(face) = face {
            candidates.extend(triangles_of(&level, face, standard));
            continue;
        }
        let found = triangles(&level, surface.side, standard);
        progress.check()?;
        let mut first = first_looks(&level, &found, standard, progress)?;
        first.retain(|f| is_true_size(f.fit.pose.scale, unit));
        looks.take_if_likely(&first, progress)?;
        fitted.extend(first);
        candidates.extend(found.into_iter().map(|(candidate, _)| candidate));
    }
    progress.check()?;
    looks.take_at_best_of(fitted, progress)?;
    candidates.retain(|c| is_true_size(c.triangle().size() / standard.detected.size(), unit));
    candidates.sort_by(|a, b| a.cost(standard).total().total_cmp(&b.cost(standard).total()));
    Ok(Detection { candidates, face: looks.closest(progress)? })
}

/// Expected inner-eye distances in the file's unit, finest first, and the surface sampled for each.
fn levels_of(surface: &SampledSurface, unit: Unit, progress: &Progress) -> Result<Vec<(f64, Samples)>, Canceled> {
    let diagonal = surface.bounds.diagonal();
    let expected: Vec<f64> = match unit.in_mm() {
        Some(mm) => TUNING.levels_of_true_size.iter().map(|share| share * INNER_EYE_DISTANCE_MM / mm).collect(),
        None => TUNING.levels_of_diagonal.iter().map(|share| share * diagonal).collect(),
    };
    let resolved = TUNING.points_from_eye_to_eye * (surface.area() / surface.points().count().max(1) as f64).sqrt();
    let most = |expected| if expected >= resolved { MOST_RESOLVED_SAMPLES } else { MOST_SAMPLES };
    sampled_levels(surface, &expected, most, progress)
}

/// Whether a face may be so many model units a millimetre of the standard; any will do where the unit is unknown.
pub(super) fn is_true_size(scale: f64, unit: Unit) -> bool {
    unit.in_mm().is_none_or(|mm| TRUE_SIZES.contains(&(scale * mm)))
}

/// A level's triangles, cheapest first on either side, with the factor that turns normals outward.
fn triangles(level: &Level, side: Side, standard: &FaceStandard) -> Vec<(TriangleCandidate, f64)> {
    let features = level.features();
    let of_side = |&sign: &f64| {
        let found = candidates(&level.places(&features, sign), level.expected, standard);
        found.into_iter().map(move |candidate| (candidate, sign))
    };
    side.signs().iter().flat_map(of_side).collect()
}

/// A level's triangles that stand on a face.
fn triangles_of(level: &Level, face: &Candidate, standard: &FaceStandard) -> Vec<TriangleCandidate> {
    let features = level.features_where(|point| face.reaches(point));
    candidates(&level.places(&features, face.sign), level.expected, standard)
}

/// The first look at every triangle that is cheap enough.
fn first_looks(
    level: &Level,
    found: &[(TriangleCandidate, f64)],
    standard: &FaceStandard,
    progress: &Progress,
) -> Result<Vec<Candidate>, Canceled> {
    let promising: Vec<_> = found.iter().filter(|(c, _)| c.cost(standard).total() < TUNING.most_cost).collect();
    let look = |(candidate, sign): &&(TriangleCandidate, f64)| {
        progress.check()?;
        let (ours, theirs) = (&standard.detected, candidate.triangle());
        let pose = Similarity::of_triangles(ours, &standard.outward, &theirs, &candidate.outward());
        Ok(level.look(template::face(), pose, *sign, &FIRST_LOOK))
    };
    promising.par_iter().map(look).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_sizes_are_tried_only_where_the_unit_allows_them() {
        assert!(is_true_size(1.25, Unit::Mm) && is_true_size(0.125, Unit::Cm));
        assert!(!is_true_size(1.25 * 1.25, Unit::Mm) && !is_true_size(0.8 * 0.8, Unit::Mm));
        assert!(is_true_size(40.0, Unit::Unknown));
    }
}
