//! Scans that were given twice: registered once, and put back beside their originals at the end.

use super::start::Setting;
use super::{NamedScan, PipelineError, RegisteredModel};
use visage_geometry::progress::Progress;
use visage_geometry::{Motion, se3};
use visage_registration::cleaning::copies;
use visage_registration::view::View;

/// A scan that has the points of another one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CopiedScan {
    /// Its name.
    name: String,
    /// The other scan's.
    of: String,
    /// Maps its frame into the other's.
    motion_of_copy: Motion,
}

/// Takes copies out of a set: they bear out nothing. The pose of a copy serves its original if that has none.
pub(super) fn take_out<T>(
    scans: &mut Vec<NamedScan>,
    views: &mut Vec<View>,
    others: &mut Vec<T>,
    setting: &mut Setting,
    progress: &Progress,
) -> Result<Vec<CopiedScan>, PipelineError> {
    let found = copies::copies(views, |view| setting.is_fixed(&scans[view].name) == Some(true), progress)?;
    let copied: Vec<CopiedScan> = found
        .iter()
        .enumerate()
        .filter_map(|(view, copy)| {
            let copies::Copy { of, motion_of_copy } = (*copy)?;
            Some(CopiedScan { name: scans[view].name.clone(), of: scans[of].name.clone(), motion_of_copy })
        })
        .collect();
    if copied.is_empty() {
        return Ok(copied);
    }
    if scans.len() - copied.len() < super::MIN_SCANS {
        return Err(nothing_but_copies(&copied));
    }
    for copy in &copied {
        setting.adopt_pose(&copy.of, &copy.name, &copy.motion_of_copy);
    }
    let is_kept: Vec<bool> = found.iter().map(Option::is_none).collect();
    keep(scans, &is_kept);
    keep(views, &is_kept);
    keep(others, &is_kept);
    Ok(copied)
}

fn keep<T>(values: &mut Vec<T>, is_kept: &[bool]) {
    let mut is_kept = is_kept.iter();
    values.retain(|_| is_kept.next().copied().unwrap_or(true));
}

fn nothing_but_copies(copied: &[CopiedScan]) -> PipelineError {
    let named: Vec<String> = copied.iter().map(|copy| format!("{} of {}", copy.name, copy.of)).collect();
    PipelineError::Unusable {
        code: "too_few_scans",
        scan: copied.first().map(|copy| copy.name.clone()),
        message: format!("copies are no scans of their own, and there is one scan without them: {}", named.join(", ")),
        hint: "add the other scans of the object".into(),
    }
}

/// Adds the copies to what came out: poses beside their originals', rows that say what they are.
pub(super) fn put_back(copied: &[CopiedScan], setting: &Setting, outcome: &mut RegisteredModel) {
    for copy in copied {
        let Some(original) = outcome.poses.iter().position(|(name, _)| *name == copy.of) else { continue };
        let matrix = outcome.matrices[original].1.as_ref();
        let scale = matrix.and_then(|matrix| se3::from_scaled_rows(matrix).ok()).map_or(1.0, |(_, scale)| scale);
        // the motion is between the scans as they are, the pose that of the scaled ones
        let mut motion = copy.motion_of_copy;
        motion.translation.vector *= scale;
        let pose = outcome.poses[original].1.map(|pose| pose * motion);
        outcome.poses.push((copy.name.clone(), pose));
        outcome.matrices.push((copy.name.clone(), pose.map(|pose| setting.matrix(&copy.name, &pose, scale))));
        let rows = &mut outcome.report.registration.views;
        let mut row = rows[original].clone();
        row.view.name.clone_from(&copy.name);
        row.copy_of = Some(copy.of.clone());
        rows.push(row);
    }
}
