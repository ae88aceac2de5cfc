//! Facial triangles, standards and signatures. Pure. [`describe`] makes a model's [`Signature`].
//!
//! - the paper's: [`triangle`] (shape, and the matching error E_FT), [`judgement`] (Algorithm 2 and the verdict), [`standard`] (FT_S),
//!   [`mod@sum_of_distances`] (the distance of Table 3)
//! - finding a face: [`caps_and_pits`] of the curvature, [`triangle_candidates`] by cost, `levels` of scale, [`detection`] over all of
//!   them, `candidates` and `refinement`: which places get a closer look
//! - the dense fit: [`dense_fit`] of a [`template`] ([`relief`], [`modes`], [`spline`]) on a [`target`], by a [`similarity`]
//! - what is kept: [`signature`], [`dense_signature`] (whose face is it), [`landmarks`] and [`lower_face`]
//! - before all that: [`mod@cleaned`], [`sampled_surface`]; to be looked at: [`mod@point_saliency`]

pub(crate) mod candidates;
pub mod caps_and_pits;
pub mod cleaned;
pub mod dense_fit;
pub mod dense_signature;
pub mod detection;
pub mod extent;
pub mod judgement;
pub mod landmarks;
pub(crate) mod levels;
pub mod lower_face;
pub mod modes;
mod modes_table;
pub mod point_saliency;
mod refinement;
pub mod relief;
mod relief_table;
pub mod sampled_surface;
pub mod signature;
pub mod similarity;
pub mod spline;
pub mod standard;
pub mod sum_of_distances;
pub mod target;
pub mod template;
pub mod triangle;
pub mod triangle_candidates;

pub use cleaned::LeftOut;
pub use dense_signature::DenseSignature;
use detection::Detection;
pub use extent::FaceExtent;
pub use judgement::{MatchMethod, Verdict, judge};
pub use landmarks::Landmarks;
pub use point_saliency::point_saliency;
use sampled_surface::{Form, SampledSurface};
pub use signature::{Signature, SignatureError, SignatureSummary, Size};
pub use standard::FaceStandard;
pub use sum_of_distances::sum_of_distances;
pub use triangle::{Shape, Triangle};
pub use triangle_candidates::{Cost, TriangleCandidate};

use crate::descriptor::{SampledShape, ShapeDescriptor, ViewCode};
use crate::saliency::orientation::OrientedCloud;
use crate::saliency::{self, CurvedSurface, Patches, Region, RegionOptions, Side};
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Bounds, Mesh, Motion, Surface, Unit, Vector3, own_frame};

/// Why a surface has no signature.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DescribeError {
    /// The caller asked for a stop.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// Too little surface to describe.
    #[error("{0}")]
    Degenerate(String),
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// With fewer points than this nothing can be said about a shape.
        least_points: usize = 50,
        /// A signature keeps this many facial triangles, the cheapest.
        most_facial_triangles: usize = 16,
        /// A cloud is thinned to cells of this share of the diagonal before anything is fitted: about a millimetre on a head.
        cloud_cell_of_diagonal: f64 = 0.003,
        /// Coordinates beyond this have squares that single precision has no numbers for.
        largest_coordinate: f64 = 1e15,
    }
}

