//! Which surfels of two views look alike: the raw material of hypotheses, right in a third of the cases or less.

use super::coarse_view::CoarseView;

/// A surfel of view i and one of view j that look alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Surfel of view i.
    pub of_i: u32,
    /// Surfel of view j.
    pub of_j: u32,
    /// Distance of the descriptions in that of the next best elsewhere: the lower the more telling.
    pub ratio: f32,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels of a view for which a counterpart is sought, at most.
        keypoints: usize = 500,
        /// The next best is looked for at least this far from the best, in edges.
        elsewhere: f32 = 4.0,
        /// A next best whose squared distance is this many times the best's is as good as none.
        clear: f32 = 4.0,
    }
}

/// Matches of a pair that are kept, at most.
pub const MATCHES: usize = 448;
/// Keypoints compared in one go.
const TOGETHER: usize = 4;

/// The most telling matches between two views, found from both sides.
pub fn matches(i: &CoarseView, j: &CoarseView, edge: f64) -> Vec<Match> {
    let mut found = one_sided(i, j, edge);
    let back = one_sided(j, i, edge);
    found.extend(back.into_iter().map(|m| Match { of_i: m.of_j, of_j: m.of_i, ratio: m.ratio }));
    found.sort_by(|a, b| a.ratio.total_cmp(&b.ratio).then((a.of_i, a.of_j).cmp(&(b.of_i, b.of_j))));
    found.dedup_by_key(|m| (m.of_i, m.of_j));
    found.truncate(MATCHES);
    found
}

fn one_sided(from: &CoarseView, to: &CoarseView, edge: f64) -> Vec<Match> {
    let elsewhere2 = (TUNING.elsewhere * edge as f32).powi(2);
    let step = from.inner.len().div_ceil(TUNING.keypoints).max(1);
    let keypoints: Vec<usize> = (0..from.inner.len()).step_by(step).collect();
    let mut rows: [Vec<f32>; TOGETHER] = Default::default();
    let mut found = Vec::with_capacity(keypoints.len());
    for some in keypoints.chunks(TOGETHER) {
        // a last chunk that is not full asks its last keypoint again
        let at: [usize; TOGETHER] = std::array::from_fn(|k| some[k.min(some.len() - 1)]);
        to.descriptors.distances2(&at.map(|k| from.descriptors.get(k)), &mut rows);
        for (&k, distances2) in some.iter().zip(&rows) {
            found.extend(best_of(distances2, to, elsewhere2).map(|(best, ratio)| Match {
                of_i: from.inner[k],
                of_j: to.inner[best],
                ratio,
            }));
        }
    }
    found
}

/// The nearest description, and its squared distance in that of the next best elsewhere.
fn best_of(distances2: &[f32], to: &CoarseView, elsewhere2: f32) -> Option<(usize, f32)> {
    let nearest = least(distances2);
    let best = distances2.iter().position(|d| *d == nearest)?;
    let place = to.position(to.inner[best] as usize);
    let is_elsewhere = |surfel: u32| (to.position(surfel as usize) - place).norm_squared() > elsewhere2;
    // few are so near that their places have to be looked at
    let mut second = TUNING.clear * nearest;
    for (some, surfels) in distances2.chunks(LANES).zip(to.inner.chunks(LANES)) {
        if least(some) < second {
            for (distance2, surfel) in some.iter().zip(surfels) {
                if *distance2 < second && is_elsewhere(*surfel) {
                    second = *distance2;
                }
            }
        }
    }
    Some((best, nearest / second.max(f32::MIN_POSITIVE)))
}

/// Values compared at once.
const LANES: usize = 16;

fn least(values: &[f32]) -> f32 {
    let mut least = [f32::INFINITY; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        least.iter_mut().zip(chunk).for_each(|(least, value)| *least = if *value < *least { *value } else { *least });
    }
    rest.iter().chain(&least).copied().fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::consensus::{Support, proposals};
    use crate::global::fixture::{EDGE, Fixture};

    #[test]
    fn matches_of_two_views_hold_the_true_motion_and_are_found_from_either_side() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let (i, j) = (&fixture.coarse_views[0], &fixture.coarse_views[1]);
        let found = matches(i, j, EDGE);
        assert!(found.len() > 50 && found.len() <= MATCHES);
        assert!(found.is_sorted_by(|a, b| a.ratio <= b.ratio), "the most telling first");
        let mut back: Vec<(u32, u32)> = matches(j, i, EDGE).iter().map(|m| (m.of_j, m.of_i)).collect();
        let mut pairs: Vec<(u32, u32)> = found.iter().map(|m| (m.of_i, m.of_j)).collect();
        back.sort_unstable();
        pairs.sort_unstable();
        let common = pairs.iter().filter(|pair| back.binary_search(pair).is_ok()).count();
        assert!(common * 10 > 9 * pairs.len(), "{common} of {}", pairs.len());
        let proposed = proposals(i, j, &found, Support::Any, EDGE, 8);
        let nearest = proposed.iter().map(|p| fixture.off(0, 1, &p.i_from_j)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 2.0 * EDGE, "{nearest}");
    }
}
