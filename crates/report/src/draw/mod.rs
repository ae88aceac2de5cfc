//! How each kind of picture is drawn.
//!
//! - `surfaces`: thumbnail, shaded, views; `figures`: support, deviation; `salient`: saliency; `section`; `places`: regions and
//!   landmarks
//! - `plots`: overlap, graph, convergence

mod figures;
mod places;
mod plots;
mod salient;
mod section;
mod surfaces;

pub use salient::saliency_ply;

use super::kind::Kind;
use super::material::{Made, Material, PictureError, Wish};
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::progress::Progress;
use visage_geometry::{Bounds, Point3, Surface};
use visage_picture::camera::{Axes, Camera, Side};
use visage_picture::drawing::Drawing;
use visage_picture::image::{Image, Rgb};
use visage_picture::legend;
use visage_picture::raster::{Paint, Rendered, Scene, render};
use visage_picture::size::Size;
use visage_shape::faces::judgement::MATCH_SCORE;
use visage_shape::faces::{MatchMethod, judge, standard};

/// Draws a picture of a model. Runs inside the caller's rayon pool.
///
/// # Errors
/// [`PictureError::Lacking`] for what the model has not, [`PictureError::Canceled`] while it is at work.
pub fn draw(kind: Kind, of: &Material, wish: &Wish, progress: &Progress) -> Result<Made, PictureError> {
    // what these lack says more
    let tells_itself = matches!(kind, Kind::Views | Kind::Start | Kind::Support);
    if !kind.sources().is_empty() && !tells_itself && of.surface.cloud.is_empty() {
        return Err(without_surface(kind));
    }
    match kind {
        Kind::Thumbnail => surfaces::thumbnail(of, wish, progress).map(Made::Image),
        Kind::Shaded => surfaces::shaded(of, wish, progress).map(Made::Image),
        Kind::Views => surfaces::views(of, wish, progress).map(Made::Image),
        Kind::Section => section::section(of, wish, progress).map(Made::Image),
        Kind::Start => section::start(of, wish, progress).map(Made::Image),
        Kind::Support => figures::support(of, wish, progress).map(Made::Image),
        Kind::Saliency => salient::saliency(of, wish, progress).map(Made::Image),
        Kind::Deviation => figures::deviation(of, wish, progress).map(Made::Image),
        Kind::Regions => places::regions(of, wish, progress).map(Made::Image),
        Kind::Landmarks => places::landmarks(of, wish, progress).map(Made::Image),
        Kind::Overlap => plots::overlap(of, wish).map(Made::Plot),
        Kind::Graph => plots::graph(of, wish).map(Made::Plot),
        Kind::Convergence => plots::convergence(of, wish).map(Made::Plot),
    }
}

fn without_surface(kind: Kind) -> PictureError {
    lacking(kind, "the model has no surface", "register the scans with the options cloud and mesh")
}

fn lacking(kind: Kind, lacks: &'static str, remedy: &'static str) -> PictureError {
    PictureError::Lacking { kind: kind.name(), lacks, remedy }
}

/// From where a model is seen. One with a face is seen from before the face, whatever its frame, unless a side is named.
fn axes(of: &Material, side: Side) -> Axes {
    let usual = upright(Axes::of_side(side), &of.surface.cloud.points);
    let is_face = |signature| judge(signature, &standard::face(), MatchMethod::Verified).score >= MATCH_SCORE;
    let signature = of.signature.as_ref().filter(|_| side == Side::Default);
    let face = signature.filter(|signature| is_face(signature)).and_then(|signature| signature.fit());
    match face {
        // the standard's frame is that of pictures: x to the right, y up, z to who looks
        Some(face) => {
            let (rotation, axes) = (face.pose.motion.rotation, Axes::of_side(side));
            Axes::looking(rotation * axes.toward, rotation * axes.up)
        }
        None => usual,
    }
}

/// Models keep the frame of their first scan if nothing else is known. What lies before the origin, along z, was seen from there by a
/// camera, whose y goes down: it is shown as the camera saw it.
pub(crate) fn upright(axes: Axes, points: &[Point3]) -> Axes {
    let Some(bounds) = Bounds::of(points) else { return axes };
    let center = bounds.center();
    let is_ahead = bounds.min.z > 0.0 && center.z > 2.0 * center.x.abs().max(center.y.abs());
    if is_ahead { axes.of_camera_frame() } else { axes }
}

/// Pixels at the rims of a picture that the model leaves to what is written there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Margins {
    left: f64,
    right: f64,
    top: f64,
}

