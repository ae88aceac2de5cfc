//! How far two surfaces are from each other, by samples.

use rayon::prelude::*;

use crate::nearest::TriangleTree;
use visage_geometry::{Mesh, Point3};

/// Samples spread over a surface.
const SAMPLES: usize = 100_000;

/// Distances in figures, in the unit of what was measured.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Distances {
    /// Mean.
    pub mean: f64,
    /// Root mean square.
    pub rms: f64,
    /// What 95 of 100 don't exceed.
    pub p95: f64,
    /// What 99 of 100 don't exceed.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

impl Distances {
    /// The figures of these distances, which need not be sorted. All are 0 if there are none.
    pub fn of(mut distances: Vec<f64>) -> Distances {
        distances.sort_unstable_by(f64::total_cmp);
        let count = distances.len().max(1) as f64;
        let rank = |share: f64| {
            let rank = (share * distances.len() as f64).ceil() as usize;
            distances.get(rank.max(1) - 1).copied().unwrap_or_default()
        };
        Distances {
            mean: distances.iter().sum::<f64>() / count,
            rms: (distances.iter().map(|d| d * d).sum::<f64>() / count).sqrt(),
            p95: rank(0.95),
            p99: rank(0.99),
            max: distances.last().copied().unwrap_or_default(),
        }
    }
}

impl Distances {
    /// The same in units of this length.
    pub fn in_units_of(&self, length: f64) -> Distances {
        let Distances { mean, rms, p95, p99, max } = self;
        let [mean, rms, p95, p99, max] = [mean, rms, p95, p99, max].map(|distance| distance / length);
        Distances { mean, rms, p95, p99, max }
    }
}

/// A mesh to which distances are measured again and again.
pub(crate) struct Original {
    samples: Vec<Point3>,
    tree: Option<TriangleTree>,
}

impl Original {
    pub(crate) fn new(mesh: &Mesh) -> Original {
        Original { samples: samples(mesh), tree: TriangleTree::new(mesh) }
    }

    /// From either to the other.
    pub(crate) fn distances(&self, other: &Mesh) -> Distances {
        let tree = TriangleTree::new(other);
        let of = |samples: &[Point3], tree: Option<&TriangleTree>| -> Vec<f64> {
            let Some(tree) = tree else { return Vec::new() };
            let distance = |sample: &Point3| tree.nearest(sample, f64::INFINITY).map(|found| found.distance2.sqrt());
            samples.par_iter().with_min_len(256).filter_map(distance).collect()
        };
        let mut all = of(&self.samples, tree.as_ref());
        all.extend(of(&samples(other), self.tree.as_ref()));
        Distances::of(all)
    }
}

/// How far two meshes are from each other, measured from either to the other.
pub fn between(a: &Mesh, b: &Mesh) -> Distances {
    Original::new(a).distances(b)
}

/// Places spread evenly over the area of a mesh, and vertices evenly chosen: what is farthest off is mostly one of these.
pub(crate) fn samples(mesh: &Mesh) -> Vec<Point3> {
    let areas: Vec<f64> = (0..mesh.faces.len()).into_par_iter().map(|face| mesh.area_normal(face).norm()).collect();
    let whole: f64 = areas.iter().sum();
    let stride = mesh.vertices.len().div_ceil(SAMPLES / 2).max(1);
    let mut found: Vec<Point3> = mesh.vertices.iter().copied().step_by(stride).collect();
    let step = whole / (SAMPLES / 2) as f64;
    if !(step > 0.0 && step.is_finite()) {
        return found;
    }
    let mut passed = 0.0;
    let mut next = 0.5 * step;
    for (face, area) in areas.iter().enumerate() {
        passed += area;
        while next < passed {
            // two additive sequences fill the square evenly (R2, after the plastic number)
            let k = found.len() as f64;
            let (mut u, mut v) = ((k * 0.754_877_666_246_692_7).fract(), (k * 0.569_840_290_998_053_3).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = mesh.corners(face);
            found.push(a + (b - a) * u + (c - a) * v);
            next += step;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64) -> Mesh {
        let corner = |x: f64, y: f64| Point3::new(x, y, z);
        Mesh {
            vertices: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
            faces: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn two_sheets_are_as_far_from_each_other_as_they_are() {
        let found = between(&square(0.0), &square(0.25));
        for figure in [found.mean, found.rms, found.p95, found.p99, found.max] {
            assert!((figure - 0.25).abs() < 1e-12, "{found:?}");
        }
        // half of a sheet is missing: what is there is near it, but not the other way round
        let half = Mesh { faces: vec![[0, 1, 2]], ..square(0.0) };
        let found = between(&square(0.0), &half);
        assert!((found.max - 0.5f64.sqrt()).abs() < 1e-9 && found.mean < 0.2, "{found:?}");
    }

    #[test]
    fn samples_are_spread_by_area() {
        let sampled = samples(&square(0.0));
        assert!((50_000..50_010).contains(&sampled.len()));
        let left = sampled.iter().filter(|place| place.x < 0.25 && place.y < 0.5).count() as f64 / sampled.len() as f64;
        assert!((left - 0.125).abs() < 0.005, "{left}");
        assert!(samples(&Mesh::default()).is_empty());
    }

    #[test]
    fn figures_are_those_of_the_distances() {
        let found = Distances::of((1..=100).rev().map(f64::from).collect());
        assert_eq!((found.mean, found.p95, found.p99, found.max), (50.5, 95.0, 99.0, 100.0));
        assert_eq!(Distances::of(Vec::new()), Distances::default());
    }
}