/// Computes the signature of a mesh or of a cloud. Runs inside the caller's rayon pool.
///
/// Everything is found in the surface's own frame, since grids and boxes lie along axes, and moved to the file's.
pub fn describe(surface: &Surface, unit: Unit, progress: &Progress) -> Result<Signature, DescribeError> {
    progress.report(Stage::Describing, 0.0);
    checked_size(surface)?;
    let (surface, left_out) = cleaned::cleaned(surface, progress)?;
    let (surface, motion_file_own) = in_own_frame(&surface);
    let bounds = checked_bounds(&surface)?;
    let prepared = Prepared::new(&surface, bounds.diagonal(), progress)?;
    progress.report(Stage::Describing, 0.1);
    let curved = prepared.curved(progress)?;
    let xi = curved.xi();
    let map = saliency::saliency(&curved, xi, progress)?;
    let regions = saliency::salient_regions(&curved, &map, xi, &RegionOptions::default());
    progress.check()?;
    progress.report(Stage::Describing, 0.4);
    let oriented = prepared.oriented(bounds);
    let mut detection = detection::detect(&oriented, unit, &standard::face(), progress)?;
    if !detection.has_face()
        && let Some(found) = before_a_wall(&surface, unit, progress)?
    {
        detection = found;
    }
    detection.candidates.truncate(TUNING.most_facial_triangles);
    let radius = rms_radius(&curved);
    let (shape, views) = prepared.shape().map_or((None, Vec::new()), |(shape, views)| (Some(shape), views));
    progress.check()?;
    progress.report(Stage::Describing, 1.0);
    let regions: Vec<Region> = regions.iter().map(|region| region.moved(&motion_file_own)).collect();
    let size = Size { origin: motion_file_own * bounds.center(), diagonal: bounds.diagonal(), radius, unit };
    let signature = Signature::new(&size, &regions, &detection.moved(&motion_file_own));
    Ok(signature.with_shape(shape).with_views(views).with_left_out(left_out))
}

/// A surface as samples in the file's frame, by which it can be laid onto another; `None` if there is no area to sample. Runs
/// inside the caller's rayon pool.
///
/// # Errors
/// As [`describe`].
pub fn sampled_shape(surface: &Surface, progress: &Progress) -> Result<Option<SampledShape>, DescribeError> {
    let surface = cleaned(surface, progress)?;
    let diagonal = checked_bounds(&surface)?.diagonal();
    Ok(match Prepared::new(&surface, diagonal, progress)? {
        Prepared::Mesh { mesh, .. } => SampledShape::of_mesh(&mesh),
        Prepared::Cloud { cloud, .. } => SampledShape::of_cloud(&cloud),
    })
}

/// The surface without what is none of it; see [`mod@cleaned`].
pub(crate) fn cleaned(surface: &Surface, progress: &Progress) -> Result<Surface, DescribeError> {
    checked_size(surface)?;
    Ok(cleaned::cleaned(surface, progress)?.0)
}

/// The face of what stands before a wall or on a floor, which would else set the scale of everything.
fn before_a_wall(surface: &Surface, unit: Unit, progress: &Progress) -> Result<Option<Detection>, DescribeError> {
    let Some(rest) = cleaned::without_supports(surface, progress)? else { return Ok(None) };
    let (rest, motion) = in_own_frame(&cleaned::cleaned(&rest, progress)?.0);
    let Ok(bounds) = checked_bounds(&rest) else { return Ok(None) };
    let prepared = Prepared::new(&rest, bounds.diagonal(), progress)?;
    let found = detection::detect(&prepared.oriented(bounds), unit, &standard::face(), progress)?;
    Ok(found.has_face().then(|| found.moved(&motion)))
}

/// The surface in its own frame, and the motion back to the file's.
pub(crate) fn in_own_frame(surface: &Surface) -> (Surface, Motion) {
    let motion_own_file = own_frame::motion_own_file(surface);
    (surface.moved(&motion_own_file), motion_own_file.inverse())
}

/// A surface with consistent unit normals, and what is known of their side.
pub(crate) enum Prepared {
    Mesh { mesh: Mesh, side: Side },
    Cloud { cloud: OrientedCloud, patches: Patches },
}

impl Prepared {
    pub(crate) fn new(surface: &Surface, diagonal: f64, progress: &Progress) -> Result<Prepared, Canceled> {
        if let Some(mesh) = surface.mesh() {
            let side = saliency::orientation::side_of_mesh(&mesh);
            progress.check()?;
            return Ok(Prepared::Mesh { mesh, side });
        }
        let cloud = saliency::orientation::oriented_cloud(surface, TUNING.cloud_cell_of_diagonal * diagonal, progress)?;
        let patches = Patches::new(&cloud.points, &cloud.normals, &cloud.proximity, progress)?;
        Ok(Prepared::Cloud { cloud, patches })
    }

