//! What the object stands on has a say once the objects have found each other.
//!
//! A floor, a table or a wall is left out while views are placed, since it may stand still while the object turns. Where
//! it turns out to lie on itself at the poses found, it is part of the scene, and holds the views where a small object
//! holds them badly. Where too little is left without it to place all views, it may be the scene.

use super::start::Setting;
use super::{NamedScan, Options, PipelineError};
use visage_geometry::Motion;
use visage_geometry::progress::Progress;
use visage_registration::global::scan_set::Registered;
use visage_registration::outcome::{MethodOptions, Outcome};
use visage_registration::quality::Surfaces;
use visage_registration::quality::sharpness::{is_sharp, sharpness};
use visage_registration::resolution::resolution;
use visage_registration::view::View;

/// Scans without their supports, and how they are registered.
pub(super) struct Set<'a> {
    pub setting: &'a Setting,
    pub scans: &'a [NamedScan],
    pub names: &'a [String],
    pub views: &'a [View],
}

/// Views that were registered with all that was scanned.
pub(super) struct Held {
    /// The views with their supports,
    pub whole: Vec<View>,
    /// and their registration.
    pub result: Outcome,
}

impl Set<'_> {
    /// Asks the `whole` views, as they were with their supports, about a registration without.
    pub fn consult(
        &self,
        whole: Vec<View>,
        registered: Registered,
        options: &Options,
        progress: &Progress,
    ) -> Result<(Registered, Option<Held>), PipelineError> {
        if registered.result.placed.iter().all(|placed| *placed) {
            self.vote(whole, registered, options, progress)
        } else {
            self.place_whole(whole, registered, options, progress)
        }
    }

    /// Refines the whole views from the poses found; taken if all then lie sharply on each other, supports and all.
    fn vote(
        &self,
        mut whole: Vec<View>,
        mut registered: Registered,
        options: &Options,
        progress: &Progress,
    ) -> Result<(Registered, Option<Held>), PipelineError> {
        for (whole, view) in whole.iter_mut().zip(self.views) {
            let moved = view.center - whole.center;
            whole.sensor = view.sensor.map(|sensor| sensor.moved(&moved));
        }
        let initial = reframed(&registered.result.local_poses, self.views, &whole);
        let refining = MethodOptions {
            min_overlap: options.min_overlap,
            range_accuracy: options.range_accuracy,
            max_rounds: options.max_rounds,
        };
        let result = options.method.register(&whole, &initial, &refining, progress)?;
        let sharpness = sharpness(&whole, &result, resolution(&whole, &result));
        if !result.placed.iter().all(|placed| *placed) || !sharpness.into_iter().all(is_sharp) {
            return Ok((registered, None));
        }
        registered.result.local_poses = reframed(&result.local_poses, &whole, self.views);
        registered.surfaces = Surfaces::measure(self.views, &registered.result);
        Ok((registered, Some(Held { whole, result })))
    }

    /// Registers the whole views anew; taken if more of them find a place, and the verdict is no worse.
    fn place_whole(
        &self,
        whole: Vec<View>,
        registered: Registered,
        options: &Options,
        progress: &Progress,
    ) -> Result<(Registered, Option<Held>), PipelineError> {
        let (whole, _, mut again) = self.setting.register(self.scans, whole, self.names, options, progress)?;
        let placed = |registered: &Registered| registered.result.placed.iter().filter(|placed| **placed).count();
        if placed(&again) <= placed(&registered) || again.quality(self.names) > registered.quality(self.names) {
            return Ok((registered, None));
        }
        let result = again.result.clone();
        again.result.local_poses = reframed(&result.local_poses, &whole, self.views);
        again.result.initial = reframed(&result.initial, &whole, self.views);
        // they belong to the frames of the whole views
        again.result.surfels = None;
        Ok((again, Some(Held { whole, result })))
    }
}

/// The poses of some views as poses of the local frames of others of the same scans.
fn reframed(local_poses: &[Motion], from: &[View], to: &[View]) -> Vec<Motion> {
    let between = |(pose, (from, to)): (&Motion, (&View, &View))| to.local_pose(&from.scan_pose(pose));
    local_poses.iter().zip(from.iter().zip(to)).map(between).collect()
}
