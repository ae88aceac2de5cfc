//! The end of a registration: all that is known of its poses is weighed, once.

use visage_geometry::Vector3;
use visage_geometry::progress::{Canceled, Progress};

use crate::covariance::{self, PoseCovariance};
use crate::global::scan_set::Registered;
use crate::joint::colours::by_colours;
use crate::outcome::Outcome;
use crate::quality::colour::{self, Brightness};
use crate::quality::free_space::intrusions;
use crate::quality::witness::Known;
use crate::quality::{Evidence, Finding, Surfaces, Verdict, judge};
use crate::resolution::resolution;
use crate::view::View;

/// What is known of a set beside its poses and surfaces; slices have one entry a view, or none if nothing is known.
#[derive(Debug, Clone, Copy, Default)]
pub struct Circumstances<'a> {
    /// Where the scanners stood: positions in the views' local frames.
    pub positions: &'a [Option<Vector3>],
    /// How bright the points are.
    pub brightness: &'a [Option<Brightness>],
    /// Views and poses that hold the set better than its own, such as those with their supports.
    pub held: Option<(&'a [View], &'a Outcome)>,
    /// If all views were taken from one place, and what moved before it could not be placed, the share of each that moved.
    pub moved: Option<&'a [f64]>,
    /// What was found out elsewhere.
    pub findings: &'a [Finding],
}

/// How well the poses are known, and how good they are.
pub struct Conclusion {
    /// For each view the covariance of its pose.
    pub covariances: Vec<Option<PoseCovariance>>,
    /// The verdict.
    pub verdict: Verdict,
}

impl Registered {
    /// Moves views along what geometry leaves free to where their colours agree, if they have any; what is not free stays.
    pub fn follow_colours(
        &mut self,
        views: &[View],
        brightness: &[Option<Brightness>],
        progress: &Progress,
    ) -> Result<(), Canceled> {
        if let Some(result) = by_colours(views, brightness, &self.result, progress)? {
            self.surfaces = Surfaces::measure(views, &result);
            self.placement.move_placed(views, &result);
            self.result = result;
        }
        Ok(())
    }

    /// Weighs all that is known. How sure each pose is is said anew, in `placement`.
    pub fn conclude(&mut self, views: &[View], names: &[String], circumstances: &Circumstances) -> Conclusion {
        let Registered { result, surfaces, placement } = self;
        let Circumstances { positions, brightness, held, moved, findings } = *circumstances;
        let intrusions = match positions {
            [] => Vec::new(),
            positions => intrusions(views, positions, &result.local_poses, &result.placed, surfaces.resolution),
        };
        let (all, at) = held.unwrap_or((views, result));
        let uncertainty = covariance::of_result(all, at);
        let unit = resolution(all, at);
        let colours = match brightness {
            [] => vec![None; views.len()],
            brightness => colour::agreement(views, brightness, result, unit),
        };
        let stands_still = moved.is_some();
        let known = Known { uncertainty: &uncertainty, intrusions: &intrusions, colours: &colours, stands_still };
        placement.hear(known.witnesses(views, result), &result.placed);
        let verdict = judge(&Evidence {
            confidences: placement.confidences(),
            intrusions: &intrusions,
            moved,
            covariances: &uncertainty.covariances,
            unit,
            colours: &colours,
            findings,
            ..Evidence::of_surfaces(names, result, surfaces)
        });
        Conclusion { covariances: uncertainty.covariances, verdict }
    }
}