    /// What the paper's saliency needs to know.
    fn curved(&self, progress: &Progress) -> Result<CurvedSurface, Canceled> {
        match self {
            Prepared::Mesh { mesh, side } => {
                let curved = CurvedSurface::from_mesh(mesh, side.first_sign());
                progress.check()?;
                Ok(curved)
            }
            Prepared::Cloud { cloud, .. } => CurvedSurface::from_cloud(&cloud.points, &cloud.normals, progress),
        }
    }

    /// The shape as a whole, and as single scans would see it.
    fn shape(&self) -> Option<(ShapeDescriptor, Vec<ViewCode>)> {
        match self {
            Prepared::Mesh { mesh, .. } => ShapeDescriptor::with_views_of_mesh(mesh),
            Prepared::Cloud { cloud, .. } => ShapeDescriptor::with_views_of_cloud(cloud),
        }
    }

    /// What the detector samples.
    pub(crate) fn oriented(&self, bounds: Bounds) -> SampledSurface<'_> {
        let (form, side) = match self {
            Prepared::Mesh { mesh, side } => (Form::Mesh(mesh), *side),
            Prepared::Cloud { cloud, patches } => (Form::Cloud(patches), cloud.side),
        };
        SampledSurface { form, bounds, side }
    }
}

/// Refuses coordinates that can't be reckoned with.
fn checked_size(surface: &Surface) -> Result<(), DescribeError> {
    let is_sound = |p: &visage_geometry::Point3| p.iter().all(|x| x.abs() <= TUNING.largest_coordinate);
    match surface.cloud.points.iter().find(|p| !is_sound(p)) {
        None => Ok(()),
        Some(p) => Err(DescribeError::Degenerate(format!(
            "a point lies at ({:e}, {:e}, {:e}); send a model whose coordinates are no larger than {:e}",
            p.x, p.y, p.z, TUNING.largest_coordinate
        ))),
    }
}

/// The box around the surface, if there is enough surface to describe.
pub(crate) fn checked_bounds(surface: &Surface) -> Result<Bounds, DescribeError> {
    let count = surface.cloud.len();
    // what a mesh is like its area tells, in however few vertices
    let is_enough = |bounds: &Bounds| count >= TUNING.least_points || has_area(surface, bounds);
    match surface.cloud.bounds() {
        Some(bounds) if bounds.diagonal().is_finite() && bounds.diagonal() > 0.0 && is_enough(&bounds) => Ok(bounds),
        _ => Err(DescribeError::Degenerate(format!(
            "the surface has {count} points, or all in one place; send a model with at least {} points \
             that differ, or with faces",
            TUNING.least_points
        ))),
    }
}

/// Whether a mesh has faces with an area.
fn has_area(surface: &Surface, bounds: &Bounds) -> bool {
    let unit = bounds.diagonal();
    surface.faces.iter().any(|face| {
        let [a, b, c] = face.map(|vertex| surface.cloud.points[vertex as usize]);
        ((b - a) / unit).cross(&((c - a) / unit)).norm() > 0.0
    })
}

