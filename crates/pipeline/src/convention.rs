//! How given poses are meant, where their file leaves it open.

use super::PipelineError;
use super::report::PoseConventionReport;
use super::start::Setting;
use visage_geometry::progress::Progress;
use visage_registration::pose_convention::{Choice, choose};
use visage_registration::view::View;

/// Reads the poses as the surfaces say that they are meant, and says so for the report; `None` where their file left
/// nothing open, or the surfaces can't tell.
pub(super) fn settle(
    setting: &mut Setting,
    views: &[View],
    names: &[String],
    progress: &Progress,
) -> Result<Option<PoseConventionReport>, PipelineError> {
    let others = setting.other_conventions();
    if others.is_empty() {
        return Ok(None);
    }
    let poses: Vec<_> = names.iter().map(|name| setting.pose(name)).collect();
    let Choice { read_as, touching } = choose(views, &poses, others, progress)?;
    if touching.is_empty() {
        return Ok(None);
    }
    setting.read_as(read_as);
    let touching = touching.iter().map(|(convention, share)| (convention.name(), *share)).collect();
    Ok(Some(PoseConventionReport { read_as: read_as.name(), touching }))
}
