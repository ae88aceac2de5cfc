//! How far a surface is from another one, where scans are near.

use anyhow::Context;
use rayon::prelude::*;

use visage::geometry::neighbours::{IndexedPoints, LocalPoint};
use visage::geometry::{Cloud, Mesh, Point3, Vector3};
use visage::surface::nearest::TriangleTree;

/// Samples spread over a surface.
const SAMPLES: usize = 200_000;
/// Samples farther than this from every point don't count, in spacings.
const NEAR: f64 = 3.0;

/// Each as median and what 95 of 100 don't exceed; lengths in spacings.
pub struct Truth {
    /// From the surface to the truth.
    pub accuracy: [f64; 2],
    /// From the truth to the surface.
    pub completeness: [f64; 2],
    /// Between the normals of both, degrees.
    pub normals_deg: [f64; 2],
}

impl Truth {
    pub fn of(mesh: &Mesh, truth: &Mesh, cloud: &Cloud, spacing: f64) -> anyhow::Result<Truth> {
        let near = Near::new(cloud);
        let within = |place: &Point3| near.holds(place, NEAR * spacing);
        let of_truth = TriangleTree::new(truth).context("the truth has no triangles")?;
        let (mut accuracy, mut normals): (Vec<f64>, Vec<f64>) = samples(mesh)
            .par_iter()
            .filter(|(place, _)| within(place))
            .filter_map(|(place, normal)| {
                let found = of_truth.nearest(place, f64::INFINITY)?;
                let cosine = truth.area_normal(found.face as usize).normalize().dot(normal);
                Some((found.distance2.sqrt() / spacing, cosine.clamp(-1.0, 1.0).acos().to_degrees()))
            })
            .unzip();
        let of_mesh = TriangleTree::new(mesh).context("the surface has no triangles")?;
        let mut completeness: Vec<f64> = samples(truth)
            .par_iter()
            .filter(|(place, _)| within(place))
            .filter_map(|(place, _)| Some(of_mesh.nearest(place, f64::INFINITY)?.distance2.sqrt() / spacing))
            .collect();
        let figures = |of: &mut [f64]| [0.5, 0.95].map(|share| quantile(of, share));
        Ok(Truth {
            accuracy: figures(&mut accuracy),
            completeness: figures(&mut completeness),
            normals_deg: figures(&mut normals),
        })
    }
}

/// The points that something may be near to, about their middle.
struct Near {
    middle: Vector3,
    indexed: IndexedPoints,
}

impl Near {
    fn new(cloud: &Cloud) -> Near {
        let middle = cloud.bounds().map_or_else(Vector3::zeros, |bounds| bounds.center().coords);
        let local = |point: &Point3| -> LocalPoint { (point.coords - middle).cast::<f32>().into() };
        Near { middle, indexed: IndexedPoints::new(cloud.points.iter().map(local).collect()) }
    }

    fn holds(&self, place: &Point3, within: f64) -> bool {
        let local = (place.coords - self.middle).cast::<f32>().into();
        self.indexed.tree.has_within(&local, (within * within) as f32)
    }
}

/// The share of a surface's area that is farther than `within` from every point.
pub fn far_area(mesh: &Mesh, cloud: &Cloud, within: f64) -> f64 {
    let (near, samples) = (Near::new(cloud), samples(mesh));
    let far = samples.par_iter().filter(|(place, _)| !near.holds(place, within)).count();
    far as f64 / samples.len().max(1) as f64
}

/// What a share of values doesn't exceed; they are sorted. NaN of none.
pub fn quantile(of: &mut [f64], share: f64) -> f64 {
    of.sort_unstable_by(f64::total_cmp);
    of.get((share * of.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

/// Places spread evenly over the area of a mesh, with the unit normals of their triangles.
fn samples(mesh: &Mesh) -> Vec<(Point3, Vector3)> {
    let normals: Vec<Vector3> = (0..mesh.faces.len()).map(|face| mesh.area_normal(face)).collect();
    let step = normals.iter().map(|normal| normal.norm()).sum::<f64>() / SAMPLES as f64;
    let (mut found, mut passed) = (Vec::with_capacity(SAMPLES), -0.5 * step);
    for (face, normal) in normals.iter().enumerate() {
        passed += normal.norm();
        while passed >= 0.0 && step > 0.0 {
            // two additive sequences fill the square evenly (R2, after the plastic number)
            let k = found.len() as f64;
            let (mut u, mut v) = ((k * 0.754_877_666_246_692_7).fract(), (k * 0.569_840_290_998_053_3).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = mesh.corners(face);
            found.push((a + (b - a) * u + (c - a) * v, normal.normalize()));
            passed -= step;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_above_a_plate_is_as_far_off_as_it_is() {
        let plate = |z: f64| Mesh {
            vertices: [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)].map(|(x, y)| Point3::new(x, y, z)).to_vec(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
        };
        // points near the left third alone
        let cloud = Cloud::from_points((0..27).map(|k| Point3::new(f64::from(k % 3), f64::from(k / 3), 0.5)).collect());
        let found = Truth::of(&plate(0.5), &plate(0.0), &cloud, 1.0).expect("triangles");
        assert_eq!((found.accuracy, found.completeness, found.normals_deg), ([0.5; 2], [0.5; 2], [0.0; 2]));
        let far = far_area(&plate(0.5), &cloud, 1.0);
        assert!((far - 6.0 / 9.0).abs() < 0.02, "{far}");
    }
}
