//! A cut: the points near a plane, each scan in its colour, and a part of it magnified; with the poses that were found, and with those
//! that refinement began with.

use super::surfaces::{colors_of, key, views_of};
use super::{Margins, lacking, reach_of_neighbours, upright, with_legend};
use crate::kind::Kind;
use crate::material::{Axis, Material, PictureError, Plane, Wish};
use visage_geometry::progress::Progress;
use visage_geometry::{Bounds, Motion, Point3, Vector3, se3};
use visage_picture::camera::{Axes, Camera};
use visage_picture::color::{CALM, INK};
use visage_picture::drawing::{Anchor, Drawing};
use visage_picture::image::{Image, Rgb};
use visage_picture::legend;
use visage_picture::raster::{Paint, Scene, render};
use visage_picture::size::Size;

/// Half the thickness of what is shown, in distances of neighbours: each scan has points in it wherever the plane cuts it.
const HALF_THICKNESS: f64 = 0.75;
/// The share of the picture's shorter side that the magnified part takes, and how much it is magnified.
const INSET: f64 = 0.36;
const MAGNIFIED: f64 = 8.0;
/// Room to the rim of the picture.
const RIM: f64 = 12.0;
/// Radii of points in pixels, as shares of the picture's shorter side.
const DOT: f64 = 1.0 / 420.0;

/// The points near a plane.
struct Slab {
    offset: f64,
    points: Vec<Point3>,
    colors: Vec<Rgb>,
    views: Vec<u16>,
}

/// The section.
pub(super) fn section(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    drawn(of, &of.surface.cloud.points, "", wish, progress)
}

/// The section before poses were refined, at the same place, in the same scale, with the same part magnified.
pub(super) fn start(of: &Material, wish: &Wish, progress: &Progress) -> Result<Image, PictureError> {
    let lacks = |lacks, remedy| lacking(Kind::Start, lacks, remedy);
    let views = views_of(of).ok_or_else(|| {
        let remedy = "register the scans with the option cloud; uploaded models have no scans";
        lacks("it is not known which scan each of its points is of", remedy)
    })?;
    let rows = of.found.iter().flat_map(|found| &found.result.views);
    let motions: Vec<Option<Motion>> =
        rows.map(|row| row.start_from_final.as_ref().and_then(|rows| se3::from_rows(rows).ok())).collect();
    if motions.iter().all(Option::is_none) {
        let remedy = "register the scans again; where scales are sought there is none";
        return Err(lacks("its report does not say where scans were before their poses were refined", remedy));
    }
    let moved = |(point, view): (&Point3, &u16)| {
        let motion = motions.get(usize::from(*view)).and_then(Option::as_ref);
        motion.map_or(*point, |motion| motion * point)
    };
    let points: Vec<Point3> = of.surface.cloud.points.iter().zip(views).map(moved).collect();
    drawn(of, &points, "before refinement, ", wish, progress)
}

/// A section through `points`, which are those of the model or where they were before; framed as that of the model.
fn drawn(
    of: &Material,
    points: &[Point3],
    when: &str,
    wish: &Wish,
    progress: &Progress,
) -> Result<Image, PictureError> {
    let bounds = of.surface.cloud.bounds().ok_or_else(|| PictureError::Surface("there are no points".to_owned()))?;
    let plane = wish.plane.unwrap_or(Plane { axis: shortest(&bounds), offset: None });
    let framing = cut(of, &of.surface.cloud.points, plane, &bounds);
    let slab = cut(of, points, plane, &bounds);
    let [width, height] = [f64::from(wish.size.width()), f64::from(wish.size.height())];
    let side = INSET * width.min(height);
    let key =
        if views_of(of).is_some() { key(of, &[framing.views.as_slice(), &slab.views].concat()) } else { Vec::new() };
    // the magnified part stands beside the whole, or above it where a picture is high
    let beside = side + 2.0 * RIM;
    let margins = if width > height {
        Margins { right: beside, ..Margins::of_key(wish.size, &key) }
    } else {
        Margins { top: beside, ..Margins::default() }
    };
    let axes = upright(axes(plane.axis), &of.surface.cloud.points);
    let camera = margins.camera(&framing.points, axes, wish.size, false);
    let rendered = dots(&slab, &camera, wish.size, 1.0, progress)?;
    let magnified = busiest(&framing, &camera, side / MAGNIFIED)
        .map(|at| {
            let inset_size = Size::clamped(side as u32, side as u32);
            Ok::<_, PictureError>((
                at,
                dots(&slab, &camera.magnified(at, MAGNIFIED, inset_size), inset_size, 1.6, progress)?,
            ))
        })
        .transpose()?;
    let offset = legend::number(to_thousandths(slab.offset, &bounds));
    let words = format!("{when}section {} = {offset} {}", plane.axis.name(), unit_words(of));
    let mut image = with_legend(rendered, of, |drawing, _| {
        legend::key(drawing, &key);
        let font = legend::font(drawing);
        let at = [width - RIM, height - RIM - font.height() / 2.0];
        drawing.text(at, words.trim_end(), Anchor::End, font, INK);
    });
    if let Some((at, inset)) = magnified {
        let left = (width - side - RIM).max(0.0);
        image.put(left as i64, RIM as i64, &inset.image);
        let mut frames = Drawing::new(wish.size);
        let part = side / MAGNIFIED;
        frames.frame([at[0] - part / 2.0, at[1] - part / 2.0], [part, part], 1.5, INK);
        frames.frame([left, RIM], [side.floor(), side.floor()], 1.5, INK);
        frames.line([at[0], at[1] - part / 2.0], [left, RIM + side], 1.0, INK);
        frames.paint(&mut image);
    }
    Ok(image)
}

