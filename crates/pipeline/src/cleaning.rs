//! Scans before registration are left without what is not the object, and what was left out is counted for the report.

use rayon::prelude::*;

use super::{NamedScan, Options, PipelineError, sensor_of};
use visage_geometry::progress::Progress;
use visage_registration::cleaning::{LeftOut, clean};
use visage_registration::sensor::Sensor;
use visage_registration::view::View;

/// Takes what is not the object out of the scans and their views; says what, scan by scan.
pub(super) fn clean_scans(
    scans: &mut [NamedScan],
    views: &mut [View],
    options: &Options,
    progress: &Progress,
) -> Result<Vec<LeftOut>, PipelineError> {
    let sensors: Vec<Option<Sensor>> =
        scans.iter().zip(views.iter()).map(|(scan, view)| sensor_of(scan, view, options)).collect();
    let mut left_out = clean(views, &sensors, progress)?;
    scans.par_iter_mut().zip(views).zip(&mut left_out).with_max_len(1).for_each(|((scan, view), left_out)| {
        if left_out.kept.is_empty() {
            return;
        }
        if view.leave_specks_out(&left_out.kept) {
            scan.surface = scan.surface.kept(&left_out.kept);
            return;
        }
        let surface = scan.surface.kept(&left_out.kept);
        // what can't be registered any more stays as it was
        match View::of(&surface) {
            Ok(rest) => (scan.surface, *view) = (surface, rest),
            Err(_) => *left_out = LeftOut::default(),
        }
    });
    Ok(left_out)
}
