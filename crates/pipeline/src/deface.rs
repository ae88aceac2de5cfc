//! Cloud and mesh without the face.

use super::surface::MadeSurface;
use visage_shape::faces::{FaceExtent, Signature};
use visage_surface::merge::ModelCloud;

/// Cuts the face that a signature holds out of a model; says whether there was one.
///
/// What lies within the outline of the fitted face goes, with its colours: points, and triangles that have one of them.
pub(super) fn deface(signature: Option<&Signature>, model: &mut ModelCloud, mesh: Option<&mut MadeSurface>) -> bool {
    let Some(extent) = signature.and_then(FaceExtent::of) else { return false };
    let kept: Vec<bool> = model.cloud.points.iter().map(|point| !extent.holds(point)).collect();
    model.cloud = model.cloud.kept(&kept);
    let mut stays = kept.iter();
    model.views.retain(|_| stays.next().copied().unwrap_or(true));
    if let Some(mesh) = mesh {
        mesh.cut(|place| extent.holds(place));
    }
    true
}
