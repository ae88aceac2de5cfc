//! Where a surface is an elliptic cap (a nose tip) or an elliptic pit (an inner eye corner), at one scale.

use rayon::prelude::*;

use crate::saliency::quadric::{Neighbours, QuadricFit, fitted_normal};
use crate::saliency::{CellGrid, Principal, Samples};
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::{Point3, Vector3, thinning};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Radius of the fit that finds noses, in expected inner-eye distances.
        nose_radius: f64 = 0.36,
        /// Radius of the fit that finds eye corners: they are smaller than noses.
        eye_radius: f64 = 0.27,
        /// Least neighbours of the fit for noses,
        nose_neighbours: u32 = 18,
        /// and of that for eye corners.
        eye_neighbours: u32 = 11,
        /// Curvature is fitted at one sample of each cube of so many sample spacings, about every third or fourth, and around
        /// what may be a corner at all of them: the fits overlap so much that it hardly changes from one to the next.
        fitted_cube_in_spacings: f64 = 1.9,
        /// A place is a candidate if nothing stronger lies within this radius, in expected inner-eye distances.
        suppression_radius: f64 = 0.3,
        /// A place is centred over its neighbours within this share of that radius.
        centering_share: f64 = 0.6,
        /// A nose is a cap with at least this smaller curvature times the expected inner-eye distance (noses: 2.5 to 5).
        least_cap: f64 = 0.6,
        /// An eye corner is a pit at least this deep (eye corners: 1 to 6).
        least_pit: f64 = 0.5,
        /// The most caps that may be noses,
        most_noses: usize = 20,
        /// and pits that may be eye corners.
        most_eyes: usize = 40,
    }
}

/// Curvatures of the samples at both radii, for normals as they are.
#[derive(Debug, Clone)]
pub struct Features {
    nose: Vec<Option<Principal>>,
    eye: Vec<Option<Principal>>,
}

/// A place that may be a corner of a facial triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Its position, in the file's frame and unit.
    pub point: Point3,
    /// Its outward normal.
    pub normal: Vector3,
    /// Curvature times the expected inner-eye distance: of a cap the smaller one, of a pit minus the larger.
    pub strength: f64,
}

/// The candidates of one scale level and one choice of the outer side.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Places {
    /// Elliptic caps, strongest first.
    pub caps: Vec<Place>,
    /// Elliptic pits, strongest first.
    pub pits: Vec<Place>,
}

/// Fits both quadrics where `keep` holds; `expected` is the expected inner-eye distance in the file's unit.
pub fn features_where(samples: &Samples, grid: &CellGrid, expected: f64, keep: impl Fn(&Point3) -> bool) -> Features {
    let [nose_radius, eye_radius] = [TUNING.nose_radius * expected, TUNING.eye_radius * expected];
    let mut fitted = spread_out(&samples.points, TUNING.fitted_cube_in_spacings * samples.spacing);
    fitted.retain(|&index| keep(&samples.points[index as usize]));
    let fits: Vec<_> = fitted
        .par_iter()
        .map(|&index| {
            let neighbours = Neighbours::around(samples, grid, index as usize, nose_radius);
            let [nose, eye] = [nose_radius, eye_radius].map(|radius| neighbours.fit(radius));
            (principal(&nose, TUNING.nose_neighbours), principal(&eye, TUNING.eye_neighbours))
        })
        .collect();
    let mut features = Features { nose: vec![None; samples.points.len()], eye: vec![None; samples.points.len()] };
    for (index, (nose, eye)) in fitted.into_iter().zip(fits) {
        features.nose[index as usize] = nose;
        features.eye[index as usize] = eye;
    }
    features
}

/// One point of each cube.
fn spread_out(points: &[Point3], edge: f64) -> Vec<u32> {
    let Some(first) = points.first() else { return Vec::new() };
    let local: Vec<LocalPoint> = points.iter().map(|p| (p - first).cast::<f32>().into()).collect();
    thinning::representatives(&local, edge as f32)
}

fn principal(fit: &QuadricFit, least_neighbours: u32) -> Option<Principal> {
    if fit.neighbours >= least_neighbours { fit.principal() } else { None }
}

/// The strongest caps and pits when normals are multiplied by `sign` (which swaps and negates curvatures).
pub fn places(samples: &Samples, grid: &CellGrid, features: &Features, expected: f64, sign: f64) -> Places {
    let nose = Kind {
        bulges: sign > 0.0,
        fit_radius: TUNING.nose_radius * expected,
        least_neighbours: TUNING.nose_neighbours,
        least_strength: TUNING.least_cap,
        most: TUNING.most_noses,
        expected,
    };
    let eye = Kind {
        bulges: sign < 0.0,
        fit_radius: TUNING.eye_radius * expected,
        least_neighbours: TUNING.eye_neighbours,
        least_strength: TUNING.least_pit,
        most: TUNING.most_eyes,
        expected,
    };
    let outward = |place: Place| Place { normal: place.normal * sign, ..place };
    let strongest = |kind: &Kind, fitted: &[Option<Principal>]| {
        kind.strongest(samples, grid, fitted).into_iter().map(outward).collect()
    };
    Places { caps: strongest(&nose, &features.nose), pits: strongest(&eye, &features.eye) }
}

