//! A surface with fewer triangles: edges become vertices, the one that costs least first (quadric error metric, Garland &
//! Heckbert 1997).
//!
//! 1. [`quadric`]: what a vertex may not leave: the planes of its triangles, as far as their normals are known
//! 2. [`fans`]: which triangles meet at a vertex
//! 3. [`collapse`]: edges go in the order of a [`queue`]; what stays as it is: the surface is no less one than before (link condition), no
//!    triangle turns over, rims stay where they are
//!
//! What it costs is measured afterwards, from either surface to the other.

mod collapse;
mod fans;
mod quadric;
mod queue;

use self::collapse::Collapser;
use crate::SurfaceMesh;
use crate::distance::{Distances, Original};
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The first try stays within this share of the error that is allowed: the largest distance is some three times the mean
        /// one by which edges are chosen.
        caution: f64 = 0.35,
        /// How often an error is measured to come near to the one that is allowed.
        tries: usize = 6,
        /// A surface whose error is within this share of the one that is allowed is as coarse as it can be.
        near: f64 = 0.85,
    }
}

/// How coarse a surface may become. What is given all holds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Target {
    /// No more triangles than this, if that is possible.
    pub triangles: Option<usize>,
    /// No place of either surface farther from the other than this, as far as it is measured; a length.
    pub max_error: Option<f64>,
}

impl Target {
    /// Whether anything is asked for.
    pub fn is_given(&self) -> bool {
        *self != Target::default()
    }
}

/// What became of a surface.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SimplifyReport {
    /// Triangles before.
    pub from_triangles: usize,
    /// Triangles after.
    pub triangles: usize,
    /// Vertices after.
    pub vertices: usize,
    /// How far both surfaces are from each other, by samples on either; lengths in the unit of the surface.
    pub error: Distances,
}

/// A surface with fewer triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Simplified {
    /// The surface.
    pub surface: SurfaceMesh,
    /// What it cost.
    pub report: SimplifyReport,
}

/// Makes a surface coarser, and measures what it costs.
///
/// The result is the same for any number of threads. Where the surface branches it is left as it is.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn simplify(surface: &SurfaceMesh, target: &Target, progress: &Progress) -> Result<Simplified, Canceled> {
    let original = Original::new(&surface.mesh);
    progress.check()?;
    let triangles = target.triangles.unwrap_or(0);
    let (made, error) = match target.max_error {
        None => {
            let mut collapser = Collapser::new(surface);
            let triangles = target.triangles.unwrap_or(usize::MAX);
            collapser.reduce(triangles, f64::INFINITY, progress)?;
            let made = collapser.surface();
            progress.check()?;
            let error = original.distances(&made.mesh);
            (made, error)
        }
        Some(allowed) => within(surface, triangles, allowed, &original, progress)?,
    };
    let report = SimplifyReport {
        from_triangles: surface.mesh.faces.len(),
        triangles: made.mesh.faces.len(),
        vertices: made.mesh.vertices.len(),
        error,
    };
    Ok(Simplified { surface: made, report })
}

/// The coarsest of a few tries whose error is allowed; the surface itself if none is.
fn within(
    surface: &SurfaceMesh,
    triangles: usize,
    allowed: f64,
    original: &Original,
    progress: &Progress,
) -> Result<(SurfaceMesh, Distances), Canceled> {
    let fresh = Collapser::new(surface);
    let mut best = (surface.clone(), Distances::default());
    let mut collapser = fresh.clone();
    // what was allowed and what was not
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut reach = TUNING.caution * allowed;
    for _ in 0..TUNING.tries {
        collapser.reduce(triangles, reach, progress)?;
        let made = collapser.surface();
        progress.check()?;
        let error = original.distances(&made.mesh);
        if error.max <= allowed {
            let is_fewer = made.mesh.faces.len() < best.0.mesh.faces.len();
            let is_done = made.mesh.faces.len() <= triangles || error.max >= TUNING.near * allowed;
            if is_fewer {
                best = (made, error);
            }
            if is_done {
                break;
            }
            low = reach;
            let further = reach * (allowed / error.max.max(f64::MIN_POSITIVE)).clamp(1.2, 2.0);
            reach = if further < high { further } else { (low + high) / 2.0 };
        } else {
            high = reach;
            // what went too far is begun anew
            collapser = fresh.clone();
            reach = if low > 0.0 { (low + high) / 2.0 } else { reach * (allowed / error.max).clamp(0.2, 0.8) };
        }
    }
    Ok(best)
}

/// The same surface at several numbers of triangles, given from many to few; no error is measured.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn levels(surface: &SurfaceMesh, triangles: &[usize], progress: &Progress) -> Result<Vec<SurfaceMesh>, Canceled> {
    let mut collapser = Collapser::new(surface);
    let level = |triangles: &usize| {
        collapser.reduce(*triangles, f64::INFINITY, progress)?;
        Ok(collapser.surface())
    };
    triangles.iter().map(level).collect()
}

#[cfg(test)]
mod tests;
