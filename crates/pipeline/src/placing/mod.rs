//! Where a probe lies on a model: the pose that brings the one onto the other, with scale and mirror, verified on the surfaces.
//!
//! - `hypotheses`: poses by the frames that surfaces give themselves; `refinement`: the best of them laid onto the surface
//! - [`mod@pose`]: what is found; [`verification`]: how far the surfaces then agree
//! - [`scan`]: a single scan, of which also counts what its scanner saw nothing of (`sight`)
//! - [`same_object`]: how sure it is that both are the same object

mod hypotheses;
pub mod pose;
mod refinement;
pub mod same_object;
pub mod scan;
mod sight;
pub mod verification;

use hypotheses::hypotheses;
pub use pose::Pose;
use refinement::Ground;
use same_object::ProbeKind;
pub use scan::{Scan, place_scan};
pub use sight::Sighted;
use verification::Verified;
use visage_geometry::Surface;
use visage_geometry::progress::{Canceled, Progress};
use visage_shape::descriptor::SampledShape;
use visage_shape::faces::{DescribeError, sampled_shape};
use visage_surface::deviation::Reference;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A mirror image lies better than the thing itself if it leaves less than this share of the deviation,
        mirrored: f64 = 0.6,
        /// and what that leaves is more than this share of the size: nearly symmetrical things are their own mirror images.
        symmetrical: f64 = 0.002,
        /// A scale this near to the known one, as a factor, is the known one.
        known_scale: f64 = 0.015,
    }
}

/// A surface ready to be laid onto others, and they onto it.
pub struct Placeable {
    shape: SampledShape,
    ground: Ground,
    reference: Reference,
    is_mesh: bool,
}

/// Where a probe lies, and how far the surfaces agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// The pose.
    pub pose: Pose,
    /// What the surfaces say of it.
    pub verified: Verified,
    /// What a single scan's scanner says of it; `None` of a whole.
    pub sighted: Option<Sighted>,
    /// The probability that the probe is the model, or is of it: see [`same_object`].
    pub same_object: f64,
}

impl Placeable {
    /// A surface made ready; `None` if there is no area to lay onto anything. Runs inside the caller's rayon pool.
    ///
    /// # Errors
    /// As [`sampled_shape`].
    pub fn new(surface: &Surface, progress: &Progress) -> Result<Option<Placeable>, DescribeError> {
        let Some(shape) = sampled_shape(surface, progress)? else { return Ok(None) };
        progress.check()?;
        let Some(reference) = Reference::new(surface) else { return Ok(None) };
        progress.check()?;
        let is_mesh = !surface.faces.is_empty();
        Ok(Some(Placeable { ground: Ground::new(&shape), shape, reference, is_mesh }))
    }

    /// How large it is: the mean distance of its surface from its centroid.
    pub fn size(&self) -> f64 {
        self.shape.whole[0].size
    }
}

/// Where the probe lies on the model best. `known_scale`: lengths on the model in one of the probe, if both units are known. Runs inside the
/// caller's rayon pool.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn place(
    probe: &Placeable,
    model: &Placeable,
    known_scale: Option<f64>,
    progress: &Progress,
) -> Result<Option<Placed>, Canceled> {
    let mut best: [Option<Placed>; 2] = [None; 2];
    for (slot, mirrored) in best.iter_mut().zip([false, true]) {
        let proposed = hypotheses(&probe.shape, &model.shape, known_scale, mirrored);
        for (_, pose) in model.ground.laid(&probe.shape, proposed, false) {
            progress.check()?;
            let pose = with_known_scale(probe, model, pose, known_scale);
            let verified = Verified::of(probe, model, &pose, progress)?;
            let kind = if probe.is_mesh && model.is_mesh { ProbeKind::Mesh } else { ProbeKind::Cloud };
            let same_object = same_object::of_wholes(kind, &verified);
            let placed = Placed { pose, verified, sighted: None, same_object };
            let is_better = |best: &Placed| placed.verified.deviation() < best.verified.deviation();
            if slot.as_ref().is_none_or(is_better) {
                *slot = Some(placed);
            }
        }
    }
    Ok(match best {
        [Some(itself), Some(mirrored)] => {
            let (own, other) = (itself.verified.deviation(), mirrored.verified.deviation());
            let is_mirrored = own > TUNING.symmetrical && other < TUNING.mirrored * own;
            Some(if is_mirrored { mirrored } else { itself })
        }
        [itself, mirrored] => itself.or(mirrored),
    })
}

/// The pose with the known scale, if it nearly has it.
fn with_known_scale(probe: &Placeable, model: &Placeable, pose: Pose, known_scale: Option<f64>) -> Pose {
    match known_scale.filter(|known| (known / pose.scale).ln().abs() < TUNING.known_scale) {
        Some(known) => model.ground.laid_with_scale(&probe.shape, &pose, known),
        None => pose,
    }
}
