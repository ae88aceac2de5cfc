//! From a surface with named landmarks to a class: which landmarks are caps or pits, at which scale, which three of them
//! make triangles, and the dense region around these.

use serde::{Deserialize, Serialize};

use super::Standard;
use super::corners::{Corner, CornerKind, SelectiveTriangle};
use crate::faces::caps_and_pits::Place;
use crate::faces::detection::MOST_SAMPLES;
use crate::faces::levels::{Level, spacing_of};
use crate::faces::sampled_surface::SampledSurface;
use crate::faces::standard::INNER_EYE_DISTANCE_MM;
use crate::faces::template::{farthest_first, greatest};
use crate::faces::triangle::Triangle;
use crate::faces::{self, DescribeError, FaceStandard};
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Point3, Surface, Unit, Vector3};

/// A named place of the surface, in the file's frame and unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Landmark {
    /// Its name.
    pub name: String,
    /// Its position.
    pub place: Point3,
}

/// A landmark that is to be a corner of the selective triangle.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CornerChoice {
    /// The landmark's name.
    pub name: String,
    /// Cap or pit; found out from the curvature if not given.
    pub kind: Option<CornerKind>,
}

/// What a user says of a surface.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Annotation {
    /// At least three landmarks.
    pub landmarks: Vec<Landmark>,
    /// Those that form the selective triangle; chosen by the operator if not given.
    pub triangle: Option<[CornerChoice; 3]>,
}

/// Why a surface with landmarks makes no class.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StandardError {
    /// The caller asked for a stop.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// Too little surface.
    #[error("{0}")]
    Degenerate(String),
    /// Fewer than three landmarks.
    #[error("there are {0} landmarks; a class needs at least three")]
    TooFewLandmarks(usize),
    /// A corner that is no landmark, or named twice.
    #[error("the triangle names {0:?}, which is none of the landmarks or comes twice")]
    UnknownCorner(String),
    /// The landmarks lie nearly in one place.
    #[error("the landmarks lie within {percent:.2} % of the model's diagonal; at least 5 % are needed")]
    TooClose {
        /// The size of the triangle they span, as a share of the diagonal.
        percent: f64,
    },
    /// A landmark is not on the surface.
    #[error("landmark {name:?} lies {percent:.0} % of the triangle's size off the surface; at most 15 % are allowed")]
    OffSurface {
        /// The landmark.
        name: String,
        /// How far off.
        percent: f64,
    },
    /// Fewer than three landmarks are caps or pits.
    #[error("there is no {} at {}, at any scale", wanted.map_or("cap or pit", kind_name), names.join(", "))]
    NoCharacter {
        /// The landmarks that are none.
        names: Vec<String>,
        /// What was looked for.
        wanted: Option<CornerKind>,
    },
    /// Three landmarks in a line.
    #[error("the corners lie nearly in a line")]
    InLine,
    /// There is too little surface around the triangle.
    #[error(
        "the surface around the landmarks gives {points} points for the dense check; at least {} are needed", TUNING.least_points
    )]
    TooSmallRegion {
        /// How many it gives.
        points: usize,
    },
}

fn kind_name(kind: CornerKind) -> &'static str {
    match kind {
        CornerKind::Cap => "cap",
        CornerKind::Pit => "pit",
    }
}

impl From<DescribeError> for StandardError {
    fn from(error: DescribeError) -> Self {
        match error {
            DescribeError::Canceled(canceled) => StandardError::Canceled(canceled),
            DescribeError::Degenerate(reason) => StandardError::Degenerate(reason),
        }
    }
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Landmarks span at least this share of the diagonal.
        least_size_of_diagonal: f64 = 0.05,
        /// A landmark is on the surface if it is this near to it, in sizes of the triangle.
        on_surface: f64 = 0.15,
        /// Curvature is measured at these lengths, of that of the face on its triangle: the first that shows the corners.
        feature_scales: [f64; 4] = [1.0, 0.7, 0.5, 1.4],
        /// The operator finds a landmark's cap or pit within this, in feature lengths.
        corner_reach: f64 = 0.4,
        /// Corners less far from lying in a line are no triangle.
        least_fatness: f64 = 0.25,
        /// The most triangles of a class, and the most landmarks they are chosen from.
        most_triangles: usize = 3,
        /// The most landmarks that these are chosen from.
        most_corners: usize = 8,
        /// The dense region reaches this far around each corner, in sizes of the first triangle.
        region_reach: f64 = 0.75,
        /// Spacing of the points it is chosen from, mm on the standard.
        region_spacing_mm: f64 = 3.0,
        /// Points of the dense region: as many as the face's, and no fewer than that.
        region_points: usize = faces::template::TEMPLATE_POINTS,
        /// Fewer points are no region.
        least_points: usize = 120,
    }
}

