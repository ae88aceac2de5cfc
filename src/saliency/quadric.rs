//! Curvature without a mesh: a weighted quadric fitted to the neighbours in the tangent frame.

use rayon::prelude::*;

use super::cells::{CellGrid, neighbour_radius};
use super::falloff::falloff_lane;
use super::samples::Samples;
use crate::geometry::Vector3;

/// The least radius of the fit for plain mean curvature, in sample spacings: some 50 neighbours.
const FIT_RADIUS_IN_SPACINGS: f64 = 4.0;
/// Where the points are sparser than their cells, the radius grows until this many neighbours are usual.
const USUAL_NEIGHBOURS: usize = 24;
/// With fewer neighbours than this the six coefficients are guesswork.
const LEAST_NEIGHBOURS: u32 = 10;

/// The least share of a diagonal entry that may be left to a pivot; sums in f32 leave some 1e-6 of nothing.
const LEAST_PIVOT: f64 = 1e-5;

/// Principal curvatures, one over length; convex positive, `k1 >= k2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Principal {
    /// The larger one.
    pub k1: f64,
    /// The smaller one.
    pub k2: f64,
}

/// The normal equations of `z = a x^2 + b x y + c y^2 + d x + e y + f`, gathered as moments.
#[derive(Debug, Clone, Copy)]
pub struct QuadricFit {
    /// The length that the moments count as 1.
    unit: f64,
    /// One over the squared radius, in units.
    per_radius2: f32,
    /// Number of neighbours.
    pub neighbours: u32,
    /// Sums of `w x^i y^j` in the order of [`QuadricFit::coefficients`], lane by lane.
    moments: [Lanes; 15],
    /// Sums of `w z` times x^2, xy, y^2, x, y, 1.
    right: [Lanes; 6],
}

impl QuadricFit {
    /// An empty fit whose weights fall as `exp(-2 (d/radius)^2)`.
    pub fn new(radius: f64) -> QuadricFit {
        QuadricFit::in_units(radius, radius)
    }

    fn in_units(radius: f64, unit: f64) -> QuadricFit {
        let per_radius2 = ((unit / radius) * (unit / radius)) as f32;
        QuadricFit { unit, per_radius2, neighbours: 0, moments: [[0.0; LANES]; 15], right: [[0.0; LANES]; 6] }
    }

    /// Adds a neighbour at `(x, y)` in the tangent plane and height `z`, `distance2` from the centre: none beyond the
    /// radius counts.
    pub fn add(&mut self, x: f64, y: f64, z: f64, distance2: f64) {
        let mut gathered = Gathered::new(self.unit);
        gathered.push([x, y, z, distance2], std::slice::from_mut(self));
        gathered.flush(std::slice::from_mut(self));
    }

    /// Adds [`LANES`] neighbours.
    #[inline]
    fn add_lanes(&mut self, terms: &Terms) {
        // plain loops over lanes, without a branch, become vector instructions
        let mut w = [0.0; LANES];
        for (w, distance2) in w.iter_mut().zip(&terms.distance2) {
            let share = distance2 * self.per_radius2;
            let weight = falloff_lane(2.0 * share);
            *w = if share < 1.0 { weight } else { 0.0 };
        }
        for distance2 in &terms.distance2 {
            self.neighbours += u32::from(distance2 * self.per_radius2 < 1.0);
        }
        for (sum, term) in self.moments.iter_mut().zip(&terms.monomials) {
            add_product(sum, &w, term);
        }
        for (sum, term) in self.right.iter_mut().zip(&terms.heights) {
            add_product(sum, &w, term);
        }
    }

