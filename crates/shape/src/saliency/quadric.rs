//! Curvature without a mesh: a weighted quadric fitted to the neighbours in the tangent frame.

use rayon::prelude::*;
use wide::f32x4;

use super::cells::{CellGrid, neighbour_radius};
use super::falloff::falloff_lanes;
use super::samples::Samples;
use visage_geometry::Vector3;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The least radius of the fit for plain mean curvature, in sample spacings: some 50 neighbours.
        fit_radius_in_spacings: f64 = 4.0,
        /// Where the points are sparser than their cells, the radius grows until this many neighbours are usual.
        usual_neighbours: usize = 24,
        /// With fewer neighbours than this the six coefficients are guesswork.
        least_neighbours: u32 = 10,
        /// The least share of a diagonal entry that may be left to a pivot; sums in f32 leave some 1e-6 of nothing.
        least_pivot: f64 = 1e-5,
        /// The usual number of blocks.
        usual_blocks: usize = 20,
    }
}

/// Principal curvatures, one over length; convex positive, `k1 >= k2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Principal {
    /// The larger one.
    pub k1: f64,
    /// The smaller one.
    pub k2: f64,
}

/// The normal equations of `z = a x^2 + b x y + c y^2 + d x + e y + f`, as moments.
#[derive(Debug, Clone, Copy)]
pub struct QuadricFit {
    /// The length that the moments count as 1.
    unit: f64,
    /// Number of neighbours.
    pub neighbours: u32,
    /// Sums of `w x^i y^j`, from x^4 down to 1.
    moments: [f64; 15],
    /// Sums of `w z` times x^2, xy, y^2, x, y, 1.
    right: [f64; 6],
}

impl QuadricFit {
    /// The coefficients a to f, for lengths in units of [`Neighbours::new`]'s; `None` if the neighbours don't determine them.
    pub fn coefficients(&self) -> Option<[f64; 6]> {
        let [x4, x3y, x2y2, xy3, y4, x3, x2y, xy2, y3, x2, xy, y2, x, y, one] = self.moments;
        let matrix = nalgebra::Matrix6::new(
            x4, x3y, x2y2, x3, x2y, x2, x3y, x2y2, xy3, x2y, xy2, xy, x2y2, xy3, y4, xy2, y3, y2, x3, x2y, xy2, x2, xy,
            x, x2y, xy2, y3, xy, y2, y, x2, xy, y2, x, y, one,
        );
        let factor = matrix.cholesky()?;
        // what is left of a diagonal entry when the others are taken out: only rounding, if they determine it
        let left = |k: usize| factor.l_dirty()[(k, k)].powi(2) > TUNING.least_pivot * matrix[(k, k)];
        if !(0..6).all(left) {
            return None;
        }
        let solution = factor.solve(&nalgebra::Vector6::from(self.right));
        Some(solution.data.0[0])
    }

    /// The curvatures of the fitted surface above the centre; `None` if the neighbours don't determine it.
    pub fn principal(&self) -> Option<Principal> {
        let [a, b, c, d, e, _] = self.coefficients()?;
        let g = 1.0 + d * d + e * e;
        let gauss = (4.0 * a * c - b * b) / (g * g);
        let mean = -((1.0 + e * e) * 2.0 * a - 2.0 * d * e * b + (1.0 + d * d) * 2.0 * c) / (2.0 * g.powf(1.5));
        let spread = (mean * mean - gauss).max(0.0).sqrt();
        let curvatures = Principal { k1: (mean + spread) / self.unit, k2: (mean - spread) / self.unit };
        (curvatures.k1.is_finite() && curvatures.k2.is_finite()).then_some(curvatures)
    }
}

/// Two unit vectors that span the plane across `normal`.
pub fn tangents(normal: &Vector3) -> [Vector3; 2] {
    let across = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let first = normal.cross(&across).normalize();
    [first, normal.cross(&first)]
}

/// The points around a centre, in a frame with the tangent plane as x and y; fits of several radii share them.
///
/// They are kept as f32, exact enough for lengths in units of the radius, four side by side for vector instructions.
#[derive(Debug, Clone)]
pub struct Neighbours {
    unit: f64,
    per_unit: f64,
    count: usize,
    /// x, y, z and the squared distance of four neighbours, in units; lanes left over lie beyond every radius.
    blocks: Vec<[f32x4; 4]>,
}

const LANES: usize = 4;

impl Neighbours {
    /// None yet; `unit` is the greatest radius that they will be fitted with.
    pub fn new(unit: f64) -> Neighbours {
        Neighbours { unit, per_unit: 1.0 / unit, count: 0, blocks: Vec::with_capacity(TUNING.usual_blocks) }
    }

    /// The neighbours of sample `index` within `radius`. Those whose normals look the other way belong to another sheet and
    /// are left out.
    pub fn around(samples: &Samples, grid: &CellGrid, index: usize, radius: f64) -> Neighbours {
        let (center, normal) = (samples.points[index], samples.normals[index]);
        let [tangent_x, tangent_y] = tangents(&normal);
        let mut neighbours = Neighbours::new(radius);
        grid.for_each_within(&center, radius, |other, distance2| {
            if samples.normals[other].dot(&normal) > 0.0 {
                let offset = samples.points[other] - center;
                neighbours.push(offset.dot(&tangent_x), offset.dot(&tangent_y), offset.dot(&normal), distance2);
            }
        });
        neighbours
    }

