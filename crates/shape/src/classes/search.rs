//! Where on a surface a class's dense region fits best: triangles of all scale levels and sides, a first look at each, a
//! closer one at the best that stand at places of their own.

use rayon::prelude::*;

use super::Class;
use super::corners::{SelectiveTriangle, TriangleCandidate};
use crate::faces::candidates::{Candidate, distinct};
use crate::faces::caps_and_pits::{features, places};
use crate::faces::detection::MOST_CELLS_ACROSS;
use crate::faces::modes::Weights;
use crate::faces::sampled_surface::SampledSurface;
use crate::faces::similarity::Similarity;
use crate::faces::target::Target;
use crate::faces::template::Template;
use crate::faces::verification::{
    KEPT_SHARE, PROPORTION_WEIGHT, Placement, RIGID_PROPORTIONS, Search, fit_pose, score,
};
use crate::saliency::{CellGrid, Samples};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Point3, Unit};

/// The best place of a class on a surface.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Found {
    /// Where the standard lies in the model.
    pub pose: Similarity,
    /// What is left between the region and the surface; see
    /// [`Fit::residual_mm`](crate::faces::verification::Fit::residual_mm).
    pub residual_mm: f64,
    /// The share of the region that could be seen.
    pub observed: f64,
    /// Least-squares matching error of the triangle that led there, mm on the standard.
    pub matching_error_mm: f64,
}

/// Feature lengths where a unit is unknown, as multiples of the standard's own share of its bounding box: from a part of
/// a larger thing to a close-up.
const LEVELS_OF_SHARE: [f64; 6] = [0.42, 0.56, 0.75, 1.0, 1.33, 1.77];
/// The same where both units are known, as multiples of the true length.
const LEVELS_OF_TRUE_SIZE: [f64; 5] = [0.6, 0.8, 1.0, 1.25, 1.6];
/// Where both units are known, a model of the class has this size relative to the standard.
const TRUE_SIZES: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// Spacing of the samples of a level, in feature lengths, and the most of them: as for faces.
const SPACING: f64 = 0.1;
const MOST_SAMPLES: usize = 80_000;
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
/// How many get it.
const CANDIDATES: usize = 6;
/// A first look this many times worse than the best gets none.
const HOPELESS: f64 = 1.8;
/// The spacing of the closer look's samples, and how far beyond the region they reach, mm on the standard.
const FINE_SPACING_MM: f64 = 3.0;
const FINE_MARGIN_MM: f64 = 25.0;

/// A candidate, and what its triangle was like.
#[derive(Debug, Clone, Copy)]
struct ClassCandidate {
    candidate: Candidate,
    /// Of the triangle.
    matching_error_mm: f64,
}

impl AsRef<Candidate> for ClassCandidate {
    fn as_ref(&self) -> &Candidate {
        &self.candidate
    }
}

/// A class with its region as the fit wants it.
struct Sought<'a> {
    class: &'a Class,
    template: Template,
    /// From the middle of the region to its farthest point, mm on the standard.
    reach_mm: f64,
}

