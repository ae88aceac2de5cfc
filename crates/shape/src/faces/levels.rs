//! A surface at the scales at which a standard may be on it: what its curvature shows there, and a look at how a template fits.
//! The face and the standards of users are searched for by these.

use super::candidates::Candidate;
use super::caps_and_pits::{Features, Places, features_where, places};
use super::dense_fit::{Placement, Search, fit_pose, score};
use super::modes::Weights;
use super::sampled_surface::SampledSurface;
use super::similarity::Similarity;
use super::target::Target;
use super::template::Template;
use crate::saliency::{CellGrid, Samples};
use visage_geometry::Point3;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Samples of a level: their spacing as a share of the expected feature length.
        spacing: f64 = 0.1,
        /// The edge of its grid's cells, in feature lengths.
        cell: f64 = 0.18,
        /// A level is skipped whose cells a surface has more of from end to end than can be told apart.
        most_cells_across: f64 = 1e6,
    }
}

/// The surface sampled for each of the feature lengths, which rise and are in its unit. Left out are those that would need more
/// samples than `most` allows at that length.
pub(crate) fn sampled_levels(
    surface: &SampledSurface,
    lengths: &[f64],
    most: impl Fn(f64) -> usize,
    progress: &Progress,
) -> Result<Vec<(f64, Samples)>, Canceled> {
    let (diagonal, area) = (surface.bounds.diagonal(), surface.area());
    let mut levels: Vec<(f64, Samples)> = Vec::new();
    for &expected in lengths {
        progress.check()?;
        let spacing = spacing_of(expected);
        // a plane passes through at least area / spacing^2 cells: don't even start where that is too many
        let is_fine =
            area / (spacing * spacing) > most(expected) as f64 || diagonal / spacing > TUNING.most_cells_across;
        if diagonal <= 0.0 || is_fine {
            continue;
        }
        let samples = levels.first().map_or_else(|| surface.sampled(spacing), |(_, finest)| finest.coarser(spacing));
        if samples.points.len() <= most(expected) {
            levels.push((expected, samples));
        }
    }
    Ok(levels)
}

/// The spacing of the samples for a feature length.
pub(crate) fn spacing_of(expected: f64) -> f64 {
    TUNING.spacing * expected
}

/// The surface at one level.
pub(crate) struct Level<'a> {
    samples: &'a Samples,
    grid: CellGrid,
    /// The expected feature length, in the surface's unit: the distance of the inner eye corners, for a face.
    pub(crate) expected: f64,
}

impl<'a> Level<'a> {
    pub(crate) fn new(samples: &'a Samples, expected: f64) -> Level<'a> {
        Level { samples, grid: CellGrid::new(&samples.points, TUNING.cell * expected), expected }
    }

    /// Its curvatures.
    pub(crate) fn features(&self) -> Features {
        self.features_where(|_| true)
    }

    /// Its curvatures at some places.
    pub(crate) fn features_where(&self, is_wanted: impl Fn(&Point3) -> bool) -> Features {
        features_where(self.samples, &self.grid, self.expected, is_wanted)
    }

    /// Its caps and pits; `sign` turns normals outward.
    pub(crate) fn places(&self, features: &Features, sign: f64) -> Places {
        places(self.samples, &self.grid, features, self.expected, sign)
    }

    /// How a template fits that is laid here as a triangle says.
    pub(crate) fn look(&self, template: &Template, pose: Similarity, sign: f64, search: &Search) -> Candidate {
        let target = Target { samples: self.samples, grid: &self.grid, sign };
        look(&target, template, &Placement { pose, weights: Weights::zeros() }, search)
    }
}

/// How a template fits that begins at a placement.
pub(crate) fn look(target: &Target, template: &Template, start: &Placement, search: &Search) -> Candidate {
    let placement = fit_pose(target, template, start, search);
    Candidate { fit: score(target, template, search.points, &placement), sign: target.sign }
}
