//! Places on the surface that have a meaning: regions, the triangle, the face.

use super::{Margins, lacking, rendered, with_legend};
use crate::kind::Kind;
use crate::material::{Material, PictureError, Wish};
use visage_geometry::Point3;
use visage_geometry::progress::Progress;
use visage_picture::color::{ALARM, CALM, Map, PLAIN};
use visage_picture::drawing::{Drawing, Item};
use visage_picture::image::Image;
use visage_picture::legend::{self, Mark};
use visage_picture::raster::{Paint, Rendered};
use visage_shape::faces::modes::LANDMARKS;
use visage_shape::faces::{MatchMethod, Signature, judge, standard};

/// So much of the model's size may lie before a place on its surface: meshes and clouds differ a little.
const TOLERANCE: f64 = 0.015;
/// Regions that are shown: the strongest.
const MOST_REGIONS: usize = 60;

fn signature(kind: Kind, of: &Material) -> Result<&Signature, PictureError> {
    of.signature.as_ref().ok_or_else(|| {
        lacking(kind, "the model is not described yet", "wait for the gallery's evaluation, which describes it anew")
    })
}

fn tolerance(of: &Material) -> f64 {
    TOLERANCE * of.surface.cloud.bounds().map_or(0.0, |bounds| bounds.diagonal())
}

/// The salient regions, and the triangle that is most like a face's.
pub(super) fn regions(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let signature = signature(Kind::Regions, of)?;
    let verdict = judge(signature, &standard::face(), MatchMethod::Descriptors);
    let plain = vec![PLAIN; of.surface.cloud.len()];
    let rendered = rendered(of, wish, Some(&plain), Paint::Material, Margins::of_title(wish.size), progress)?;
    let tolerance = tolerance(of);
    Ok(with_legend(rendered, of, |drawing, rendered| {
        let strongest = signature.regions().map(|region| region.strength).fold(f64::MIN_POSITIVE, f64::max);
        for region in signature.regions().take(MOST_REGIONS) {
            let (at, is_hidden) = rendered.locate(&region.center, tolerance);
            let share = (region.strength / strongest).clamp(0.0, 1.0);
            let radius = (0.004 + 0.008 * share) * f64::from(drawing.size.height());
            if !is_hidden {
                let rim = [255; 3];
                drawing.items.push(Item::Disc { at, radius, color: Map::Sequential.color(0.2 + 0.8 * share), rim });
            }
        }
        if let Some(corners) = verdict.triangle {
            triangle(drawing, rendered, &corners, tolerance);
        }
        let words = match verdict.triangle {
            Some(_) => format!("triangle like a face's: score {}", legend::number(verdict.score)),
            None => "no triangle like a face's".to_owned(),
        };
        legend::title(drawing, &words);
    }))
}

/// Right eye, left eye, nose.
fn triangle(drawing: &mut Drawing, rendered: &Rendered, corners: &[Point3; 3], tolerance: f64) {
    let places = corners.map(|corner| rendered.locate(&corner, tolerance));
    let mut points: Vec<[f64; 2]> = places.iter().map(|(at, _)| *at).collect();
    points.push(places[0].0);
    let is_hidden = places.iter().all(|(_, is_hidden)| *is_hidden);
    let width = (f64::from(drawing.size.height()) / 260.0).clamp(1.5, 8.0);
    drawing.items.push(Item::Line { points, width, color: ALARM, dashed: is_hidden });
    let named = places.into_iter().zip(["right eye", "left eye", "nose"]);
    let marks: Vec<Mark> =
        named.map(|((at, is_hidden), name)| Mark { at, label: name.to_owned(), color: ALARM, is_hidden }).collect();
    legend::marks(drawing, &marks);
}

/// The places of the face.
pub(super) fn landmarks(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let signature = signature(Kind::Landmarks, of)?;
    let landmarks = signature.landmarks().ok_or_else(|| {
        lacking(
            Kind::Landmarks,
            "no place of the model is like a face",
            "ask for the picture regions, which shows what was found",
        )
    })?;
    let rendered = rendered(
        of,
        wish,
        of.surface.cloud.colors.as_deref(),
        Paint::Material,
        Margins::of_title(wish.size),
        progress,
    )?;
    let score = judge(signature, &standard::face(), MatchMethod::Verified).score;
    let tolerance = tolerance(of);
    Ok(with_legend(rendered, of, |drawing, rendered| {
        let mark = |(place, name): (&Point3, &str)| {
            let (at, is_hidden) = rendered.locate(place, tolerance);
            Mark { at, label: name.replace('_', " "), color: CALM, is_hidden }
        };
        legend::marks(drawing, &landmarks.iter().zip(LANDMARKS).map(mark).collect::<Vec<_>>());
        legend::title(drawing, &format!("face: score {}", legend::number(score)));
    }))
}
