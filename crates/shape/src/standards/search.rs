//! Where on a surface a class's dense region fits best: triangles of all scale levels and sides, a first look at each, a
//! closer one at the best that stand at places of their own.

use rayon::prelude::*;

use super::Standard;
use super::corners::{SelectiveTriangle, TriangleCandidate};
use crate::faces::candidates::{Candidate, distinct};
use crate::faces::dense_fit::{KEPT_SHARE, PROPORTION_WEIGHT, RIGID_PROPORTIONS, Search};
use crate::faces::detection::MOST_SAMPLES;
use crate::faces::levels::{Level, look, sampled_levels};
use crate::faces::sampled_surface::SampledSurface;
use crate::faces::similarity::Similarity;
use crate::faces::target::Target;
use crate::faces::template::Template;
use crate::saliency::{CellGrid, Side};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Point3, Unit};

/// The best place of a class on a surface.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Found {
    /// Where the standard lies in the model.
    pub pose: Similarity,
    /// What is left between the region and the surface; see
    /// [`Fit::residual_mm`](crate::faces::dense_fit::Fit::residual_mm).
    pub residual_mm: f64,
    /// The share of the region that could be seen.
    pub observed: f64,
    /// Least-squares matching error of the triangle that led there, mm on the standard.
    pub matching_error_mm: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Feature lengths where a unit is unknown, as multiples of the standard's own share of its bounding box: from a part of
        /// a larger thing to a close-up.
        levels_of_share: [f64; 6] = [0.42, 0.56, 0.75, 1.0, 1.33, 1.77],
        /// The same where both units are known, as multiples of the true length.
        levels_of_true_size: [f64; 5] = [0.6, 0.8, 1.0, 1.25, 1.6],
        /// How many get it.
        candidates: usize = 6,
        /// A first look this many times worse than the best gets none.
        hopeless: f64 = 1.8,
        /// The spacing of the closer look's samples, and how far beyond the region they reach, mm on the standard.
        fine_spacing_mm: f64 = 3.0,
        /// How far beyond the region they reach, mm on the standard.
        fine_margin_mm: f64 = 25.0,
    }
}

/// Where both units are known, a model of the class has this size relative to the standard.
const TRUE_SIZES: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// The first look, on the level's samples.
const FIRST_LOOK: Search = Search {
    points: 90,
    rounds: 5,
    most_growth: 1.3,
    proportion_weight: RIGID_PROPORTIONS,
    kept_share: KEPT_SHARE,
    rigid_rounds: 5,
};
/// The closer look, of the best few.
const SECOND_LOOK: Search = Search {
    points: usize::MAX,
    rounds: 30,
    most_growth: 1.3,
    proportion_weight: PROPORTION_WEIGHT,
    kept_share: 0.9,
    rigid_rounds: 30,
};

/// A candidate, and what its triangle was like.
#[derive(Debug, Clone, Copy)]
struct StandardCandidate {
    candidate: Candidate,
    /// Of the triangle.
    matching_error_mm: f64,
}

impl AsRef<Candidate> for StandardCandidate {
    fn as_ref(&self) -> &Candidate {
        &self.candidate
    }
}

/// A class with its region as the fit wants it.
struct Sought<'a> {
    standard: &'a Standard,
    template: Template,
    /// From the middle of the region to its farthest point, mm on the standard.
    reach_mm: f64,
}

