//! A cloud as a surface: a smooth patch around every point, so that it can be sampled at any spacing, however sparse
//! the points are.

use rayon::prelude::*;

use super::falloff::falloff;
use super::proximity::Proximity;
use super::quadric::{Neighbours, tangents};
use super::samples::{Cells, Samples};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Bounds, Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A patch reaches this far, in the spacing of the points around it: neighbours overlap and leave no gaps.
        reach_in_spacings: f64 = 1.1,
        /// No patch reaches farther than this many usual ones: sparse points must not close a hole.
        most_usual_reaches: f64 = 2.5,
        /// A patch is fitted to points within this many times the distance of the last neighbour.
        fit_radius: f64 = 1.25,
        /// With fewer neighbours on its side a patch is flat.
        least_neighbours: u32 = 9,
        /// Patches are sampled in steps of this share of a cell.
        step_in_cells: f64 = 0.6,
        /// Where the middle of the neighbours is off by this share of the last one's distance the point lies on a rim (the
        /// middle of a half disc: 0.42),
        rim_offset: f64 = 0.25,
        /// and its patch reaches only this share of its reach to the empty side.
        beyond_rim: f64 = 0.3,
        /// A patch may not rise higher than this share of the distance from its middle: it would say more than its points.
        steepest: f64 = 0.8,
    }
}

/// Patches over the points of a cloud with unit normals.
#[derive(Debug, Clone, Default)]
pub struct Patches {
    patches: Vec<Patch>,
}

/// `z = a x^2 + b x y + c y^2 + d x + e y + f` over the tangent plane of a point, lengths in units of `unit`.
#[derive(Debug, Clone, Copy)]
struct Patch {
    center: Point3,
    normal: Vector3,
    unit: f64,
    coefficients: [f64; 6],
    reach: f64,
    /// The unit direction away from a rim, in the tangent plane's coordinates; zero inside the surface.
    inward: [f64; 2],
}

impl Patches {
    /// A patch around each point; `proximity` is of the same points. Points without a normal get none.
    pub fn new(
        points: &[Point3],
        normals: &[Vector3],
        proximity: &Proximity,
        progress: &Progress,
    ) -> Result<Patches, Canceled> {
        let usual = TUNING.reach_in_spacings * proximity.usual_spacing();
        let patches = (0..points.len())
            .into_par_iter()
            .filter(|&index| normals[index] != Vector3::zeros())
            .map(|index| {
                progress.check()?;
                let reach =
                    (TUNING.reach_in_spacings * proximity.spacing(index)).min(TUNING.most_usual_reaches * usual);
                Ok(Patch::fitted(points, normals, proximity, index, reach))
            })
            .collect::<Result<_, Canceled>>()?;
        Ok(Patches { patches })
    }

    /// The points that carry a patch.
    pub fn centers(&self) -> impl Iterator<Item = Point3> + '_ {
        self.patches.iter().map(|patch| patch.center)
    }

    /// About the area of the surface: neighbours' patches overlap by as much as their reach says.
    pub fn area(&self) -> f64 {
        self.patches.iter().map(|patch| (patch.reach / TUNING.reach_in_spacings).powi(2)).sum()
    }

    /// One sample for each cell of edge `spacing` that the patches around points that `keep` takes pass through.
    /// Every sample stands for the same area, since the density of a cloud tells of the scanner and not of the surface.
    pub fn sampled(&self, spacing: f64, keep: impl Fn(&Point3) -> bool) -> Samples {
        let kept = || self.patches.iter().filter(|patch| keep(&patch.center));
        let most = kept().map(|patch| patch.reach).fold(0.0, f64::max);
        let centers: Vec<Point3> = kept().map(|patch| patch.center).collect();
        let around = Bounds::of(&centers).map(|b| Bounds { min: b.min - Vector3::repeat(most), max: b.max });
        let mut cells = Cells::new(spacing, around);
        for patch in kept() {
            patch.add_to(&mut cells, TUNING.step_in_cells * spacing);
        }
        let mut samples = cells.finish();
        samples.areas.fill(spacing * spacing);
        samples
    }
}