    /// The coefficients a to f, for lengths in units of the radius given to [`QuadricFit::new`]; `None` if the neighbours don't determine them.
    pub fn coefficients(&self) -> Option<[f64; 6]> {
        let sum = |lanes: &Lanes| lanes.iter().map(|lane| f64::from(*lane)).sum::<f64>();
        let [x4, x3y, x2y2, xy3, y4, x3, x2y, xy2, y3, x2, xy, y2, x, y, one] = self.moments.each_ref().map(sum);
        let right = self.right.each_ref().map(sum);
        let matrix = nalgebra::Matrix6::new(
            x4, x3y, x2y2, x3, x2y, x2, x3y, x2y2, xy3, x2y, xy2, xy, x2y2, xy3, y4, xy2, y3, y2, x3, x2y, xy2, x2, xy,
            x, x2y, xy2, y3, xy, y2, y, x2, xy, y2, x, y, one,
        );
        let factor = matrix.cholesky()?;
        // what is left of a diagonal entry when the others are taken out: only rounding, if they determine it
        let left = |k: usize| factor.l_dirty()[(k, k)].powi(2) > LEAST_PIVOT * matrix[(k, k)];
        if !(0..6).all(left) {
            return None;
        }
        let solution = factor.solve(&nalgebra::Vector6::from(right));
        Some(solution.data.0[0])
    }

    /// The slope (dz/dx, dz/dy) of the fitted surface above the centre; `None` as for [`QuadricFit::principal`].
    pub fn slope(&self) -> Option<[f64; 2]> {
        self.coefficients().map(|[_, _, _, d, e, _]| [d, e])
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

#[inline(always)]
fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut product = *a;
    for lane in 0..LANES {
        product[lane] *= b[lane];
    }
    product
}

#[inline(always)]
fn add_product(sum: &mut Lanes, a: &Lanes, b: &Lanes) {
    for lane in 0..LANES {
        sum[lane] += a[lane] * b[lane];
    }
}

/// Two unit vectors that span the plane across `normal`.
pub fn tangents(normal: &Vector3) -> [Vector3; 2] {
    let across = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let first = normal.cross(&across).normalize();
    [first, normal.cross(&first)]
}

/// Fits quadrics of several radii (the first being the largest) around sample `index`.
/// Neighbours whose normals look the other way belong to another sheet and are left out.
pub fn fit_around<const N: usize>(
    samples: &Samples,
    grid: &CellGrid,
    index: usize,
    radii: [f64; N],
) -> [QuadricFit; N] {
    let (center, normal) = (samples.points[index], samples.normals[index]);
    let [tangent_x, tangent_y] = tangents(&normal);
    let mut gathered = Gathered::new(radii[0]);
    let mut fits = radii.map(|radius| QuadricFit::in_units(radius, radii[0]));
    grid.for_each_within(&center, radii[0], |neighbour, distance2| {
        if samples.normals[neighbour].dot(&normal) <= 0.0 {
            return;
        }
        let offset = samples.points[neighbour] - center;
        gathered.push([offset.dot(&tangent_x), offset.dot(&tangent_y), offset.dot(&normal), distance2], &mut fits);
    });
    gathered.flush(&mut fits);
    fits
}

/// Neighbours on their way into fits, a few at a time: the compiler turns sums over lanes into vector instructions,
/// and f32 is exact enough for lengths in units of the radius.
struct Gathered {
    per_unit: f64,
    /// x, y, z and the squared distance of each, in units.
    lanes: [Lanes; 4],
    count: usize,
}

/// What [`LANES`] neighbours add to any fit, but for its weights.
struct Terms {
    monomials: [Lanes; 15],
    heights: [Lanes; 6],
    distance2: Lanes,
}

const LANES: usize = 4;
type Lanes = [f32; LANES];

impl Gathered {
    fn new(unit: f64) -> Gathered {
        Gathered { per_unit: 1.0 / unit, lanes: [[0.0; LANES]; 4], count: 0 }
    }