/// A place of a plane as people say it: what is below a thousandth of the model's size tells them nothing.
fn to_thousandths(offset: f64, bounds: &Bounds) -> f64 {
    let step = legend::round_below((bounds.max - bounds.min).norm() / 1000.0);
    if step.is_finite() { (offset / step).round() * step } else { offset }
}

fn unit_words(of: &Material) -> &'static str {
    match of.unit {
        visage_geometry::Unit::Unknown => "",
        unit => unit.name(),
    }
}

/// Seen along the axis, with y up where that is possible.
fn axes(axis: Axis) -> Axes {
    match axis {
        Axis::X => Axes::looking(-Vector3::x(), Vector3::y()),
        Axis::Y => Axes::looking(Vector3::y(), -Vector3::z()),
        Axis::Z => Axes::looking(Vector3::z(), Vector3::y()),
    }
}

/// Along its shortest side a thing shows most of itself.
fn shortest(bounds: &Bounds) -> Axis {
    let sides = bounds.max - bounds.min;
    let axes = [Axis::X, Axis::Y, Axis::Z];
    axes.into_iter().min_by(|a, b| sides[*a as usize].total_cmp(&sides[*b as usize])).unwrap_or(Axis::X)
}

fn cut(of: &Material, points: &[Point3], plane: Plane, bounds: &Bounds) -> Slab {
    let axis = plane.axis as usize;
    let offset = plane.offset.unwrap_or_else(|| bounds.center()[axis]);
    let half = HALF_THICKNESS * reach_of_neighbours(&of.surface.cloud.points);
    let views = views_of(of);
    let near = |index: &usize| (points[*index][axis] - offset).abs() <= half;
    let chosen: Vec<usize> = (0..points.len()).filter(near).collect();
    let views: Vec<u16> = chosen.iter().map(|index| views.map_or(0, |views| views[*index])).collect();
    // all lie in the plane: none hides another by its depth
    let flat = |index: &usize| {
        let mut point = points[*index];
        point[axis] = offset;
        point
    };
    let colors = if views_of(of).is_some() { colors_of(&views) } else { vec![CALM; chosen.len()] };
    Slab { offset, points: chosen.iter().map(flat).collect(), colors, views }
}

/// The points as dots of a fixed size.
fn dots(
    slab: &Slab,
    camera: &Camera,
    size: Size,
    larger: f64,
    progress: &Progress,
) -> Result<visage_picture::raster::Rendered, PictureError> {
    let normals = vec![nalgebra::Vector3::z(); slab.points.len()];
    let pixels =
        (DOT * larger * f64::from(size.width().min(size.height())) / if larger > 1.0 { INSET } else { 1.0 }).max(0.7);
    let scene = Scene {
        points: &slab.points,
        normals: Some(&normals),
        faces: &[],
        colors: Some(&slab.colors),
        paint: Paint::Flat,
        // discs are 0.8 spacings large
        spacing: pixels / 0.8 / camera.scale().unwrap_or(1.0),
    };
    Ok(render(&scene, camera, size, progress)?)
}

/// The middle of the square, so many pixels wide, in which most scans meet; of several the one with most points.
fn busiest(slab: &Slab, camera: &Camera, side: f64) -> Option<[f64; 2]> {
    use std::collections::BTreeMap;
    use std::collections::BTreeSet;
    let mut cells: BTreeMap<[i64; 2], (BTreeSet<u16>, usize)> = BTreeMap::new();
    for (point, view) in slab.points.iter().zip(&slab.views) {
        let at = camera.place(point).at;
        let cell = at.map(|x| (x / side).floor() as i64);
        let (views, count) = cells.entry(cell).or_default();
        views.insert(*view);
        *count += 1;
    }
    let best = cells.iter().max_by_key(|(cell, (views, count))| (views.len(), *count, std::cmp::Reverse(**cell)))?;
    Some(best.0.map(|x| (x as f64 + 0.5) * side))
}