impl Patch {
    fn fitted(points: &[Point3], normals: &[Vector3], proximity: &Proximity, index: usize, reach: f64) -> Patch {
        let (center, normal) = (points[index], normals[index]);
        let unit = (TUNING.fit_radius * proximity.farthest(index)).max(f64::MIN_POSITIVE);
        let [tangent_x, tangent_y] = tangents(&normal);
        let mut neighbours = Neighbours::new(unit);
        let mut middle = [0.0; 2];
        for other in proximity.of(index) {
            if normals[other].dot(&normal) > 0.0 {
                let offset = points[other] - center;
                let (x, y, z) = (offset.dot(&tangent_x), offset.dot(&tangent_y), offset.dot(&normal));
                neighbours.push(x, y, z, offset.norm_squared());
                middle = [middle[0] + x, middle[1] + y];
            }
        }
        let fit = neighbours.fit(unit);
        let off = middle[0].hypot(middle[1]);
        let on_rim = off > TUNING.rim_offset * proximity.farthest(index) * f64::from(fit.neighbours);
        let inward = if on_rim { middle.map(|m| m / off) } else { [0.0; 2] };
        let fitted = if fit.neighbours >= TUNING.least_neighbours { fit.coefficients() } else { None };
        Patch { center, normal, unit, coefficients: fitted.unwrap_or_default(), reach, inward }
    }

    /// Adds points of the patch, `step` apart; those far from the middle count less.
    fn add_to(&self, cells: &mut Cells, step: f64) {
        let [tangent_x, tangent_y] = tangents(&self.normal);
        let steps = (self.reach / step) as i32;
        // a patch smaller than a step is one point of its area
        let area = if steps == 0 { self.reach * self.reach } else { step * step };
        for row in -steps..=steps {
            for column in -steps..=steps {
                let (x, y) = (f64::from(column) * step, f64::from(row) * step);
                let distance2 = x * x + y * y;
                let inward = x * self.inward[0] + y * self.inward[1];
                if distance2 > self.reach * self.reach || inward < -TUNING.beyond_rim * self.reach {
                    continue;
                }
                let [height, slope_x, slope_y] = self.height(x, y);
                if height.abs() > TUNING.steepest * distance2.sqrt().max(0.5 * self.reach) {
                    continue;
                }
                let point = self.center + tangent_x * x + tangent_y * y + self.normal * height;
                let normal = (self.normal - tangent_x * slope_x - tangent_y * slope_y).normalize();
                cells.add(&point, &normal, area * falloff(2.0 * distance2 / (self.reach * self.reach)));
            }
        }
    }

    /// The height above (x, y) of the tangent plane and its slopes.
    fn height(&self, x: f64, y: f64) -> [f64; 3] {
        let ([a, b, c, d, e, f], x, y) = (self.coefficients, x / self.unit, y / self.unit);
        let height = (a * x + b * y + d) * x + (c * y + e) * y + f;
        [height * self.unit, 2.0 * a * x + b * y + d, 2.0 * c * y + b * x + e]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::curvature::tests::sphere;

    fn patches(points: &[Point3], normals: &[Vector3]) -> Patches {
        let silent = Progress::silent();
        let proximity = Proximity::new(points, &silent).expect("not canceled");
        Patches::new(points, normals, &proximity, &silent).expect("not canceled")
    }

    #[test]
    fn a_sparse_sphere_is_filled_to_any_spacing() {
        let points = sphere(1.0, 3).vertices; // some 0.22 apart
        let normals: Vec<Vector3> = points.iter().map(|p| p.coords).collect();
        let patches = patches(&points, &normals);
        let samples = patches.sampled(0.05, |_| true);
        let expected = 4.0 * std::f64::consts::PI / (0.05 * 0.05);
        assert!(samples.points.len() as f64 > expected, "{} samples, no gaps", samples.points.len());
        for (point, normal) in samples.points.iter().zip(&samples.normals) {
            assert!((point.coords.norm() - 1.0).abs() < 0.01, "{point}");
            assert!(point.coords.normalize().dot(normal) > 0.99);
        }
    }

    #[test]
    fn dense_points_keep_their_place_and_rims_hardly_grow() {
        let points: Vec<Point3> =
            (0..40 * 40).map(|k| Point3::new(f64::from(k % 40) * 0.1, f64::from(k / 40) * 0.1, 0.0)).collect();
        let normals = vec![Vector3::z(); points.len()];
        let samples = patches(&points, &normals).sampled(0.5, |p| p.x < 2.0);
        let reach = 2.0 + TUNING.reach_in_spacings * 0.1 * 1.6;
        assert!(samples.points.iter().all(|p| p.z.abs() < 1e-9 && p.x > -0.2 && p.x < reach));
        assert!((30..=55).contains(&samples.points.len()), "{}", samples.points.len());
    }

    #[test]
    fn points_without_normals_have_no_patch() {
        let points = vec![Point3::origin(); 5];
        let patches = patches(&points, &[Vector3::zeros(); 5]);
        assert!(patches.sampled(1.0, |_| true).points.is_empty());
    }
}