/// What is looked for at one scale, for normals as they are.
struct Kind {
    /// Whether the surface bulges towards its normals there.
    bulges: bool,
    /// The radius of the fit that shows it, and that fit's least neighbours.
    fit_radius: f64,
    least_neighbours: u32,
    least_strength: f64,
    /// At most so many are kept.
    most: usize,
    /// The expected inner-eye distance.
    expected: f64,
}

impl Kind {
    /// Below every other where nothing was fitted.
    fn strength(&self, fitted: &Option<Principal>) -> f64 {
        let towards_normals = |c: &Principal| if self.bulges { c.k2 } else { -c.k1 };
        fitted.as_ref().map_or(f64::NEG_INFINITY, |c| towards_normals(c) * self.expected)
    }

    /// The places with nothing stronger within the suppression radius, the strongest fit first, ties by index.
    fn strongest(&self, samples: &Samples, grid: &CellGrid, fitted: &[Option<Principal>]) -> Vec<Place> {
        let strengths: Vec<f64> = fitted.iter().map(|fitted| self.strength(fitted)).collect();
        let mut order: Vec<usize> = (0..strengths.len()).filter(|&i| strengths[i] > self.least_strength).collect();
        order.sort_by(|&a, &b| strengths[b].total_cmp(&strengths[a]).then(a.cmp(&b)));
        let mut suppressed = vec![false; strengths.len()];
        let mut peaks = Vec::new();
        for index in order {
            if suppressed[index] {
                continue;
            }
            peaks.push(index);
            if peaks.len() == self.most {
                break;
            }
            let radius = TUNING.suppression_radius * self.expected;
            grid.for_each_within(&samples.points[index], radius, |other, _| suppressed[other] = true);
        }
        peaks.into_par_iter().map(|peak| self.place(samples, grid, &strengths, peak)).collect()
    }

    /// A peak as all the samples around it show it: their greatest strength, and their mean position, weighted by how far
    /// they rise above the half of that, which is steadier than the one that happens to be the strongest.
    fn place(&self, samples: &Samples, grid: &CellGrid, strengths: &[f64], peak: usize) -> Place {
        let center = samples.points[peak];
        let mut around = Vec::new();
        grid.for_each_within(
            &center,
            TUNING.centering_share * TUNING.suppression_radius * self.expected,
            |other, _| {
                let known = strengths[other].is_finite();
                around.push((other, if known { strengths[other] } else { self.strength_at(samples, grid, other) }));
            },
        );
        let strength = around.iter().map(|(_, strength)| *strength).fold(strengths[peak], f64::max);
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for (other, of_other) in around {
            let weight = (of_other - 0.5 * strength).max(0.0);
            sum += (samples.points[other] - center) * weight;
            weights += weight;
        }
        let point = if weights > 0.0 { center + sum / weights } else { center };
        Place { point, normal: fitted_normal(samples, grid, peak, self.fit_radius), strength }
    }

    fn strength_at(&self, samples: &Samples, grid: &CellGrid, index: usize) -> f64 {
        let fit = Neighbours::around(samples, grid, index, self.fit_radius).fit(self.fit_radius);
        self.strength(&principal(&fit, self.least_neighbours))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate with a hill at (-10, 0) and a hollow at (10, 0), both of curvature 0.2.
    fn plate() -> Samples {
        let height = |x: f64, y: f64| {
            let bump = |cx: f64| 2.5 * (-((x - cx).powi(2) + y * y) / 25.0).exp();
            bump(-10.0) - bump(10.0)
        };
        let points: Vec<Point3> = (0..61 * 41)
            .map(|k| (f64::from(k % 61) * 0.7 - 21.0, f64::from(k / 61) * 0.7 - 14.0))
            .map(|(x, y)| Point3::new(x, y, height(x, y)))
            .collect();
        Samples { normals: vec![Vector3::z(); points.len()], areas: vec![0.49; points.len()], points, spacing: 0.7 }
    }

    #[test]
    fn a_hill_is_a_cap_and_a_hollow_a_pit_and_the_other_way_round_inside_out() {
        let samples = plate();
        let grid = CellGrid::new(&samples.points, 1.4);
        let features = features_where(&samples, &grid, 7.0, |_| true);
        let upright = places(&samples, &grid, &features, 7.0, 1.0);
        assert!((upright.caps[0].point.x + 10.0).abs() < 0.5, "{:?}", upright.caps[0]);
        assert!((upright.pits[0].point.x - 10.0).abs() < 0.5, "{:?}", upright.pits[0]);
        assert!((upright.caps[0].strength / 7.0 - 0.2).abs() < 0.05);
        let inside_out = places(&samples, &grid, &features, 7.0, -1.0);
        assert!((inside_out.caps[0].point.x - 10.0).abs() < 0.5);
        assert!(inside_out.caps[0].normal.z < -0.9);
    }

    #[test]
    fn places_keep_their_distance() {
        let samples = plate();
        let grid = CellGrid::new(&samples.points, 1.4);
        let features = features_where(&samples, &grid, 7.0, |_| true);
        let caps = places(&samples, &grid, &features, 7.0, 1.0).caps;
        for (k, nose) in caps.iter().enumerate() {
            assert!(caps[k + 1..].iter().all(|other| (other.point - nose.point).norm() > 1.0));
        }
    }
}