/// See [`Class::find`]. `progress` is asked between levels.
pub(super) fn find(
    surface: &SampledSurface,
    unit: Unit,
    class: &Class,
    progress: &Progress,
) -> Result<Option<Found>, Canceled> {
    let reach_mm = class.points.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
    let sought = Sought { class, template: class.template(), reach_mm };
    let diagonal = surface.bounds.diagonal();
    let true_scale = class.true_scale().zip(unit.in_mm()).map(|(standard, mm)| standard / mm);
    let levels: Vec<f64> = match true_scale {
        Some(scale) => LEVELS_OF_TRUE_SIZE.iter().map(|factor| factor * class.expected_mm * scale).collect(),
        None => LEVELS_OF_SHARE.iter().map(|factor| factor * class.share_of_diagonal * diagonal).collect(),
    };
    let area = surface.area();
    let mut found = Vec::new();
    for expected in levels {
        progress.check()?;
        let spacing = SPACING * expected;
        let is_fine = area / (spacing * spacing) > MOST_SAMPLES as f64 || diagonal / spacing > MOST_CELLS_ACROSS;
        if diagonal <= 0.0 || is_fine {
            continue;
        }
        let samples = surface.sampled(spacing);
        if samples.points.len() <= MOST_SAMPLES {
            for &sign in surface.side.signs() {
                sought.look_at_level(&samples, expected, sign, &mut found, progress)?;
            }
        }
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
        samples: &Samples,
        expected: f64,
        sign: f64,
        found: &mut Vec<ClassCandidate>,
        progress: &Progress,
    ) -> Result<(), Canceled> {
        let grid = CellGrid::new(&samples.points, 0.18 * expected);
        let features = features(samples, &grid, expected);
        let places = places(samples, &grid, &features, expected, sign);
        let target = Target { samples, grid: &grid, sign };
        let candidates: Vec<(&SelectiveTriangle, TriangleCandidate)> = self
            .class
            .triangles
            .iter()
            .flat_map(|t| t.candidates(&places, expected, self.class.expected_mm).into_iter().map(move |c| (t, c)))
            .collect();
        let looked = candidates.par_iter().map(|(triangle, candidate)| {
            progress.check()?;
            Ok(self.first_look(&target, triangle, candidate, sign))
        });
        found.extend(looked.collect::<Result<Vec<ClassCandidate>, Canceled>>()?);
        Ok(())
    }

    fn first_look(
        &self,
        target: &Target,
        from: &SelectiveTriangle,
        to: &TriangleCandidate,
        sign: f64,
    ) -> ClassCandidate {
        let (standard, outward) = (from.detected(), from.outward());
        let pose = Similarity::of_triangles(&standard, &outward, &to.triangle, &to.outward);
        let start = Placement { pose, weights: Weights::zeros() };
        let placement = fit_pose(target, &self.template, &start, &FIRST_LOOK);
        let shape = to.triangle.shape(&to.outward);
        let fit = score(target, &self.template, FIRST_LOOK.points, &placement);
        ClassCandidate {
            candidate: Candidate { fit, sign },
            matching_error_mm: shape.matching_error(&standard.shape(&outward), standard.size()),
        }
    }

    /// The best of the second looks at the best of the first that stand at places of their own; ties by order.
    fn best(
        &self,
        surface: &SampledSurface,
        found: Vec<ClassCandidate>,
        progress: &Progress,
    ) -> Result<Option<Found>, Canceled> {
        let corners: Vec<Point3> = self.class.triangles.iter().flat_map(|t| t.detected().corners).collect();
        let kept = distinct(found, &corners, CANDIDATES, HOPELESS);
        let mut best: Option<ClassCandidate> = None;
        for place in &kept {
            progress.check()?;
            let look = self.second_look(surface, place);
            if best.as_ref().is_none_or(|best| look.candidate.is_better_than(&best.candidate)) {
                best = Some(look);
            }
        }
        let found = |ClassCandidate { candidate: Candidate { fit, .. }, matching_error_mm }: ClassCandidate| Found {
            pose: fit.pose,
            residual_mm: fit.residual_mm,
            observed: fit.observed,
            matching_error_mm,
        };
        Ok(best.map(found))
    }

    fn second_look(&self, surface: &SampledSurface, place: &ClassCandidate) -> ClassCandidate {
        let Candidate { fit, sign } = &place.candidate;
        let pose = &fit.pose;
        let spacing = FINE_SPACING_MM * pose.scale;
        let reach = (self.reach_mm + FINE_MARGIN_MM) * pose.scale;
        let samples = surface.sampled_around(&pose.point(&Point3::origin()), reach, spacing);
        let grid = CellGrid::new(&samples.points, 2.0 * spacing);
        let target = Target { samples: &samples, grid: &grid, sign: *sign };
        let search = Search { points: self.template.len(), ..SECOND_LOOK };
        let placement = fit_pose(&target, &self.template, &fit.placement(), &search);
        let fit = score(&target, &self.template, search.points, &placement);
        ClassCandidate { candidate: Candidate { fit, ..place.candidate }, ..*place }
    }
}