    /// Adds one at `(x, y)` in the tangent plane and height `z`, `distance2` from the centre.
    #[inline]
    pub fn push(&mut self, x: f64, y: f64, z: f64, distance2: f64) {
        let lane = self.count % LANES;
        if lane == 0 {
            let [nowhere, beyond] = [f32x4::ZERO, f32x4::splat(f32::INFINITY)];
            self.blocks.push([nowhere, nowhere, nowhere, beyond]);
        }
        let scale = self.per_unit;
        let values = [x * scale, y * scale, z * scale, distance2 * scale * scale];
        if let Some(block) = self.blocks.last_mut() {
            for (lanes, value) in block.iter_mut().zip(values) {
                lanes.as_mut_array()[lane] = value as f32;
            }
        }
        self.count += 1;
    }

    /// The fit to those nearer than `radius`, with weights that fall as `exp(-2 (d / radius)^2)`.
    pub fn fit(&self, radius: f64) -> QuadricFit {
        let per_radius2 = f32x4::splat(((self.unit / radius) * (self.unit / radius)) as f32);
        let one = f32x4::ONE;
        let mut count = f32x4::ZERO;
        let (mut moments, mut right) = ([f32x4::ZERO; 15], [f32x4::ZERO; 6]);
        for &[x, y, z, distance2] in &self.blocks {
            let share = distance2 * per_radius2;
            let is_near = share.simd_lt(one);
            count += is_near & one;
            let w = is_near & falloff_lanes(share + share);
            let (wx, wy) = (w * x, w * y);
            let (wxx, wxy, wyy) = (wx * x, wx * y, wy * y);
            let (wxxx, wxxy, wxyy, wyyy) = (wxx * x, wxx * y, wyy * x, wyy * y);
            let terms =
                [wxxx * x, wxxx * y, wxxy * y, wyyy * x, wyyy * y, wxxx, wxxy, wxyy, wyyy, wxx, wxy, wyy, wx, wy, w];
            moments.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            let heights = [wxx * z, wxy * z, wyy * z, wx * z, wy * z, w * z];
            right.iter_mut().zip(heights).for_each(|(sum, term)| *sum += term);
        }
        let sum = |lanes: f32x4| lanes.to_array().into_iter().map(f64::from).sum::<f64>();
        QuadricFit { unit: self.unit, neighbours: sum(count) as u32, moments: moments.map(sum), right: right.map(sum) }
    }
}

/// The normal of the surface fitted around sample `index`: smoother than the sample's own.
pub fn fitted_normal(samples: &Samples, grid: &CellGrid, index: usize, radius: f64) -> Vector3 {
    let normal = samples.normals[index];
    let fit = Neighbours::around(samples, grid, index, radius).fit(radius);
    let Some([_, _, _, slope_x, slope_y, _]) = fit.coefficients() else {
        return normal;
    };
    let [tangent_x, tangent_y] = tangents(&normal);
    (normal - tangent_x * slope_x - tangent_y * slope_y).normalize()
}

/// Mean curvature at every sample; 0 where too few neighbours are.
pub fn mean_curvatures(samples: &Samples, progress: &Progress) -> Result<Vec<f64>, Canceled> {
    let radius =
        neighbour_radius(&samples.points, TUNING.fit_radius_in_spacings * samples.spacing, TUNING.usual_neighbours);
    let grid = CellGrid::new(&samples.points, 0.5 * radius);
    (0..samples.points.len())
        .into_par_iter()
        .map(|index| {
            progress.check()?;
            let fit = Neighbours::around(samples, &grid, index, radius).fit(radius);
            let curvature = if fit.neighbours >= TUNING.least_neighbours { fit.principal() } else { None };
            Ok(curvature.map_or(0.0, |c| 0.5 * (c.k1 + c.k2)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;
    use visage_geometry::Point3;

    #[test]
    fn the_quadric_of_a_saddle_is_found_exactly() {
        let mut neighbours = Neighbours::new(1.5);
        for i in -3..=3 {
            for j in -3..=3 {
                let (x, y) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
                neighbours.push(x, y, -0.5 * x * x + 0.25 * y * y, x * x + y * y);
            }
        }
        let curvature = neighbours.fit(1.5).principal().expect("49 neighbours determine a quadric");
        assert!((curvature.k1 - 1.0).abs() < 1e-4 && (curvature.k2 + 0.5).abs() < 1e-4, "{curvature:?}");
    }

    #[test]
    fn neighbours_on_a_line_determine_nothing() {
        let mut neighbours = Neighbours::new(1.0);
        for i in 0..20 {
            neighbours.push(f64::from(i) * 0.05, 0.0, 0.0, 0.0);
        }
        assert_eq!(neighbours.fit(1.0).principal(), None);
    }

    #[test]
    fn a_sampled_sphere_is_round() {
        let mesh = sphere(2.0, 5);
        let samples = Samples::from_cloud(&mesh.vertices, &mesh.vertex_normals(), 0.15);
        let curvatures = mean_curvatures(&samples, &Progress::silent()).expect("not canceled");
        let mean = curvatures.iter().sum::<f64>() / curvatures.len() as f64;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert!(curvatures.iter().all(|l| (l - 0.5).abs() < 0.1));
    }

    #[test]
    fn tangents_span_the_plane() {
        for normal in [Vector3::x(), -Vector3::y(), Vector3::new(0.5, 0.5, 0.5).normalize()] {
            let [a, b] = tangents(&normal);
            assert!((a.cross(&b) - normal).norm() < 1e-12);
        }
        assert_eq!(Point3::origin().coords, Vector3::zeros());
    }
}
