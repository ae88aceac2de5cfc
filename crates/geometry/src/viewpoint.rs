//! Whether a scan can have been seen from a place: rays leave a scanner evenly spread, so its points lie the less
//! densely the farther off a surface is and the more it is turned away.
//!
//! Files say where their scanner stood in different ways. PCD's VIEWPOINT is that place in the frame of the points by
//! its definition, but many programs write the pose of a scan there, whose points are in the scanner's own frame.

use rayon::prelude::*;

use super::neighbours::IndexedPoints;
use super::normals::{self, plane_through};
use super::{Point3, Vector3};

/// Pieces of a scan at which density is measured.
const SAMPLES: usize = 400;
/// So many nearest points tell the density.
const NEIGHBOURS: usize = 16;
/// Surfaces at a smaller cosine than this were hardly seen.
const GRAZING: f64 = 0.15;
/// A place explains a scan better than another if what it leaves unexplained is less by this (natural logarithm of the
/// density; counting 16 neighbours leaves about 0.2).
const CLEARLY: f64 = 0.08;

/// Pieces of a scan's surface.
#[derive(Debug, Clone, Default)]
pub struct Facets(Vec<Facet>);

#[derive(Debug, Clone, Copy)]
struct Facet {
    place: Vector3,
    normal: Vector3,
    /// The logarithm of the points for a unit of area, but for a constant.
    density: f64,
}

impl Facets {
    /// Of points that lie about `center`.
    pub fn of(indexed: &IndexedPoints, center: &Vector3) -> Self {
        let step = indexed.points.len().div_ceil(SAMPLES).max(1);
        let samples: Vec<_> = indexed.points.iter().step_by(step).copied().collect();
        let facet = |found: &mut Vec<_>, sample: &[f32; 3]| {
            indexed.tree.k_nearest(sample, NEIGHBOURS, f32::INFINITY, found);
            let farthest2 = f64::from(found.last()?.distance2);
            let plane = plane_through(&indexed.points, &found[..found.len().min(normals::NEIGHBOURS)]);
            let normal = nalgebra::Vector3::from(plane.normal).cast::<f64>();
            let place = nalgebra::Vector3::from(*sample).cast::<f64>() + center;
            let is_sound = farthest2.is_normal() && normal != Vector3::zeros();
            is_sound.then(|| Facet { place, normal, density: -farthest2.ln() })
        };
        let found: Vec<Option<Facet>> = samples.par_iter().map_init(Vec::new, facet).collect();
        Facets(found.into_iter().flatten().collect())
    }

    /// What a scanner at a place leaves unexplained: the mean absolute difference of the densities' logarithms. A
    /// surface that is hardly seen from there counts as seen at a grazing angle. Infinite without facets.
    pub fn unexplained(&self, position: &Point3) -> f64 {
        let left = |facet: &Facet| {
            let ray = position.coords - facet.place;
            let distance = ray.norm().max(f64::MIN_POSITIVE);
            let cosine = (facet.normal.dot(&ray) / distance).abs().max(GRAZING);
            facet.density - (cosine.ln() - 2.0 * distance.ln())
        };
        let mut left: Vec<f64> = self.0.iter().map(left).collect();
        if left.is_empty() {
            return f64::INFINITY;
        }
        let middle = left.len() / 2;
        let usual = *left.select_nth_unstable_by(middle, f64::total_cmp).1;
        left.iter().map(|x| (x - usual).abs()).sum::<f64>() / left.len() as f64
    }
}

/// Whether scans with these places of their scanners, as told, were seen from the origins of their frames instead. One
/// program wrote them all, so all are asked together.
pub fn are_poses<'a>(scans: impl IntoIterator<Item = (&'a Facets, Point3)>) -> bool {
    let (mut told, mut origin, mut count) = (0.0, 0.0, 0.0);
    for (facets, position) in scans {
        if position != Point3::origin() && !facets.0.is_empty() {
            told += facets.unexplained(&position);
            origin += facets.unexplained(&Point3::origin());
            count += 1.0;
        }
    }
    count > 0.0 && origin + CLEARLY * count < told
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bowl 500 before the origin, seen from there on a grid of rays.
    fn seen() -> Facets {
        let steps = || (-40..=40).map(|k| 0.004 * f64::from(k));
        let hit = |x: f64, y: f64| Vector3::new(x, y, 1.0) * (500.0 + 900.0 * (x * x + 2.0 * y * y + 0.1 * x));
        let points: Vec<Vector3> = steps().flat_map(|x| steps().map(move |y| hit(x, y))).collect();
        let center = points.iter().sum::<Vector3>() / points.len() as f64;
        let local = points.iter().map(|p| (p - center).cast::<f32>().into()).collect();
        Facets::of(&IndexedPoints::new(local), &center)
    }

    #[test]
    fn the_place_it_was_seen_from_explains_a_scan_best() {
        let facets = seen();
        for told in [[0.0, 0.0, 1000.0], [500.0, 0.0, 500.0], [0.0, 0.0, 430.0], [3000.0, 1000.0, -200.0]] {
            let told = Point3::from(told);
            assert!(facets.unexplained(&Point3::origin()) < facets.unexplained(&told), "{told}");
            assert!(are_poses([(&facets, told)]), "{told}");
        }
    }

    #[test]
    fn what_is_told_stands_where_nothing_speaks_clearly_against_it() {
        let facets = seen();
        assert!(!are_poses([(&facets, Point3::new(0.0, 0.0, 10.0))]), "nearly right");
        assert!(!are_poses([(&facets, Point3::origin())]));
        assert!(!are_poses([(&Facets::default(), Point3::new(1.0, 2.0, 3.0))]));
    }
}