/// The root mean square distance of the surface from its centroid.
fn rms_radius(surface: &CurvedSurface) -> f64 {
    let weighted = || surface.points.iter().zip(&surface.areas);
    let area: f64 = surface.areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let center = weighted().map(|(p, a)| p.coords * *a).sum::<Vector3>() / area;
    (weighted().map(|(p, a)| a * (p.coords - center).norm_squared()).sum::<f64>() / area).sqrt()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    /// The height of a face-like relief over (x, y), mm: a brow-to-chin vault with a nose and two eye pits, at the
    /// places of the standard but 8 % broader.
    pub(crate) fn height(x: f64, y: f64) -> f64 {
        let bump = |cx: f64, cy: f64, sx: f64, sy: f64| (-((x - cx) / sx).powi(2) - ((y - cy) / sy).powi(2)).exp();
        let vault = 104.0 - x * x / 130.0 - (y - 10.0) * (y - 10.0) / 400.0;
        let nose = 22.0 * bump(0.0, -3.0, 18.0, 16.0) + 10.0 * bump(0.0, 16.0, 9.0, 22.0);
        vault + nose - 10.0 * (bump(-21.7, 33.0, 10.0, 9.0) + bump(21.7, 33.0, 10.0, 9.0))
    }

    /// That relief as an open mesh of 2 mm squares, wound outward.
    pub(crate) fn mask() -> Surface {
        let side = 56;
        let coordinate = |k: usize| 2.0 * k as f64 - 55.0;
        let points = (0..side * side)
            .map(|k| (coordinate(k % side), coordinate(k / side)))
            .map(|(x, y)| Point3::new(x, y, height(x, y)))
            .collect();
        let faces = (0..side - 1)
            .flat_map(|row| (0..side - 1).map(move |column| (row * side + column) as u32))
            .flat_map(|a| [[a, a + 1, a + 57], [a, a + 57, a + 56]])
            .collect();
        Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
    }

    fn judged(surface: &Surface, unit: Unit) -> Verdict {
        let signature = describe(surface, unit, &Progress::silent()).expect("a sound surface");
        judge(&signature, &standard::face(), MatchMethod::Descriptors)
    }

    fn is_at_its_places(verdict: &Verdict, motion: &Motion) -> bool {
        let places = [[-21.7, 33.0], [21.7, 33.0], [0.0, -3.0]].map(|[x, y]| motion * Point3::new(x, y, height(x, y)));
        verdict.triangle.is_some_and(|corners| corners.iter().zip(&places).all(|(c, p)| (c - p).norm() < 6.0))
    }

    #[test]
    fn a_mask_is_a_face_whatever_its_unit_winding_and_pose() {
        let surface = mask();
        let known = judged(&surface, Unit::Mm);
        assert!(known.score > 0.5, "{known:?}");
        assert!(is_at_its_places(&known, &Motion::identity()));

        let motion = Motion::new(
            visage_geometry::Vector3::new(400.0, -20.0, 7.0),
            visage_geometry::Vector3::new(2.0, 1.0, -0.4),
        );
        let mut moved = surface.moved(&motion);
        for face in &mut moved.faces {
            face.swap(0, 1);
        }
        let unknown = judged(&moved, Unit::Unknown);
        assert!(unknown.score > 0.5, "{unknown:?}");
        assert!(is_at_its_places(&unknown, &motion), "{unknown:?}");
    }

    #[test]
    fn a_bare_cloud_of_it_is_a_face_too() {
        let bare = Surface { cloud: mask().cloud, ..Surface::default() };
        let verdict = judged(&bare, Unit::Mm);
        assert!(verdict.score > 0.5 && is_at_its_places(&verdict, &Motion::identity()), "{verdict:?}");
    }

    #[test]
    fn the_built_in_face_passes_its_own_check_where_the_standard_says() {
        let Mesh { vertices, faces } = template::tests::relief_mesh();
        let relief = Surface { cloud: Cloud::from_points(vertices), faces, ..Surface::default() };
        let signature = describe(&relief, Unit::Mm, &Progress::silent()).expect("a sound surface");
        let standard = standard::face();
        let verdict = judge(&signature, &standard, MatchMethod::Verified);
        assert!(verdict.score > 0.99, "{verdict:?}");
        let fit = verdict.fit.expect("the dense check was made");
        assert!(fit.residual_mm < 0.8 && fit.observed > 0.99, "{fit:?}");
        let corners = verdict.triangle.expect("a face was found");
        for (found, annotated) in corners.iter().zip(&standard.annotated.corners) {
            assert!((found - annotated).norm() < 1.0, "{found} {annotated}");
        }
        let best = signature.candidates().next().expect("a triangle was found");
        // the cap's peak wanders over the nose with the scale level, by some 7 mm
        for (found, annotated) in best.corners.iter().zip(&standard.annotated.corners) {
            assert!((found - annotated).norm() < 8.0, "{found} {annotated}");
        }
    }

    #[test]
    fn a_ball_is_no_face() {
        let mesh = saliency::curvature::tests::sphere(90.0, 5);
        let ball = Surface { cloud: Cloud::from_points(mesh.vertices), faces: mesh.faces, ..Surface::default() };
        for unit in [Unit::Mm, Unit::Unknown] {
            let verdict = judged(&ball, unit);
            assert!(verdict.score < 0.1, "{verdict:?}");
        }
    }

    #[test]
    fn a_face_of_the_wrong_size_in_a_known_unit_is_none() {
        assert!(judged(&mask(), Unit::Cm).score < 0.5, "a face half a metre wide");
    }

    #[test]
    fn signatures_do_not_depend_on_the_number_of_threads() {
        let make = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| describe(&mask(), Unit::Unknown, &Progress::silent()).expect("a sound surface").to_bytes())
        };
        assert_eq!(make(1), make(3));
    }

    #[test]
    fn too_little_surface_is_refused_with_a_remedy() {
        let few = Surface { cloud: Cloud::from_points(vec![Point3::origin(); 3]), ..Surface::default() };
        let one_place = Surface { cloud: Cloud::from_points(vec![Point3::origin(); 300]), ..Surface::default() };
        for surface in [few, one_place, Surface::default()] {
            let error = describe(&surface, Unit::Mm, &Progress::silent()).expect_err("nothing to describe");
            assert!(error.to_string().contains("send a model with at least 50 points"), "{error}");
        }
    }

    #[test]
    fn a_flat_plate_has_a_signature_without_triangles() {
        let points = (0..400).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        let plate = Surface { cloud: Cloud::from_points(points), ..Surface::default() };
        let signature = describe(&plate, Unit::Unknown, &Progress::silent()).expect("a sound surface");
        assert_eq!(signature.summary().triangles, 0);
    }

    /// Raises the flag as soon as so much is done.
    struct StopAt(f64, std::sync::Arc<std::sync::atomic::AtomicBool>);

    impl visage_geometry::progress::ProgressSink for StopAt {
        fn report(&self, _: Stage, fraction: f64) {
            if fraction >= self.0 {
                self.1.store(true, std::sync::atomic::Ordering::Relaxed);
            }
        }
    }

    #[test]
    fn a_stop_is_obeyed_at_every_stage() {
        let bare = Surface { cloud: mask().cloud, ..Surface::default() };
        for surface in [mask(), bare] {
            for fraction in [0.0, 0.1, 0.4] {
                let raised = std::sync::Arc::default();
                let progress =
                    Progress::new(std::sync::Arc::new(StopAt(fraction, std::sync::Arc::clone(&raised))), raised);
                assert_eq!(
                    describe(&surface, Unit::Mm, &progress),
                    Err(DescribeError::Canceled(Canceled)),
                    "{fraction}"
                );
            }
        }
    }

    #[test]
    fn coordinates_of_any_size_are_described_or_refused() {
        for scale in [1e-300, 1e-40, 1e-20, 1e-6, 1e9, 1e14, 1e19, 1e30, 1e200, f64::MAX] {
            let mut surface = mask();
            surface.cloud.points.iter_mut().for_each(|p| *p = p.map(|x| x / 100.0 * scale));
            let bare = Surface { cloud: surface.cloud.clone(), ..Surface::default() };
            for surface in [surface, bare] {
                match describe(&surface, Unit::Unknown, &Progress::silent()) {
                    Ok(_) => assert!(scale <= 1e15),
                    Err(DescribeError::Degenerate(why)) => assert!(!(1e-20..=1e14).contains(&scale), "{scale}: {why}"),
                    Err(error) => panic!("{scale}: {error}"),
                }
            }
        }
    }

    #[test]
    fn a_stop_is_obeyed() {
        struct Nobody;
        impl visage_geometry::progress::ProgressSink for Nobody {
            fn report(&self, _: Stage, _: f64) {}
        }
        let raised = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
        let progress = Progress::new(std::sync::Arc::new(Nobody), raised);
        assert_eq!(describe(&mask(), Unit::Mm, &progress), Err(DescribeError::Canceled(Canceled)));
    }
}