impl Margins {
    /// For a list on the left.
    fn of_key(size: Size, entries: &[(String, Rgb)]) -> Margins {
        Margins { left: legend::key_width(size, entries), ..Margins::default() }
    }

    /// For a line of words.
    fn of_title(size: Size) -> Margins {
        Margins { top: legend::title_height(size), ..Margins::default() }
    }

    /// For a bar of colours on the right with its title: what letters need, but no more than a quarter of a small picture.
    fn of_bar(size: Size) -> Margins {
        const LETTERS: f64 = 110.0;
        let width = f64::from(size.width());
        Margins { right: (width / 9.0).max(LETTERS.min(width / 4.0)), ..Margins::of_title(size) }
    }

    /// A camera that has these points in what is left of a picture.
    fn camera(self, points: &[Point3], axes: Axes, size: Size, is_perspective: bool) -> Camera {
        let room = [f64::from(size.width()) - self.left - self.right, f64::from(size.height()) - self.top];
        let room = Size::clamped(room[0] as u32, room[1] as u32);
        Camera::fit(points, axes, room, is_perspective).moved([self.left, self.top])
    }
}

/// A surface with a camera before it.
fn rendered(
    of: &Material,
    wish: &Wish,
    colors: Option<&[Rgb]>,
    paint: Paint,
    margins: Margins,
    progress: &Progress,
) -> Result<Rendered, PictureError> {
    let is_perspective = wish.side == Side::Default;
    let camera = margins.camera(&of.surface.cloud.points, axes(of, wish.side), wish.size, is_perspective);
    Ok(render(&scene(&of.surface, colors, paint), &camera, wish.size, progress)?)
}

/// A surface to be drawn.
pub(crate) fn scene<'a>(surface: &'a Surface, colors: Option<&'a [Rgb]>, paint: Paint) -> Scene<'a> {
    let is_cloud = surface.faces.is_empty();
    let fits = |count: usize| count == surface.cloud.len();
    Scene {
        points: &surface.cloud.points,
        normals: surface.cloud.normals.as_deref().filter(|normals| is_cloud && fits(normals.len())),
        faces: &surface.faces,
        colors: colors.filter(|colors| fits(colors.len())),
        paint,
        spacing: if is_cloud { reach_of_neighbours(&surface.cloud.points) } else { 0.0 },
    }
}

/// A distance within which nearly all points have neighbours on all sides, so that discs of about this size leave no holes. Scans that
/// overlap have nearest neighbours at any distance; the eighth is on another side.
fn reach_of_neighbours(points: &[Point3]) -> f64 {
    const ASKED: usize = 1500;
    const AROUND: usize = 9;
    // the eighth neighbour on a square grid is its diagonal away
    const DIAGONAL: f64 = std::f64::consts::SQRT_2;
    // of so many points some tell as much; their distances are larger by the root of what was left out
    const INDEXED: usize = 400_000;
    let Some(first) = points.first() else { return 0.0 };
    let thinned = points.len().div_ceil(INDEXED).max(1);
    let local = |point: &Point3| LocalPoint::from((point - first).cast::<f32>());
    let indexed = IndexedPoints::new(points.iter().step_by(thinned).map(local).collect());
    let diagonal = DIAGONAL * (thinned as f64).sqrt();
    let points = &indexed.points;
    let step = points.len().div_ceil(ASKED).max(1);
    let mut found = Vec::new();
    let mut farthest = |point: &LocalPoint| {
        indexed.tree.k_nearest(point, AROUND, f32::INFINITY, &mut found);
        found.last().map_or(0.0, |last| f64::from(last.distance2).sqrt())
    };
    let mut distances: Vec<f64> = points.iter().step_by(step).map(&mut farthest).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances.get(distances.len() * 3 / 4).map_or(0.0, |distance| distance / diagonal)
}

/// A finished picture with what is written onto it; a bar for its scale unless it is in perspective.
fn with_legend(mut rendered: Rendered, of: &Material, write: impl FnOnce(&mut Drawing, &Rendered)) -> Image {
    let mut drawing = Drawing::new(rendered.image.size());
    write(&mut drawing, &rendered);
    if let Some(scale) = rendered.camera().scale() {
        legend::scale_bar(&mut drawing, scale, of.unit.name());
    }
    drawing.paint(&mut rendered.image);
    rendered.image
}

/// The unit behind a title.
fn in_unit(what: &str, of: &Material) -> String {
    match of.unit {
        visage_geometry::Unit::Unknown => what.to_owned(),
        unit => format!("{what}, {}", unit.name()),
    }
}
