//! What the object stands on has a say once the objects have found each other.
//!
//! A floor, a table or a wall is left out while views are placed, since it may stand still while the object turns. Where
//! it turns out to lie on itself at the poses found, it is part of the scene, and holds the views where a small object
//! holds them badly.

use super::{Options, PipelineError};
use crate::geometry::Motion;
use crate::progress::Progress;
use crate::registration::multiview::{Multiview, MultiviewOptions};
use crate::registration::quality::{self, is_sharp};
use crate::registration::resolution::resolution;
use crate::registration::view::View;

/// Views that were refined with all that was scanned.
pub(super) struct Held {
    /// The views with their supports,
    pub whole: Vec<View>,
    /// their registration,
    pub result: Multiview,
    /// and its poses for the local frames of the views without.
    pub local_poses: Vec<Motion>,
}

/// Refines the `whole` views from the poses that were found without supports; `None` unless all views then lie sharply on
/// each other, supports and all.
pub(super) fn vote(
    mut whole: Vec<View>,
    views: &[View],
    found: &Multiview,
    options: &Options,
    progress: &Progress,
) -> Result<Option<Held>, PipelineError> {
    if !found.placed.iter().all(|placed| *placed) {
        return Ok(None);
    }
    for (whole, view) in whole.iter_mut().zip(views) {
        let moved = view.center - whole.center;
        whole.sensor = view.sensor.map(|sensor| sensor.moved(&moved));
    }
    let between = |from: &View, to: &View, pose: &Motion| to.local_pose(&from.scan_pose(pose));
    let at = |(pose, (view, whole)): (&Motion, (&View, &View))| between(view, whole, pose);
    let initial: Vec<Motion> = found.local_poses.iter().zip(views.iter().zip(&whole)).map(at).collect();
    let refining = MultiviewOptions {
        min_overlap: options.min_overlap,
        range_accuracy: options.range_accuracy,
        max_rounds: options.max_rounds,
    };
    let result = options.method.register(&whole, &initial, &refining, progress)?;
    let sharpness = quality::sharpness(&whole, &result, resolution(&whole, &result));
    if !result.placed.iter().all(|placed| *placed) || !sharpness.into_iter().all(is_sharp) {
        return Ok(None);
    }
    let back = |(pose, (view, whole)): (&Motion, (&View, &View))| between(whole, view, pose);
    let local_poses = result.local_poses.iter().zip(views.iter().zip(&whole)).map(back).collect();
    Ok(Some(Held { whole, result, local_poses }))
}
