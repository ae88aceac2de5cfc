//! How pairs of a surface's samples lie to each other, whatever its frame.
//!
//! After the surflet pairs of Wahl, Hillenbrand and Hirzinger 2003 and the shape distributions of Osada et al. 2002, without sides:
//! pairs are counted by their distance, by how far their surfaces face along it, and by how far their normals agree.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::area_samples::AreaSamples;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Pairs drawn: drawing again changes a histogram by a fiftieth of what tells things apart.
        pairs: usize = 40_000,
        /// Distances up to this many root mean square radii have classes of their own.
        farthest: f64 = 3.0,
    }
}

/// Classes of distance; a pair counts in the two nearest.
const DISTANCES: usize = 12;
/// Classes of either cosine: none, some, full.
const COSINES: usize = 3;
/// Classes.
pub(super) const CLASSES: usize = DISTANCES * COSINES * COSINES;

/// The square roots of the shares of pairs by class: their distances are Hellinger's.
pub(super) fn histogram(samples: &AreaSamples) -> [f32; CLASSES] {
    let count = samples.points.len();
    let radius = (samples.points.iter().map(|p| p.norm_squared()).sum::<f64>() / count as f64).sqrt();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut counts = [0.0; CLASSES];
    for _ in 0..TUNING.pairs {
        let (a, b) = (rng.random_range(0..count), rng.random_range(0..count));
        let offset = samples.points[b] - samples.points[a];
        let Some(direction) = offset.try_normalize(1e-9) else { continue };
        let [normal_a, normal_b] = [&samples.normals[a], &samples.normals[b]];
        let facing = third(0.5 * (normal_a.dot(&direction).abs() + normal_b.dot(&direction).abs()));
        let agreement = third(normal_a.dot(normal_b).abs());
        let place = offset.norm() / radius / TUNING.farthest * DISTANCES as f64 - 0.5;
        let place = place.clamp(0.0, (DISTANCES - 1) as f64);
        let (below, share) = (place as usize, place.fract());
        let class = |distance: usize| (distance * COSINES + facing) * COSINES + agreement;
        counts[class(below)] += 1.0 - share;
        counts[class((below + 1).min(DISTANCES - 1))] += share;
    }
    let total = counts.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    counts.map(|count| (count / total).sqrt() as f32)
}

fn third(cosine: f64) -> usize {
    ((cosine * COSINES as f64) as usize).min(COSINES - 1)
}
