//! The surface of a cloud: made, made coarser as far as is wanted, with a small copy.

use std::borrow::Cow;

use super::PipelineError;
use super::report::{Estimate, LayersReport, SimplifiedReport, SurfaceOutcome};
use visage_domain::options::Options;
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Cloud, Point3};
use visage_registration::view::{View, median_spacing};
pub use visage_surface::SurfaceMesh;
use visage_surface::merge::{ModelCloud, PosedView, merge};
use visage_surface::reconstruct::free_space::FreeSpace;
use visage_surface::reconstruct::layers::layers;
use visage_surface::reconstruct::{Fill, SurfaceOptions, reconstruct};
use visage_surface::simplify::levels;
pub use visage_surface::simplify::{Target, simplify};

/// Triangles of the copy that pages can show large.
pub const MEDIUM_TRIANGLES: usize = 100_000;
/// Triangles of the small copy.
pub const PREVIEW_TRIANGLES: usize = 20_000;

/// The memory that the grid of a surface may take for each point of its cloud (bytes): what jobs are admitted with, but for the
/// cloud and the mesh. Scans of one coverage take some 180. Points that lie far from each other for their spacing would take
/// any number of it: their surface gets wider cells.
const GRID_BYTES_PER_POINT: u64 = 240;
/// It may take so much however few points there are (bytes).
const GRID_BYTES: u64 = 128 << 20;

/// The memory that the grid may take for so many points.
fn grid_bytes(points: usize) -> u64 {
    GRID_BYTES_PER_POINT.saturating_mul(points as u64).clamp(GRID_BYTES, SurfaceOptions::default().max_bytes)
}

/// What is wanted of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceOrder {
    /// What becomes of holes.
    pub fill: Fill,
    /// How coarse it may become; nothing given keeps all.
    pub target: Target,
    /// Whether coarse copies are made.
    pub preview: bool,
}

impl From<&Options> for SurfaceOrder {
    fn from(options: &Options) -> Self {
        let target = Target { triangles: options.triangles, max_error: options.max_error };
        SurfaceOrder { fill: options.fill, target, preview: options.preview }
    }
}

/// A surface with its coarse copies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MadeSurface {
    /// The surface.
    pub surface: SurfaceMesh,
    /// A copy that pages can show large, if copies were asked for and the surface itself has more triangles.
    pub medium: Option<SurfaceMesh>,
    /// A small copy, if it was asked for.
    pub preview: Option<SurfaceMesh>,
    /// How it came about.
    pub report: SurfaceOutcome,
}

impl MadeSurface {
    /// Leaves out all triangles with a corner for which `is_gone` holds.
    pub fn cut(&mut self, is_gone: impl Fn(&Point3) -> bool) {
        let copies = self.medium.iter_mut().chain(&mut self.preview);
        for surface in std::iter::once(&mut self.surface).chain(copies) {
            let gone: Vec<bool> = surface.mesh.vertices.iter().map(&is_gone).collect();
            *surface = surface.kept(|face| !face.iter().any(|vertex| gone[*vertex as usize]));
        }
    }
}

/// What is known of how the points of a cloud were seen.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seen<'a> {
    /// For each point the scan that it is of.
    pub views: Option<&'a [u16]>,
    /// What scanners looked through.
    pub free_space: Option<&'a FreeSpace>,
}

/// The surface of a cloud whose normals point outward; `spacing` is that of a single scan. `None` if it makes none.
///
/// # Errors
/// [`Canceled`], between steps.
pub fn make_surface(
    cloud: &Cloud,
    Seen { views, free_space }: Seen,
    spacing: f64,
    order: &SurfaceOrder,
    progress: &Progress,
) -> Result<Option<MadeSurface>, Canceled> {
    let part = |from: f64, to: f64| progress.within(Stage::Surfacing, from, to);
    progress.report(Stage::Surfacing, 0.0);
    let options = SurfaceOptions { fill: order.fill, views, free_space, max_bytes: grid_bytes(cloud.len()) };
    let Some(made) = reconstruct(cloud, spacing, &options, &part(0.0, 0.7))? else { return Ok(None) };
    let reconstruction = made.report;
    let mut surface = SurfaceMesh::from(made);
    let mut simplified = None;
    progress.report(Stage::Surfacing, 0.7);
    if order.target.is_given() {
        let coarser = simplify(&surface, &order.target, progress)?;
        surface = coarser.surface;
        simplified = Some(SimplifiedReport::new(coarser.report, spacing));
    }
    progress.report(Stage::Surfacing, 0.9);
    let [medium, preview] = if order.preview { copies(&surface, progress)? } else { [None, None] };
    let layers = views.and_then(|views| layers(cloud, views, spacing)).map(|found| LayersReport::new(found, spacing));
    progress.report(Stage::Surfacing, 1.0);
    let estimate = Estimate::of_surface(cloud.len());
    let mut report = SurfaceOutcome { reconstruction, estimate, simplified, layers, reasons: Vec::new() };
    report.name(&[]);
    Ok(Some(MadeSurface { surface, medium, preview, report }))
}

