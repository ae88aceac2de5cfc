//! Where a surface is an elliptic cap (a nose tip) or an elliptic pit (an inner eye corner), at one scale.

use rayon::prelude::*;

use crate::geometry::{Point3, Vector3};
use crate::saliency::quadric::{QuadricFit, fit_around, fitted_normal};
use crate::saliency::{CellGrid, Principal, Samples};

/// Radius of the fit that finds noses, in expected inner-eye distances.
const NOSE_RADIUS: f64 = 0.36;
/// Radius of the fit that finds eye corners: they are smaller than noses.
const EYE_RADIUS: f64 = 0.27;
/// Least neighbours of either fit.
const NOSE_NEIGHBOURS: u32 = 18;
const EYE_NEIGHBOURS: u32 = 11;
/// Curvature is fitted at every third sample: the fits overlap so much that it hardly changes from one to the next.
const EVERY: usize = 3;
/// A place is a candidate if nothing stronger lies within this radius, in expected inner-eye distances.
const SUPPRESSION_RADIUS: f64 = 0.3;
/// A place is centred over its neighbours within this share of that radius.
const CENTERING_SHARE: f64 = 0.6;
/// A nose is a cap with at least this smaller curvature times the expected inner-eye distance (noses: 2.5 to 5).
const LEAST_CAP: f64 = 0.6;
/// An eye corner is a pit at least this deep (eye corners: 1 to 6).
const LEAST_PIT: f64 = 0.5;
/// The most candidates of either kind.
const MOST_NOSES: usize = 20;
const MOST_EYES: usize = 40;

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
    pub noses: Vec<Place>,
    /// Elliptic pits, strongest first.
    pub eyes: Vec<Place>,
}

/// Fits both quadrics everywhere; `expected` is the expected inner-eye distance in the file's unit.
pub fn features(samples: &Samples, grid: &CellGrid, expected: f64) -> Features {
    let radii = [NOSE_RADIUS * expected, EYE_RADIUS * expected];
    let fits: Vec<_> = (0..samples.points.len())
        .into_par_iter()
        .map(|index| {
            if index % EVERY != 0 {
                return (None, None);
            }
            let [nose, eye] = fit_around(samples, grid, index, radii);
            let enough = |fit: &QuadricFit, least| {
                if fit.neighbours >= least { fit.principal() } else { None }
            };
            (enough(&nose, NOSE_NEIGHBOURS), enough(&eye, EYE_NEIGHBOURS))
        })
        .collect();
    let (nose, eye) = fits.into_iter().unzip();
    Features { nose, eye }
}

/// One kind of place: where its strength is above `least`, at most `most` of them.
struct Kind<'a> {
    strengths: &'a [f64],
    least: f64,
    most: usize,
    /// The radius of the fit that found it, for its normal.
    fit_radius: f64,
}

/// The strongest caps and pits when normals are multiplied by `sign` (which swaps and negates curvatures).
pub fn places(samples: &Samples, grid: &CellGrid, features: &Features, expected: f64, sign: f64) -> Places {
    let strengths = |curvatures: &[Option<Principal>], of: &dyn Fn(&Principal) -> f64| -> Vec<f64> {
        curvatures.iter().map(|c| c.as_ref().map_or(f64::NEG_INFINITY, |c| of(c) * expected)).collect()
    };
    let caps = strengths(&features.nose, &|c| if sign > 0.0 { c.k2 } else { -c.k1 });
    let pits = strengths(&features.eye, &|c| if sign > 0.0 { -c.k1 } else { c.k2 });
    let noses = Kind { strengths: &caps, least: LEAST_CAP, most: MOST_NOSES, fit_radius: NOSE_RADIUS * expected };
    let eyes = Kind { strengths: &pits, least: LEAST_PIT, most: MOST_EYES, fit_radius: EYE_RADIUS * expected };
    let radius = SUPPRESSION_RADIUS * expected;
    Places {
        noses: strongest(samples, grid, &noses, radius, sign),
        eyes: strongest(samples, grid, &eyes, radius, sign),
    }
}

/// The places of a kind with nothing stronger within `radius`, strongest first, ties by index.
fn strongest(samples: &Samples, grid: &CellGrid, kind: &Kind, radius: f64, sign: f64) -> Vec<Place> {
    let strengths = kind.strengths;
    let mut order: Vec<usize> = (0..strengths.len()).filter(|&i| strengths[i] > kind.least).collect();
    order.sort_by(|&a, &b| strengths[b].total_cmp(&strengths[a]).then(a.cmp(&b)));
    let mut suppressed = vec![false; strengths.len()];
    let mut kept = Vec::new();
    for index in order {
        if suppressed[index] {
            continue;
        }
        let normal = fitted_normal(samples, grid, index, kind.fit_radius) * sign;
        let point = peak_center(samples, grid, strengths, index, CENTERING_SHARE * radius);
        kept.push(Place { point, normal, strength: strengths[index] });
        if kept.len() == kind.most {
            break;
        }
        grid.for_each_within(&samples.points[index], radius, |other, _| suppressed[other] = true);
    }
    kept
}

/// The mean position of the samples around a peak, weighted by how far they rise above the half of it: steadier
/// than the one sample that happens to be the strongest.
fn peak_center(samples: &Samples, grid: &CellGrid, strengths: &[f64], peak: usize, radius: f64) -> Point3 {
    let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
    grid.for_each_within(&samples.points[peak], radius, |other, _| {
        let weight = (strengths[other] - 0.5 * strengths[peak]).max(0.0);
        sum += (samples.points[other] - samples.points[peak]) * weight;
        weights += weight;
    });
    if weights > 0.0 { samples.points[peak] + sum / weights } else { samples.points[peak] }
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
        let features = features(&samples, &grid, 7.0);
        let upright = places(&samples, &grid, &features, 7.0, 1.0);
        assert!((upright.noses[0].point.x + 10.0).abs() < 0.5, "{:?}", upright.noses[0]);
        assert!((upright.eyes[0].point.x - 10.0).abs() < 0.5, "{:?}", upright.eyes[0]);
        assert!((upright.noses[0].strength / 7.0 - 0.2).abs() < 0.05);
        let inside_out = places(&samples, &grid, &features, 7.0, -1.0);
        assert!((inside_out.noses[0].point.x - 10.0).abs() < 0.5);
        assert!(inside_out.noses[0].normal.z < -0.9);
    }

    #[test]
    fn places_keep_their_distance() {
        let samples = plate();
        let grid = CellGrid::new(&samples.points, 1.4);
        let features = features(&samples, &grid, 7.0);
        let noses = places(&samples, &grid, &features, 7.0, 1.0).noses;
        for (k, nose) in noses.iter().enumerate() {
            assert!(noses[k + 1..].iter().all(|other| (other.point - nose.point).norm() > 1.0));
        }
    }
}
