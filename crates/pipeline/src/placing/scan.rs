//! Single scans laid onto models.

use super::sight::Sight;
use super::verification::Verified;
use super::{Placeable, Placed, hypotheses, same_object, with_known_scale};
use visage_geometry::Surface;
use visage_geometry::progress::{Canceled, Progress};
use visage_shape::faces::DescribeError;

/// A single scan ready to be laid onto models: it also says where its scanner saw nothing.
pub struct Scan {
    placeable: Placeable,
    sight: Sight,
}

impl Scan {
    /// A scan made ready; `None` if there is no area to lay onto anything. Runs inside the caller's rayon pool.
    ///
    /// # Errors
    /// As [`Placeable::new`].
    pub fn new(surface: &Surface, progress: &Progress) -> Result<Option<Scan>, DescribeError> {
        let placeable = Placeable::new(surface, progress)?;
        Ok(placeable.map(|placeable| Scan { sight: Sight::of(&placeable.shape, surface.sensor), placeable }))
    }
}

/// Where a single scan lies on a model best: as [`place`](super::place), but that what its scanner saw decides along with the surfaces. It is never laid as its
/// mirror image, which no scanner sees. Runs inside the caller's rayon pool.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn place_scan(
    scan: &Scan,
    model: &Placeable,
    known_scale: Option<f64>,
    progress: &Progress,
) -> Result<Option<Placed>, Canceled> {
    let probe = &scan.placeable;
    let proposed = hypotheses(&probe.shape, &model.shape, known_scale, false);
    let mut best: Option<Placed> = None;
    for (_, pose) in model.ground.laid(&probe.shape, proposed, false) {
        progress.check()?;
        let pose = with_known_scale(probe, model, pose, known_scale);
        let verified = Verified::of(probe, model, &pose, progress)?;
        let sighted = scan.sight.of_model(&model.shape, &pose);
        let same_object = same_object::of_scan(&verified, &sighted);
        if best.as_ref().is_none_or(|best| same_object > best.same_object) {
            best = Some(Placed { pose, verified, sighted: Some(sighted), same_object });
        }
    }
    Ok(best)
}