/// Coarse copies of a surface: one for pages that show it large, where it has more triangles itself, and a small one.
fn copies(surface: &SurfaceMesh, progress: &Progress) -> Result<[Option<SurfaceMesh>; 2], Canceled> {
    let count = surface.mesh.faces.len();
    if count <= PREVIEW_TRIANGLES {
        return Ok([None, Some(surface.clone())]);
    }
    let sizes = [MEDIUM_TRIANGLES, PREVIEW_TRIANGLES];
    let mut found = levels(surface, if count > MEDIUM_TRIANGLES { &sizes } else { &sizes[1..] }, progress)?;
    let preview = found.pop();
    Ok([found.pop(), preview])
}

/// The merged cloud, and how it was seen.
pub(super) struct Merged {
    pub(super) model: ModelCloud,
    /// For each view whether its normals are known to be outward.
    pub(super) outward: Vec<bool>,
    /// What scanners looked through, if the surface has to be kept out of there: holes that are small have no room for it.
    pub(super) free_space: Option<FreeSpace>,
}

impl Merged {
    /// Merges the placed views.
    pub(super) fn of(
        posed: &[PosedView],
        spacing: f64,
        options: &Options,
        progress: &Progress,
    ) -> Result<Merged, Canceled> {
        let (model, outward) = merge(posed, progress)?;
        let is_wanted = options.cloud && options.mesh && options.fill == Fill::All;
        Ok(Merged { model, outward, free_space: is_wanted.then(|| FreeSpace::of(posed, spacing)) })
    }
}

/// The surface of the placed views; `None` if they make none.
///
/// Views of which it is not known on which side the outside is are left out: they would turn the surface inside
/// out where they lie.
pub(super) fn surface(
    merged: &Merged,
    names: &[String],
    spacing: f64,
    options: &Options,
    progress: &Progress,
) -> Result<Option<MadeSurface>, PipelineError> {
    let (cloud, views_of_points) = of_known_side(&merged.model, &merged.outward);
    let seen = Seen { views: Some(&views_of_points), free_space: merged.free_space.as_ref() };
    let mut made = make_surface(&cloud, seen, spacing, &options.into(), progress)?;
    if let Some(made) = &mut made {
        made.report.name(names);
    }
    Ok(made)
}

