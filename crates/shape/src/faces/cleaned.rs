//! A model or probe before it is described: without points that are none, and without what lies far off.
//!
//! One speck in the air would blow up the box that every length is a share of.

use rayon::prelude::*;

use crate::saliency::Samples;
use visage_geometry::cleaning::support_plane::{self, Support};
use visage_geometry::cleaning::{CoarseScan, outliers};
use visage_geometry::coincidence::Coincidence;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals::plane_through;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::viewpoint::{self, Facets};
use visage_geometry::{Bounds, Mesh, Point3, Surface, Vector3};

/// What a description does without.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct LeftOut {
    /// Points where nothing was seen.
    pub no_return: usize,
    /// Points that repeat another one.
    pub repeated: usize,
    /// Points far from the rest.
    pub strays: usize,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A search for strays takes away what hides others: so often at most.
        searches: usize = 4,
        /// The bulk is without this share of the points at each end of each axis.
        ends: f64 = 0.01,
        /// Where the box around all points is no larger than so many times that of the bulk nothing is far off. (Between the
        /// ends of a box lie some 2 % of what fills it evenly.)
        bulky: f64 = 1.25,
        /// Points that tell the bulk,
        samples: usize = 20_000,
        /// and those that tell the spacing.
        spacings: usize = 300,
        /// At least this share of a surface is kept, or all of it is.
        least_rest: f64 = 0.5,
        /// Samples that stand for a mesh.
        surfels: f64 = 2500.0,
        /// Points that a sample's surroundings are made of.
        neighbours: usize = 12,
    }
}

/// The surface without what is none of it, and what that was.
pub fn cleaned(surface: &Surface, progress: &Progress) -> Result<(Surface, LeftOut), Canceled> {
    let mut left_out = LeftOut::default();
    let mut surface = if surface.faces.is_empty() {
        let found = Coincidence::of(surface);
        (left_out.no_return, left_out.repeated) = (found.no_return, found.repeated);
        found.applied(surface.clone())
    } else {
        welded(surface, &mut left_out)
    };
    for _ in 0..TUNING.searches {
        progress.check()?;
        let Some(kept) = without_strays(&surface) else { break };
        left_out.strays += kept.iter().filter(|kept| !**kept).count();
        surface = surface.kept(&kept);
    }
    if let Some(told) = surface.sensor.filter(|told| *told != Point3::origin() && surface.cloud.normals.is_none()) {
        progress.check()?;
        let middle = surface.cloud.centroid().coords;
        let indexed = IndexedPoints::new(local(&every_so_many(&surface.cloud.points), &middle));
        if viewpoint::are_poses([(&Facets::of(&indexed, &middle), told)]) {
            surface.sensor = Some(Point3::origin());
        }
    }
    Ok((surface, left_out))
}

/// A mesh with one vertex a place, without vertices that no face has.
fn welded(surface: &Surface, left_out: &mut LeftOut) -> Surface {
    let mut surface = surface.clone();
    let firsts = visage_geometry::coincidence::first_copies(&surface.cloud.points);
    if let Some(firsts) = firsts {
        surface.faces.iter_mut().flatten().for_each(|vertex| *vertex = firsts[*vertex as usize]);
    }
    let mut is_used = vec![false; surface.cloud.len()];
    surface.faces.iter().flatten().for_each(|vertex| is_used[*vertex as usize] = true);
    let unused = is_used.iter().filter(|used| !**used).count();
    if unused == 0 {
        return surface;
    }
    left_out.repeated += unused;
    surface.kept(&is_used)
}

/// For each point whether it stays; `None` if all do.
fn without_strays(surface: &Surface) -> Option<Vec<bool>> {
    let points = &surface.cloud.points;
    let bounds = surface.cloud.bounds()?;
    let bulk = bulk(points)?;
    if bounds.diagonal() <= TUNING.bulky * bulk.diagonal() {
        return None;
    }
    let middle = bulk.center().coords;
    let kept = match surface.mesh() {
        None => {
            let points = local(points, &middle);
            let coarse = coarse_scans(&points);
            let body = outliers::main_body(&coarse, &(0..coarse.count()).collect::<Vec<_>>())?;
            points.par_iter().map(|p| body.reaches(p)).collect::<Vec<bool>>()
        }
        Some(mesh) => {
            let coarse = survey_of_mesh(&mesh, &middle)?;
            let body = outliers::main_body(&coarse, &(0..coarse.count()).collect::<Vec<_>>())?;
            let reached: Vec<bool> = local(points, &middle).par_iter().map(|p| body.reaches(p)).collect();
            let mut kept = vec![false; points.len()];
            for face in surface.faces.iter().filter(|face| face.iter().any(|v| reached[*v as usize])) {
                face.iter().for_each(|v| kept[*v as usize] = true);
            }
            kept
        }
    };
    let rest = kept.iter().filter(|kept| **kept).count();
    (rest < kept.len() && rest as f64 >= TUNING.least_rest * kept.len() as f64).then_some(kept)
}