    #[inline]
    fn push(&mut self, [x, y, z, distance2]: [f64; 4], fits: &mut [QuadricFit]) {
        let scale = self.per_unit;
        let values = [x * scale, y * scale, z * scale, distance2 * scale * scale];
        for (lanes, value) in self.lanes.iter_mut().zip(values) {
            lanes[self.count] = value as f32;
        }
        self.count += 1;
        if self.count == LANES {
            self.flush(fits);
        }
    }

    /// Adds what is left; empty lanes lie beyond every radius.
    #[inline]
    fn flush(&mut self, fits: &mut [QuadricFit]) {
        for lane in self.count..LANES {
            self.lanes[3][lane] = f32::INFINITY;
        }
        if self.count > 0 {
            let terms = self.terms();
            for fit in fits {
                fit.add_lanes(&terms);
            }
        }
        self.count = 0;
    }

    #[inline(always)]
    fn terms(&self) -> Terms {
        let [x, y, z, distance2] = self.lanes;
        let (xx, xy, yy) = (product(&x, &x), product(&x, &y), product(&y, &y));
        let monomials = [
            product(&xx, &xx),
            product(&xx, &xy),
            product(&xx, &yy),
            product(&yy, &xy),
            product(&yy, &yy),
            product(&xx, &x),
            product(&xx, &y),
            product(&yy, &x),
            product(&yy, &y),
            xx,
            xy,
            yy,
            x,
            y,
            [1.0; LANES],
        ];
        let heights = [product(&xx, &z), product(&xy, &z), product(&yy, &z), product(&x, &z), product(&y, &z), z];
        Terms { monomials, heights, distance2 }
    }
}

/// The normal of the surface fitted around sample `index`: smoother than the sample's own.
pub fn fitted_normal(samples: &Samples, grid: &CellGrid, index: usize, radius: f64) -> Vector3 {
    let normal = samples.normals[index];
    let [fit] = fit_around(samples, grid, index, [radius]);
    let Some([slope_x, slope_y]) = fit.slope() else {
        return normal;
    };
    let [tangent_x, tangent_y] = tangents(&normal);
    (normal - tangent_x * slope_x - tangent_y * slope_y).normalize()
}

/// Mean curvature at every sample; 0 where too few neighbours are.
pub fn mean_curvatures(samples: &Samples) -> Vec<f64> {
    let radius = neighbour_radius(&samples.points, FIT_RADIUS_IN_SPACINGS * samples.spacing, USUAL_NEIGHBOURS);
    let grid = CellGrid::new(&samples.points, 0.5 * radius);
    (0..samples.points.len())
        .into_par_iter()
        .map(|index| {
            let [fit] = fit_around(samples, &grid, index, [radius]);
            let curvature = if fit.neighbours >= LEAST_NEIGHBOURS { fit.principal() } else { None };
            curvature.map_or(0.0, |c| 0.5 * (c.k1 + c.k2))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;
    use crate::geometry::Point3;

    #[test]
    fn the_quadric_of_a_saddle_is_found_exactly() {
        let mut fit = QuadricFit::new(1.5);
        for i in -3..=3 {
            for j in -3..=3 {
                let (x, y) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
                fit.add(x, y, -0.5 * x * x + 0.25 * y * y, x * x + y * y);
            }
        }
        let curvature = fit.principal().expect("49 neighbours determine a quadric");
        assert!((curvature.k1 - 1.0).abs() < 1e-4 && (curvature.k2 + 0.5).abs() < 1e-4, "{curvature:?}");
    }

    #[test]
    fn neighbours_on_a_line_determine_nothing() {
        let mut fit = QuadricFit::new(1.0);
        for i in 0..20 {
            fit.add(f64::from(i) * 0.05, 0.0, 0.0, 0.0);
        }
        assert_eq!(fit.principal(), None);
    }

    #[test]
    fn a_sampled_sphere_is_round() {
        let mesh = sphere(2.0, 5);
        let samples = Samples::from_cloud(&mesh.vertices, &mesh.vertex_normals(), 0.15);
        let curvatures = mean_curvatures(&samples);
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
