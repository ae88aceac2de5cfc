//! The surface itself: at a glance, from any side, and by scans.

use super::{Margins, lacking, rendered, with_legend};
use crate::kind::Kind;
use crate::material::{Material, PictureError, Wish};
use visage_geometry::progress::Progress;
use visage_picture::color::category;
use visage_picture::image::{Image, Rgb};
use visage_picture::legend;
use visage_picture::raster::Paint;

/// The model at a glance.
pub(super) fn thumbnail(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    Ok(rendered(of, wish, of.surface.cloud.colors.as_deref(), Paint::Material, Margins::default(), progress)?.image)
}

/// In light and shadow.
pub(super) fn shaded(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let rendered =
        rendered(of, wish, of.surface.cloud.colors.as_deref(), Paint::Material, Margins::default(), progress)?;
    Ok(with_legend(rendered, of, |_, _| {}))
}

/// Each scan in its colour.
pub(super) fn views(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let views = views_of(of).ok_or_else(|| {
        lacking(
            Kind::Views,
            "it is not known which scan each of its points is of",
            "register the scans with the option cloud; uploaded models have no scans",
        )
    })?;
    let key = key(of, views);
    let beside = Margins::of_key(wish.size, &key);
    let rendered = rendered(of, wish, Some(&colors_of(views)), Paint::Figure, beside, progress)?;
    Ok(with_legend(rendered, of, |drawing, _| legend::key(drawing, &key)))
}

/// The scan of each point, if that is known.
pub(super) fn views_of(of: &Material) -> Option<&[u16]> {
    of.views.as_deref().filter(|views| !views.is_empty() && views.len() == of.surface.cloud.len())
}

/// A colour for each scan.
pub(super) fn colors_of(views: &[u16]) -> Vec<Rgb> {
    let most = views.iter().copied().max().map_or(0, usize::from);
    let table: Vec<Rgb> = (0..=most).map(category).collect();
    views.iter().map(|view| table[usize::from(*view)]).collect()
}

/// The names and colours of the scans that have points.
pub(super) fn key(of: &Material, views: &[u16]) -> Vec<(String, Rgb)> {
    let most = views.iter().copied().max().map_or(0, usize::from);
    let mut has_points = vec![false; most + 1];
    views.iter().for_each(|view| has_points[usize::from(*view)] = true);
    let names = of.found.as_ref().map(|found| found.names()).unwrap_or_default();
    let name = |view: usize| names.get(view).cloned().unwrap_or_else(|| format!("scan {view}"));
    let shown = (0..=most).filter(|view| has_points[*view]);
    shown.map(|view| (name(view), category(view))).collect()
}