/// See [`Standard::annotated`].
pub(super) fn annotated(
    surface: &Surface,
    unit: Unit,
    annotation: &Annotation,
    progress: &Progress,
) -> Result<Standard, StandardError> {
    progress.report(Stage::Describing, 0.0);
    check_names(annotation)?;
    let surface = &faces::cleaned(surface, progress)?;
    let bounds = faces::checked_bounds(surface)?;
    // the box that a search goes by lies along the principal axes
    let diagonal = faces::checked_bounds(&faces::in_own_frame(surface).0)?.diagonal();
    let size = spread(annotation);
    if size < TUNING.least_size_of_diagonal * diagonal {
        return Err(StandardError::TooClose { percent: 100.0 * size / diagonal });
    }
    let prepared = faces::Prepared::new(surface, diagonal, progress)?;
    let oriented = prepared.oriented(bounds);
    check_on_surface(&oriented, annotation, size)?;
    let mut refused = None;
    for &sign in oriented.side.signs() {
        progress.check()?;
        match seen(&oriented, annotation, size, sign, progress) {
            Ok(sight) => return finished(&oriented, annotation, unit, sight, diagonal),
            Err(error @ StandardError::Canceled(_)) => return Err(error),
            // the side that the surface itself is wound to is the one to tell of
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    Err(refused.unwrap_or(StandardError::InLine))
}

fn check_names(annotation: &Annotation) -> Result<(), StandardError> {
    if annotation.landmarks.len() < 3 {
        return Err(StandardError::TooFewLandmarks(annotation.landmarks.len()));
    }
    let known = |name: &String| annotation.landmarks.iter().any(|landmark| landmark.name == *name);
    for (k, corner) in annotation.triangle.iter().flatten().enumerate() {
        let twice = annotation.triangle.iter().flatten().take(k).any(|other| other.name == corner.name);
        if twice || !known(&corner.name) {
            return Err(StandardError::UnknownCorner(corner.name.clone()));
        }
    }
    Ok(())
}

/// The landmarks that may be corners, with the kinds they may have.
fn choices(annotation: &Annotation) -> Vec<(&Landmark, Option<CornerKind>)> {
    match &annotation.triangle {
        None => annotation.landmarks.iter().map(|landmark| (landmark, None)).collect(),
        Some(corners) => corners
            .iter()
            .filter_map(|corner| {
                let landmark = annotation.landmarks.iter().find(|landmark| landmark.name == corner.name)?;
                Some((landmark, corner.kind))
            })
            .collect(),
    }
}

/// The size of a triangle as large as what the possible corners span.
fn spread(annotation: &Annotation) -> f64 {
    let places: Vec<Vector3> = choices(annotation).iter().map(|(landmark, _)| landmark.place.coords).collect();
    let center = places.iter().sum::<Vector3>() / places.len().max(1) as f64;
    (3.0 * places.iter().map(|p| (p - center).norm_squared()).sum::<f64>() / places.len().max(1) as f64).sqrt()
}

fn check_on_surface(surface: &SampledSurface, annotation: &Annotation, size: f64) -> Result<(), StandardError> {
    for landmark in &annotation.landmarks {
        let reach = TUNING.on_surface * size;
        let samples = surface.sampled_around(&landmark.place, 2.0 * reach, 0.2 * reach);
        let distance = |p: &Point3| (p - landmark.place).norm();
        let nearest = samples.points.iter().map(distance).fold(f64::INFINITY, f64::min);
        if nearest > reach {
            // beyond the samples that were looked at, the points of the surface tell about how far
            let percent = 100.0 * surface.points().map(|p| distance(&p)).fold(nearest, f64::min) / size;
            return Err(StandardError::OffSurface { name: landmark.name.clone(), percent });
        }
    }
    Ok(())
}

/// How the operator sees the landmarks, in the file's frame and unit.
struct Sight {
    corners: Vec<Corner>,
    /// The length that curvature was measured at.
    expected: f64,
    sign: f64,
}

/// Looks at the landmarks at each scale; the scale that shows the most corners counts, of equals the first.
fn seen(
    surface: &SampledSurface,
    annotation: &Annotation,
    size: f64,
    sign: f64,
    progress: &Progress,
) -> Result<Sight, StandardError> {
    let choices = choices(annotation);
    let mut best: Option<Sight> = None;
    for factor in TUNING.feature_scales {
        progress.check()?;
        let expected = factor * INNER_EYE_DISTANCE_MM * size / FaceStandard::face_size();
        let spacing = spacing_of(expected);
        if surface.area() > MOST_SAMPLES as f64 * spacing * spacing {
            continue;
        }
        let corners = corners_at(&Level::new(&surface.sampled(spacing), expected), &choices, sign);
        // at a scale too coarse for them two landmarks may share one place
        let worth = |corners: &[Corner]| (!triangles(corners).is_empty(), corners.len());
        if best.as_ref().is_none_or(|best| worth(&corners) > worth(&best.corners)) {
            best = Some(Sight { corners, expected, sign });
        }
    }
    let sight = best.unwrap_or(Sight { corners: Vec::new(), expected: size, sign });
    let missing = choices.iter().filter(|(landmark, _)| !sight.corners.iter().any(|c| c.name == landmark.name));
    if sight.corners.len() >= 3 {
        return Ok(sight);
    }
    let wanted = missing.clone().find_map(|(_, kind)| *kind);
    Err(StandardError::NoCharacter { names: missing.map(|(landmark, _)| landmark.name.clone()).collect(), wanted })
}

/// The landmarks with a cap or pit of a kind they may have nearby: the nearest, of equals a cap.
fn corners_at(level: &Level, choices: &[(&Landmark, Option<CornerKind>)], sign: f64) -> Vec<Corner> {
    let places = level.places(&level.features(), sign);
    let corner = |(landmark, wanted): &(&Landmark, Option<CornerKind>)| {
        let kinds = [CornerKind::Cap, CornerKind::Pit].into_iter().filter(|kind| wanted.is_none_or(|w| w == *kind));
        let all = kinds.flat_map(|kind| kind.places(&places).iter().map(move |place| (kind, place)));
        let distance = |place: &Place| (place.point - landmark.place).norm();
        let near = all.filter(|(_, place)| distance(place) < TUNING.corner_reach * level.expected);
        let (kind, place) = near.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
        Some(Corner {
            name: landmark.name.clone(),
            kind,
            annotated: landmark.place,
            detected: place.point,
            normal: place.normal,
            strength: place.strength,
        })
    };
    choices.iter().filter_map(corner).collect()
}

/// Chooses triangles and region, and brings everything into the standard's frame.
fn finished(
    surface: &SampledSurface,
    annotation: &Annotation,
    unit: Unit,
    sight: Sight,
    diagonal: f64,
) -> Result<Standard, StandardError> {
    let triangles = triangles(&sight.corners);
    let size = triangles.first().ok_or(StandardError::InLine)?.detected().size();
    let scale = size / FaceStandard::face_size();
    let (points, normals) = region(surface, &triangles, size, sight.sign);
    if points.len() < TUNING.least_points {
        return Err(StandardError::TooSmallRegion { points: points.len() });
    }
    let origin = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3>() / points.len() as f64);
    let inside = |p: &Point3| Point3::from((p - origin) / scale);
    let moved = |triangle: SelectiveTriangle| SelectiveTriangle {
        corners: triangle.corners.map(|corner| Corner {
            annotated: inside(&corner.annotated),
            detected: inside(&corner.detected),
            ..corner
        }),
    };
    Ok(Standard {
        version: Standard::VERSION,
        unit,
        scale,
        origin,
        expected_mm: sight.expected / scale,
        share_of_diagonal: sight.expected / diagonal,
        triangles: triangles.into_iter().map(moved).collect(),
        landmarks: annotation.landmarks.iter().map(|l| (l.name.clone(), inside(&l.place))).collect(),
        points: points.iter().map(inside).collect(),
        normals,
    })
}

/// The triangles of the corners that are fat enough, the largest with the strongest corners first.
fn triangles(corners: &[Corner]) -> Vec<SelectiveTriangle> {
    let mut strongest: Vec<&Corner> = corners.iter().collect();
    strongest.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    strongest.truncate(TUNING.most_corners);
    // in the order in which they were named
    let kept: Vec<&Corner> = corners.iter().filter(|corner| strongest.iter().any(|s| s.name == corner.name)).collect();
    let mut found: Vec<(f64, SelectiveTriangle)> = faces::judgement::triples(&kept)
        .map(|corners| SelectiveTriangle { corners: corners.map(Corner::clone) })
        .filter(|triangle| triangle.fatness() >= TUNING.least_fatness)
        .map(|triangle| {
            let area = triangle.fatness() * triangle.detected().size().powi(2);
            let strength: f64 = triangle.corners.iter().map(|corner| corner.strength.min(3.0)).product();
            (area * strength, triangle)
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().take(TUNING.most_triangles).map(|(_, triangle)| triangle).collect()
}

/// Points of the surface around the corners with outward normals, spread as widely as any prefix of them can be.
fn region(
    surface: &SampledSurface,
    triangles: &[SelectiveTriangle],
    size: f64,
    sign: f64,
) -> (Vec<Point3>, Vec<Vector3>) {
    let corners: Vec<Point3> = triangles.iter().flat_map(|t| t.detected().corners).collect();
    let center = triangles.first().map_or(Point3::origin(), |t| Triangle::center(&t.detected()));
    let farthest = corners.iter().map(|c| (c - center).norm()).fold(0.0, f64::max);
    let reach = TUNING.region_reach * size;
    let samples =
        surface.sampled_around(&center, farthest + reach, TUNING.region_spacing_mm * size / FaceStandard::face_size());
    let is_near = |p: &Point3| corners.iter().any(|c| (p - c).norm() < reach);
    let kept = (0..samples.points.len()).filter(|&k| is_near(&samples.points[k]) && samples.normals[k].norm() > 0.5);
    let (points, normals): (Vec<Point3>, Vec<Vector3>) =
        kept.map(|k| (samples.points[k], samples.normals[k] * sign)).unzip();
    let places: Vec<Vector3> = points.iter().map(|p| p.coords).collect();
    let middle = places.iter().sum::<Vector3>() / places.len().max(1) as f64;
    let first = greatest(&places.iter().map(|p| (p - middle).norm_squared()).collect::<Vec<f64>>());
    farthest_first(&places, first, TUNING.region_points).into_iter().map(|k| (points[k], normals[k])).unzip()
}