/// The box around most of the points.
fn bulk(points: &[Point3]) -> Option<Bounds> {
    let mut sampled = every_so_many(points);
    let end = (TUNING.ends * sampled.len() as f64) as usize;
    let last = sampled.len().checked_sub(1 + end)?;
    let mut bulk = Bounds { min: Point3::origin(), max: Point3::origin() };
    for axis in 0..3 {
        bulk.min[axis] = sampled.select_nth_unstable_by(end, |a, b| a[axis].total_cmp(&b[axis])).1[axis];
        bulk.max[axis] = sampled.select_nth_unstable_by(last, |a, b| a[axis].total_cmp(&b[axis])).1[axis];
    }
    Some(bulk)
}

fn every_so_many(points: &[Point3]) -> Vec<Point3> {
    points.iter().step_by(points.len().div_ceil(TUNING.samples).max(1)).copied().collect()
}

fn local(points: &[Point3], middle: &Vector3) -> Vec<LocalPoint> {
    points.iter().map(|p| (p.coords - middle).cast::<f32>().into()).collect()
}

/// A cloud in a few thousand surfels.
fn coarse_scans(points: &[LocalPoint]) -> CoarseScan {
    let (indexed, spacing, noise) = measured(points);
    // what was measured on some of the points of a surface
    let share = (indexed.points.len() as f64 / points.len().max(1) as f64).sqrt();
    CoarseScan::new(points, spacing * share, noise)
}

/// Some of the points with their median spacing and the median residual of planes through neighbours.
fn measured(points: &[LocalPoint]) -> (IndexedPoints, f64, f64) {
    let step = points.len().div_ceil(TUNING.samples).max(1);
    let indexed = IndexedPoints::new(points.iter().step_by(step).copied().collect());
    let (mut found, mut spacings, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
    for sample in indexed.points.iter().step_by(indexed.points.len().div_ceil(TUNING.spacings).max(1)) {
        indexed.tree.k_nearest(sample, TUNING.neighbours, f32::INFINITY, &mut found);
        spacings.extend(found.iter().map(|n| n.distance2).find(|d| *d > 0.0));
        residuals.push(plane_through(&indexed.points, &found).rms);
    }
    let median = |values: &mut Vec<f32>| {
        let middle = values.len() / 2;
        if values.is_empty() { 0.0 } else { f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1) }
    };
    let (spacing2, noise) = (median(&mut spacings), median(&mut residuals));
    (indexed, spacing2.sqrt(), noise)
}

/// A mesh in a few thousand surfels, by area; `None` if it has none.
fn survey_of_mesh(mesh: &Mesh, middle: &Vector3) -> Option<CoarseScan> {
    let area: f64 = (0..mesh.faces.len()).map(|face| 0.5 * mesh.area_normal(face).norm()).sum();
    let edge = (area / TUNING.surfels).sqrt();
    if !(edge.is_normal() && edge.is_finite()) {
        return None;
    }
    let samples = Samples::from_mesh(mesh, edge);
    // a surfel of a full cell counts a hundred
    let counts = samples.areas.iter().map(|a| (100.0 * a / (edge * edge)).clamp(1.0, 1e6) as u32).collect();
    let normals = samples.normals.clone();
    Some(CoarseScan {
        points: local(&samples.points, middle),
        normals,
        counts,
        edge,
        spacing: edge,
        range_accuracy: 0.0,
    })
}

/// The surface without the planes that its object stands on or before, if there are any.
pub(super) fn without_supports(surface: &Surface, progress: &Progress) -> Result<Option<Surface>, Canceled> {
    let Some(bounds) = surface.cloud.bounds() else { return Ok(None) };
    let middle = bounds.center().coords;
    let points = local(&surface.cloud.points, &middle);
    let coarse = match surface.mesh() {
        Some(mesh) => survey_of_mesh(&mesh, &middle),
        None => {
            let coarse = coarse_scans(&points);
            progress.check()?;
            let step = points.len().div_ceil(10 * TUNING.samples).max(1);
            Some(coarse.with_normals(&IndexedPoints::new(points.iter().step_by(step).copied().collect())))
        }
    };
    let Some(coarse) = coarse else { return Ok(None) };
    progress.check()?;
    let candidates = support_plane::bounding_planes(&coarse, None);
    let supports = support_plane::supports(&coarse, &candidates, support_plane::AROUND, support_plane::MOST);
    progress.check()?;
    if supports.is_empty() {
        return Ok(None);
    }
    let is_supporting =
        |p: &LocalPoint| supports.iter().any(|plane: &Support| plane.holds(&nalgebra::Vector3::from(*p).cast::<f64>()));
    let kept: Vec<bool> = points.par_iter().map(|p| !is_supporting(p)).collect();
    Ok(Some(surface.kept(&kept)))
}