/// The spacing of a single scan among the placed ones.
pub(super) fn spacing(views: &[View], placed: &[bool]) -> f64 {
    median_spacing(views.iter().zip(placed).filter(|(_, placed)| **placed).map(|(view, _)| view))
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

    /// A sphere of radius 10.
    fn sphere() -> (Cloud, f64) {
        let count = 30_000;
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let direction = |k: usize| {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
            let (sine, cosine) = (golden * k as f64).sin_cos();
            let around = (1.0 - z * z).sqrt();
            nalgebra::Vector3::new(around * cosine, around * sine, z)
        };
        let directions: Vec<nalgebra::Vector3<f64>> = (0..count).map(direction).collect();
        let cloud = Cloud {
            points: directions.iter().map(|d| Point3::from(10.0 * d)).collect(),
            normals: Some(directions.iter().map(|d| d.cast()).collect()),
            ..Cloud::default()
        };
        (cloud, 10.0 * (4.0 * std::f64::consts::PI / count as f64).sqrt())
    }

    #[test]
    fn points_of_views_of_unknown_side_are_left_out() {
        let points = (0..4).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
        let model = ModelCloud { cloud: Cloud::from_points(points), views: vec![0, 1, 1, 2] };
        assert!(matches!(of_known_side(&model, &[true; 3]), (Cow::Borrowed(_), Cow::Borrowed(_))));
        let (known, views) = of_known_side(&model, &[true, false, true]);
        assert_eq!(*views, [0, 2]);
        assert_eq!(known.points, [model.cloud.points[0], model.cloud.points[3]]);
    }

    #[test]
    fn a_surface_is_as_coarse_as_is_wanted_and_says_what_that_cost() {
        let (cloud, spacing) = sphere();
        let make = |options: Options| {
            make_surface(&cloud, Seen::default(), spacing, &(&options).into(), &Progress::silent())
                .expect("not canceled")
                .expect("one")
        };
        let whole = make(Options { preview: false, ..Options::default() });
        assert_eq!((whole.report.simplified.is_none(), &whole.preview), (true, &None));
        let coarse = make(Options { triangles: Some(1000), ..Options::default() });
        let report = coarse.report.simplified.expect("it was made coarser");
        assert_eq!(report.of_surface.triangles, coarse.surface.mesh.faces.len());
        assert!(report.of_surface.triangles <= 1000 && report.of_surface.from_triangles > 10_000, "{report:?}");
        assert!((report.error_spacings.max * spacing / report.of_surface.error.max - 1.0).abs() < 1e-9);
        assert_eq!(coarse.preview.as_ref(), Some(&coarse.surface), "it is small enough");
        let fine = make(Options { max_error: Some(0.01), ..Options::default() });
        assert!(fine.report.simplified.expect("made coarser").of_surface.error.max <= 0.01);
        let copied = make(Options::default());
        let preview = copied.preview.expect("asked for");
        assert!(
            preview.mesh.faces.len() <= PREVIEW_TRIANGLES && copied.medium.is_none(),
            "it has not many more itself"
        );
    }

    #[test]
    fn a_fine_surface_has_two_copies() {
        // a torus in strips of quads, enough for more than 100 000 triangles
        let (around, along) = (240u32, 230u32);
        let vertex = |k: u32| {
            let (a, b) = (f64::from(k % around) / f64::from(around), f64::from(k / around) / f64::from(along));
            let ((sa, ca), (sb, cb)) = ((a * std::f64::consts::TAU).sin_cos(), (b * std::f64::consts::TAU).sin_cos());
            Point3::new((10.0 + 3.0 * ca) * cb, (10.0 + 3.0 * ca) * sb, 3.0 * sa)
        };
        let at = |a: u32, b: u32| a % around + b % along * around;
        let faces = (0..around * along).flat_map(|k| {
            let (a, b) = (k % around, k / around);
            [[at(a, b), at(a, b + 1), at(a + 1, b)], [at(a + 1, b), at(a, b + 1), at(a + 1, b + 1)]]
        });
        let mesh =
            visage_geometry::Mesh { vertices: (0..around * along).map(vertex).collect(), faces: faces.collect() };
        let surface = SurfaceMesh { mesh, ..SurfaceMesh::default() };
        let [medium, preview] = copies(&surface, &Progress::silent()).expect("not canceled");
        let count = |copy: Option<SurfaceMesh>| copy.expect("there").mesh.faces.len();
        let (medium, preview) = (count(medium), count(preview));
        assert!((90_000..=MEDIUM_TRIANGLES).contains(&medium), "{medium}");
        assert!((18_000..=PREVIEW_TRIANGLES).contains(&preview), "{preview}");
    }

    #[test]
    fn points_far_from_each_other_make_wider_cells_and_not_more_memory() {
        // half of the points are spread so widely that each needs a block of its own
        let (dense, spacing) = sphere();
        let (wide, _) = sphere();
        let mut cloud = dense.clone();
        cloud.points.extend(wide.points.iter().map(|p| Point3::from(300.0 * p.coords)));
        cloud.normals = Some([dense.normals.unwrap_or_default(), wide.normals.unwrap_or_default()].concat());
        let order = SurfaceOrder { fill: Fill::Small, target: Target::default(), preview: false };
        let made = make_surface(&cloud, Seen::default(), spacing, &order, &Progress::silent()).expect("not canceled");
        let report = made.expect("a surface").report;
        assert!(report.reconstruction.widened, "{report:?}");
        assert_eq!((grid_bytes(60_000), grid_bytes(1 << 40)), (GRID_BYTES, 2 << 30));
    }

    #[test]
    fn what_is_cut_is_gone_from_the_copy_too() {
        let (cloud, spacing) = sphere();
        let order = (&Options::default()).into();
        let made = make_surface(&cloud, Seen::default(), spacing, &order, &Progress::silent()).expect("not canceled");
        let mut made = made.expect("a surface");
        let before = made.surface.mesh.faces.len();
        made.cut(|place| place.z > 5.0);
        let highest = |surface: &SurfaceMesh| surface.mesh.vertices.iter().map(|v| v.z).fold(f64::MIN, f64::max);
        assert!(highest(&made.surface) <= 5.0 && highest(made.preview.as_ref().expect("there")) <= 5.0);
        assert!(made.surface.mesh.faces.len() < before * 4 / 5);
        assert_eq!(made.surface.support.as_ref().map(Vec::len), Some(made.surface.mesh.vertices.len()));
    }
}
