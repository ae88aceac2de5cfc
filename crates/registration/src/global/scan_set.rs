//! A set of views from whatever poses it has to a verdict: refined from given poses as long as that ends well, placed by
//! surface where it does not.

use super::placement::{Refine, place};
use super::report::PlacementReport;
use crate::hinted::Hinted;
use crate::outcome::Outcome;
use crate::quality::{Evidence, Quality, Surfaces, judge};
use crate::sensor::Sensor;
use crate::sensor::turning::Turning;
use crate::view::View;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress, Stage};

/// Views and what is known of them; all slices have one entry a view.
#[derive(Debug, Clone, Copy)]
pub struct Set<'a> {
    /// The scans' names.
    pub names: &'a [String],
    /// The prepared scans.
    pub views: &'a [View],
    /// Poses that were given: local frame to world.
    pub given: &'a [Option<Motion>],
    /// Where the scanner stood, where that is known.
    pub sensors: &'a [Option<Sensor>],
    /// What a person said of pairs.
    pub hinted: &'a Hinted,
    /// How the views stood before a scanner that stood still, if they are of what moved.
    pub turning: Option<&'a Turning>,
}

/// A registered set.
#[derive(Debug, Clone)]
pub struct Registered {
    /// Poses, pairs, overlaps.
    pub result: Outcome,
    /// What the surfaces say of them.
    pub surfaces: Surfaces,
    /// How the views came to their poses.
    pub placement: PlacementReport,
}

impl Registered {
    /// How good it is, its poses and how sure they are.
    pub fn quality(&self, names: &[String]) -> Quality {
        let by_surfaces = Evidence::of_surfaces(names, &self.result, &self.surfaces);
        judge(&Evidence { confidences: self.placement.confidences(), ..by_surfaces }).quality
    }
}

impl Set<'_> {
    /// Registers the set. When all poses are given, refining them ends well and picked points lie on each other then,
    /// nothing else is tried.
    pub fn register(&self, refine: &Refine, progress: &Progress) -> Result<Registered, Canceled> {
        let all: Option<Vec<Motion>> = self.given.iter().copied().collect();
        let Some(initial) = all else { return self.placed(refine, progress) };
        let result = refine(self.views, &initial)?;
        let surfaces = self.measured(&result, progress);
        let is_met = |result: &Outcome| self.hinted.is_met(&result.local_poses, &result.placed);
        let from_given = Registered { placement: PlacementReport::of_given(&result), result, surfaces };
        if from_given.quality(self.names) == Quality::Good && is_met(&from_given.result) {
            return Ok(from_given);
        }
        let repaired = self.placed(refine, progress)?;
        // of two that are as good the one is taken that follows the picked points
        let rank = |registered: &Registered| (registered.quality(self.names), !is_met(&registered.result));
        Ok(if rank(&repaired) < rank(&from_given) { repaired } else { from_given })
    }

    /// Places the views by their surface.
    fn placed(&self, refine: &Refine, progress: &Progress) -> Result<Registered, Canceled> {
        let placement = place(self, refine, progress)?;
        let surfaces = self.measured(&placement.result, progress);
        Ok(Registered { placement: PlacementReport::of(&placement), result: placement.result, surfaces })
    }

    fn measured(&self, result: &Outcome, progress: &Progress) -> Surfaces {
        progress.report(Stage::Judging, 0.0);
        Surfaces::measure(self.views, result)
    }
}
