//! Cloud and mesh without the face.

use super::surface::MadeSurface;
use visage_geometry::Cloud;
use visage_shape::faces::{FaceExtent, Signature};
use visage_surface::merge::ModelCloud;

/// Cuts the face that a signature holds out of a model; says whether there was one.
///
/// All points within the outline of the fitted face are removed with their colours, and all triangles with a corner there.
pub(super) fn deface(signature: Option<&Signature>, model: &mut ModelCloud, mesh: Option<&mut MadeSurface>) -> bool {
    let Some(extent) = signature.and_then(FaceExtent::of) else { return false };
    cut(&extent, &mut model.cloud, Some(&mut model.views), mesh);
    true
}

/// Removes all points, and triangles with a corner, within the extent of a face.
pub fn cut(extent: &FaceExtent, cloud: &mut Cloud, views: Option<&mut Vec<u16>>, mesh: Option<&mut MadeSurface>) {
    let kept: Vec<bool> = cloud.points.iter().map(|point| !extent.holds(point)).collect();
    *cloud = cloud.kept(&kept);
    let mut stays = kept.iter();
    if let Some(views) = views {
        views.retain(|_| stays.next().copied().unwrap_or(true));
    }
    if let Some(mesh) = mesh {
        mesh.cut(|place| extent.holds(place));
    }
}
