//! Figures on the surface: how much was measured, how far it is from another.

use super::{Margins, in_unit, lacking, rendered, with_legend};
use crate::kind::Kind;
use crate::material::{Material, PictureError, Wish};
use visage_geometry::progress::Progress;
use visage_picture::color::{ALARM, Map, UNKNOWN};
use visage_picture::image::{Image, Rgb};
use visage_picture::legend;
use visage_picture::raster::Paint;
use visage_surface::deviation::Reference;

/// What most figures don't exceed: the few beyond it have the colour of the end.
pub(super) const MOST: f64 = 0.98;

/// How much was measured at each place.
pub(super) fn support(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let support =
        of.support.as_deref().filter(|support| !support.is_empty() && support.len() == of.surface.cloud.len());
    let support = support.ok_or_else(|| {
        lacking(
            Kind::Support,
            "its mesh does not say how much was measured where",
            "register the scans with the option mesh, or make a surface of its cloud (a job of the kind surface)",
        )
    })?;
    let figures: Vec<f64> = support.iter().map(|support| f64::from(*support)).collect();
    let most = quantile(&figures, MOST).max(f64::MIN_POSITIVE);
    let mut colors = Map::Sequential.colors(&figures, [0.0, most]);
    for (color, figure) in colors.iter_mut().zip(&figures) {
        if figure.is_nan() || *figure <= 0.0 {
            *color = ALARM;
        }
    }
    let rendered = rendered(of, wish, Some(&colors), Paint::Figure, Margins::of_bar(wish.size), progress)?;
    Ok(with_legend(rendered, of, |drawing, _| {
        legend::color_bar(drawing, Map::Sequential, [0.0, most], "points that stand for a place");
        legend::key(drawing, &[("nobody saw it".to_owned(), ALARM)]);
    }))
}

/// How far it is from another.
pub(super) fn deviation(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let reference = of.other.as_ref().and_then(Reference::new).ok_or_else(|| {
        lacking(
            Kind::Deviation,
            "there is nothing to compare it with",
            "name another model of the same frame: other=ID",
        )
    })?;
    let distances = reference.distances(&of.surface.cloud.points, f64::INFINITY, progress)?;
    let sizes: Vec<f64> = distances.iter().map(|distance| distance.abs()).collect();
    let most = quantile(&sizes, MOST);
    let (map, least) = if reference.has_sides() { (Map::Diverging, -most) } else { (Map::Sequential, 0.0) };
    let shown = if reference.has_sides() { &distances } else { &sizes };
    let colors: Vec<Rgb> = map.colors(shown, [least, most]);
    let rendered = rendered(of, wish, Some(&colors), Paint::Figure, Margins::of_bar(wish.size), progress)?;
    let has_gaps = distances.iter().any(|distance| distance.is_nan());
    Ok(with_legend(rendered, of, |drawing, _| {
        legend::color_bar(drawing, map, [least, most], &in_unit("deviation", of));
        if has_gaps {
            legend::key(drawing, &[("no counterpart".to_owned(), UNKNOWN)]);
        }
    }))
}

/// What so many of the figures don't exceed; 0 if there are none.
pub(super) fn quantile(figures: &[f64], share: f64) -> f64 {
    let mut sound: Vec<f64> = figures.iter().copied().filter(|figure| figure.is_finite()).collect();
    if sound.is_empty() {
        return 0.0;
    }
    let place = ((sound.len() - 1) as f64 * share).round() as usize;
    *sound.select_nth_unstable_by(place, f64::total_cmp).1
}
