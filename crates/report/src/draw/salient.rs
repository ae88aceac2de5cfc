//! What stands out of the surface: as a picture, and as a file for those who draw themselves.

use super::figures::{MOST, quantile};
use super::{Margins, rendered, with_legend, without_surface};
use crate::kind::Kind;
use crate::material::{Material, PictureError, Wish};
use visage_formats::ply::{VertexAttributes, write_surface};
use visage_geometry::progress::Progress;
use visage_geometry::{Mesh, Surface};
use visage_picture::color::Map;
use visage_picture::image::{Image, Rgb};
use visage_picture::legend;
use visage_picture::raster::Paint;
use visage_shape::faces::{DescribeError, point_saliency};

/// The saliency of a surface, point by point.
struct Salient {
    figures: Vec<f64>,
    /// What has the brightest colour.
    most: f64,
    colors: Vec<Rgb>,
}

impl Salient {
    fn of(surface: &Surface, progress: &Progress) -> Result<Salient, PictureError> {
        let figures = point_saliency(surface, progress).map_err(|error| match error {
            DescribeError::Canceled(canceled) => canceled.into(),
            DescribeError::Degenerate(why) => PictureError::Surface(why),
        })?;
        let most = quantile(&figures, MOST).max(f64::MIN_POSITIVE);
        let colors = Map::Sequential.colors(&figures, [0.0, most]);
        Ok(Salient { figures, most, colors })
    }
}

/// As a picture.
pub(super) fn saliency(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let Salient { most, colors, .. } = Salient::of(&of.surface, progress)?;
    let rendered = rendered(of, wish, Some(&colors), Paint::Figure, Margins::of_bar(wish.size), progress)?;
    Ok(with_legend(rendered, of, |drawing, _| {
        legend::color_bar(drawing, Map::Sequential, [0.0, most], "saliency");
    }))
}

/// The surface as PLY in the colours of its saliency, with the property `saliency`. Runs inside the caller's rayon pool.
///
/// # Errors
/// There is too little surface, or none, or the caller asked for a stop.
pub fn saliency_ply(surface: Surface, progress: &Progress) -> Result<Vec<u8>, PictureError> {
    if surface.cloud.is_empty() {
        return Err(without_surface(Kind::Saliency));
    }
    let Salient { figures, colors, .. } = Salient::of(&surface, progress)?;
    let figures: Vec<f32> = figures.iter().map(|figure| *figure as f32).collect();
    let attributes =
        VertexAttributes { colors: Some(&colors), saliency: Some(&figures), ..VertexAttributes::default() };
    Ok(write_surface(&Mesh { vertices: surface.cloud.points, faces: surface.faces }, &attributes))
}
