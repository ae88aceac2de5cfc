//! The surface of the merged cloud.

use std::borrow::Cow;

use super::PipelineError;
use visage_geometry::Cloud;
use visage_geometry::progress::Progress;
use visage_registration::view::{View, median_spacing};
use visage_surface::merge::ModelCloud;
use visage_surface::reconstruct::{Fill, Reconstruction, SurfaceOptions, reconstruct};

/// The surface of the placed views; `None` if they make none.
///
/// Views of which it is not known on which side the outside is (`outward`) are left out: they would turn the surface inside
/// out where they lie.
pub(super) fn surface(
    model: &ModelCloud,
    outward: &[bool],
    views: &[View],
    placed: &[bool],
    fill: Fill,
    progress: &Progress,
) -> Result<Option<Reconstruction>, PipelineError> {
    let (cloud, views_of_points) = of_known_side(model, outward);
    let spacing = median_spacing(views.iter().zip(placed).filter(|(_, placed)| **placed).map(|(view, _)| view));
    let options = SurfaceOptions { fill, views: Some(&views_of_points), ..SurfaceOptions::default() };
    Ok(reconstruct(&cloud, spacing, &options, progress)?)
}

/// The points whose normals are known to be outward, and their views.
fn of_known_side<'a>(model: &'a ModelCloud, outward: &[bool]) -> (Cow<'a, Cloud>, Cow<'a, [u16]>) {
    let is_known: Vec<bool> = model.views.iter().map(|view| outward[usize::from(*view)]).collect();
    if is_known.iter().all(|known| *known) {
        return (Cow::Borrowed(&model.cloud), Cow::Borrowed(&model.views));
    }
    let views = model.views.iter().zip(&is_known).filter(|(_, known)| **known).map(|(view, _)| *view).collect();
    (Cow::Owned(model.cloud.kept(&is_known)), Cow::Owned(views))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Point3;

    #[test]
    fn points_of_views_of_unknown_side_are_left_out() {
        let points = (0..4).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
        let model = ModelCloud { cloud: Cloud::from_points(points), views: vec![0, 1, 1, 2] };
        assert!(matches!(of_known_side(&model, &[true; 3]), (Cow::Borrowed(_), Cow::Borrowed(_))));
        let (known, views) = of_known_side(&model, &[true, false, true]);
        assert_eq!(*views, [0, 2]);
        assert_eq!(known.points, [model.cloud.points[0], model.cloud.points[3]]);
    }
}