/// See [`Standard::find`]. `progress` is asked between levels.
pub(super) fn find(
    surface: &SampledSurface,
    unit: Unit,
    standard: &Standard,
    progress: &Progress,
) -> Result<Option<Found>, Canceled> {
    let reach_mm = standard.points.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
    let sought = Sought { standard, template: standard.template(), reach_mm };
    let true_scale = standard.true_scale().zip(unit.in_mm()).map(|(standard, mm)| standard / mm);
    let lengths: Vec<f64> = match true_scale {
        Some(scale) => TUNING.levels_of_true_size.iter().map(|factor| factor * standard.expected_mm * scale).collect(),
        None => {
            let share = standard.share_of_diagonal * surface.bounds.diagonal();
            TUNING.levels_of_share.iter().map(|factor| factor * share).collect()
        }
    };
    let mut found = Vec::new();
    for (expected, samples) in sampled_levels(surface, &lengths, |_| MOST_SAMPLES, progress)? {
        progress.check()?;
        sought.look_at_level(&Level::new(&samples, expected), surface.side, &mut found, progress)?;
    }
    progress.check()?;
    if let Some(scale) = true_scale {
        found.retain(|f| TRUE_SIZES.contains(&(f.candidate.fit.pose.scale / scale)));
    }
    sought.best(surface, found, progress)
}

impl Sought<'_> {
    fn look_at_level(
        &self,
        level: &Level,
        side: Side,
        found: &mut Vec<StandardCandidate>,
        progress: &Progress,
    ) -> Result<(), Canceled> {
        let features = level.features();
        for &sign in side.signs() {
            let places = level.places(&features, sign);
            let of_triangle =
                |from: &'_ SelectiveTriangle| from.candidates(&places, level.expected, self.standard.expected_mm);
            let candidates: Vec<(&SelectiveTriangle, TriangleCandidate)> =
                self.standard.triangles.iter().flat_map(|t| of_triangle(t).into_iter().map(move |c| (t, c))).collect();
            let looked = candidates.par_iter().map(|(from, to)| {
                progress.check()?;
                Ok(self.first_look(level, from, to, sign))
            });
            found.extend(looked.collect::<Result<Vec<StandardCandidate>, Canceled>>()?);
        }
        Ok(())
    }

    fn first_look(
        &self,
        level: &Level,
        from: &SelectiveTriangle,
        to: &TriangleCandidate,
        sign: f64,
    ) -> StandardCandidate {
        let (standard, outward) = (from.detected(), from.outward());
        let pose = Similarity::of_triangles(&standard, &outward, &to.triangle, &to.outward);
        let shape = to.triangle.shape(&to.outward);
        StandardCandidate {
            candidate: level.look(&self.template, pose, sign, &FIRST_LOOK),
            matching_error_mm: shape.matching_error(&standard.shape(&outward), standard.size()),
        }
    }

    /// The best of the second looks at the best of the first that stand at places of their own; ties by order.
    fn best(
        &self,
        surface: &SampledSurface,
        found: Vec<StandardCandidate>,
        progress: &Progress,
    ) -> Result<Option<Found>, Canceled> {
        let corners: Vec<Point3> = self.standard.triangles.iter().flat_map(|t| t.detected().corners).collect();
        let kept = distinct(found, &corners, TUNING.candidates, TUNING.hopeless);
        let mut best: Option<StandardCandidate> = None;
        for place in &kept {
            progress.check()?;
            let look = self.second_look(surface, place);
            if best.as_ref().is_none_or(|best| look.candidate.is_better_than(&best.candidate)) {
                best = Some(look);
            }
        }
        let found = |StandardCandidate { candidate: Candidate { fit, .. }, matching_error_mm }: StandardCandidate| {
            Found { pose: fit.pose, residual_mm: fit.residual_mm, observed: fit.observed, matching_error_mm }
        };
        Ok(best.map(found))
    }

    fn second_look(&self, surface: &SampledSurface, place: &StandardCandidate) -> StandardCandidate {
        let Candidate { fit, sign } = &place.candidate;
        let pose = &fit.pose;
        let spacing = TUNING.fine_spacing_mm * pose.scale;
        let reach = (self.reach_mm + TUNING.fine_margin_mm) * pose.scale;
        let samples = surface.sampled_around(&pose.point(&Point3::origin()), reach, spacing);
        let grid = CellGrid::new(&samples.points, 2.0 * spacing);
        let target = Target { samples: &samples, grid: &grid, sign: *sign };
        let search = Search { points: self.template.len(), ..SECOND_LOOK };
        StandardCandidate { candidate: look(&target, &self.template, &fit.placement(), &search), ..*place }
    }
}
