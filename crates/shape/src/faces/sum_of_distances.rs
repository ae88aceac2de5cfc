//! The paper's alignment of a test triangle with the standard one, taken at its word: centres together, normals
//! together, then the turn and scale that make the total vertex distance least. Its Table 3 lists that total.

use nalgebra::Complex;

use super::triangle::Triangle;
use visage_geometry::Vector3;

/// The least sum of the three corner distances (not squared) with centres and planes together, over in-plane
/// turn and scale. In the standard's unit.
///
/// With corners as complex numbers p_i and q_i about their centres, turn and scale are one factor z, and
/// `sum |z p_i - q_i| = sum |p_i| |z - q_i / p_i|`: the weighted Fermat point of three points, a convex problem.
/// The result lies between sqrt 2 and sqrt 3 times the least-squares error of [`super::Shape`].
pub fn sum_of_distances(test: &Triangle, outward: &Vector3, standard: &Triangle, standard_outward: &Vector3) -> f64 {
    let p = test.in_plane(&test.normal(outward));
    let q = standard.in_plane(&standard.normal(standard_outward));
    let largest = p.iter().map(|p| p.norm()).fold(0.0, f64::max);
    if largest <= 0.0 {
        return q.iter().map(|q| q.norm()).sum();
    }
    let total = |z: Complex<f64>| p.iter().zip(&q).map(|(p, q)| (z * p - q).norm()).sum::<f64>();
    // a corner in the centre is not moved by any z: it has no place and no weight
    let places: Vec<(Complex<f64>, f64)> =
        p.iter().zip(&q).filter(|(p, _)| p.norm() > 1e-12 * largest).map(|(p, q)| (q / p, p.norm())).collect();
    total(fermat_point(&places))
}

/// The point with the least weighted sum of distances to `places`: one of them if its weight outweighs the pull
/// of the others, else by Weiszfeld's iteration with a Newton finish.
fn fermat_point(places: &[(Complex<f64>, f64)]) -> Complex<f64> {
    for (k, &(place, weight)) in places.iter().enumerate() {
        let pull: Complex<f64> = places
            .iter()
            .enumerate()
            .filter(|(other, (point, _))| *other != k && *point != place)
            .map(|(_, (point, weight))| (point - place).unscale((point - place).norm()).scale(*weight))
            .sum();
        let own: f64 = places.iter().filter(|(point, _)| *point == place).map(|(_, weight)| weight).sum();
        if pull.norm() <= own.max(weight) {
            return place;
        }
    }
    let weights: f64 = places.iter().map(|(_, w)| w).sum();
    let mut z = places.iter().map(|(p, w)| p.scale(*w)).sum::<Complex<f64>>().unscale(weights);
    for _ in 0..200 {
        let step = newton_step(places, z).unwrap_or_else(|| weiszfeld_step(places, z));
        z += step;
        if step.norm() <= 1e-15 * z.norm() {
            break;
        }
    }
    z
}

fn weighted_sum(places: &[(Complex<f64>, f64)], z: Complex<f64>) -> f64 {
    places.iter().map(|(p, w)| w * (z - p).norm()).sum()
}

fn weiszfeld_step(places: &[(Complex<f64>, f64)], z: Complex<f64>) -> Complex<f64> {
    let (mut sum, mut weights) = (Complex::new(0.0, 0.0), 0.0);
    for (place, weight) in places {
        let share = weight / (place - z).norm().max(1e-300);
        sum += place.scale(share);
        weights += share;
    }
    sum.unscale(weights) - z
}

/// Newton's step on the convex sum, if it goes down.
fn newton_step(places: &[(Complex<f64>, f64)], z: Complex<f64>) -> Option<Complex<f64>> {
    let mut gradient = nalgebra::Vector2::zeros();
    let mut hessian = nalgebra::Matrix2::zeros();
    for (place, weight) in places {
        let offset = nalgebra::Vector2::new(z.re - place.re, z.im - place.im);
        let distance = offset.norm();
        if distance <= 0.0 {
            return None;
        }
        let direction = offset / distance;
        gradient += direction * *weight;
        hessian += (nalgebra::Matrix2::identity() - direction * direction.transpose()) * (weight / distance);
    }
    let step = hessian.cholesky()?.solve(&gradient);
    let step = Complex::new(-step.x, -step.y);
    (weighted_sum(places, z + step) <= weighted_sum(places, z)).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::super::triangle::tests::triangle;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_turn_and_scale_nearby_is_better(a in prop::array::uniform9(-1.0..1.0f64), b in prop::array::uniform9(-1.0..1.0f64)) {
            let (test, standard) = (triangle(a), triangle(b));
            let up = Vector3::z();
            prop_assume!(test.shape(&up).0.z.abs() > 1e-3 && standard.shape(&up).0.z.abs() > 1e-3);
            let least = sum_of_distances(&test, &up, &standard, &up);
            let p = test.in_plane(&test.normal(&up));
            let q = standard.in_plane(&standard.normal(&up));
            // a grid over all turns and the scales from 0 to twice the ratio of sizes
            let ratio = standard.size() / test.size();
            let mut best = f64::INFINITY;
            for turn in 0..360 {
                for scale in 0..80 {
                    let z = Complex::from_polar(ratio * f64::from(scale) / 40.0, f64::from(turn).to_radians());
                    best = best.min(p.iter().zip(&q).map(|(p, q)| (z * p - q).norm()).sum());
                }
            }
            prop_assert!(least <= best + 1e-9, "{least} {best}");
            prop_assert!(least >= best - 0.1 * standard.size(), "{least} {best}");
        }

        #[test]
        fn it_lies_between_the_bounds_of_the_least_squares_error(a in prop::array::uniform9(-1.0..1.0f64), b in prop::array::uniform9(-1.0..1.0f64)) {
            let (test, standard) = (triangle(a), triangle(b));
            let up = Vector3::z();
            prop_assume!(test.size() > 0.3 && standard.size() > 0.3);
            let error = test.shape(&up).matching_error(&standard.shape(&up), standard.size());
            let sum = sum_of_distances(&test, &up, &standard, &up);
            prop_assert!(sum >= 2f64.sqrt() * error - 1e-9 && sum <= 3f64.sqrt() * error + 1e-9, "{sum} {error}");
        }
    }

    #[test]
    fn similar_triangles_match_without_error() {
        let standard = triangle([0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 1.0, 3.0, 0.0]);
        let test = triangle([0.0, 0.0, 0.0, 0.0, 2.0, 0.0, -1.5, 0.5, 0.0]);
        assert!(sum_of_distances(&test, &Vector3::z(), &standard, &Vector3::z()) < 1e-12);
    }

    #[test]
    fn a_point_for_a_triangle_costs_the_whole_standard() {
        let standard = triangle([-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((sum_of_distances(&triangle([1.0; 9]), &Vector3::z(), &standard, &Vector3::z()) - 2.0).abs() < 1e-12);
    }
}
