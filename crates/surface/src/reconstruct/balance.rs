//! Gains that make the colours of views agree where they overlap: exposures differ.
//!
//! As in panoramas (Brown and Lowe, IJCV 2007), on logarithms: of each pair of views the median of how their colours differ
//! at shared places, and the gains that explain all pairs with the least squares. What no view can tell stays: all of them
//! together keep their mean.

use std::collections::BTreeMap;

/// Colours beyond these are cut off or drowned in noise, and say nothing of exposure.
const TELLING: std::ops::RangeInclusive<f32> = 8.0..=247.0;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A pair of views with fewer shared places says nothing.
        least: usize = 20,
        /// Shared places that make a pair count as much as one can.
        plenty: usize = 1000,
        /// No exposure differs by more than this factor from the mean.
        most: f32 = 4.0,
    }
}

/// Colours of places that views share.
#[derive(Debug, Clone, Default)]
pub struct Overlaps {
    /// For each pair of views, the lower first, how much brighter the first one is, as differences of logarithms.
    pairs: BTreeMap<(u16, u16), Vec<[f32; 3]>>,
}

impl Overlaps {
    /// Adds what two views say of one place.
    pub fn add(&mut self, a: (u16, [f32; 3]), b: (u16, [f32; 3])) {
        let (a, b) = if a.0 < b.0 { (a, b) } else { (b, a) };
        if a.0 == b.0 || a.1.iter().chain(&b.1).any(|x| !TELLING.contains(x)) {
            return;
        }
        let differences = std::array::from_fn(|k| (a.1[k] / b.1[k]).ln());
        self.pairs.entry((a.0, b.0)).or_default().push(differences);
    }

    /// For each of `views` views the factors for red, green and blue.
    pub fn gains(mut self, views: usize) -> Vec<[f32; 3]> {
        let mut gains = vec![[1.0; 3]; views];
        self.pairs.retain(|_, differences| differences.len() >= TUNING.least);
        for channel in 0..3 {
            let equations: Vec<Equation> = self
                .pairs
                .iter_mut()
                .map(|((a, b), differences)| {
                    let middle = differences.len() / 2;
                    let (_, median, _) =
                        differences.select_nth_unstable_by(middle, |x, y| x[channel].total_cmp(&y[channel]));
                    let difference = f64::from(median[channel]);
                    Equation {
                        a: usize::from(*a),
                        b: usize::from(*b),
                        difference,
                        weight: differences.len().min(TUNING.plenty) as f64,
                    }
                })
                .collect();
            for (gain, log) in gains.iter_mut().zip(solve(&equations, views)) {
                gain[channel] = (log.exp() as f32).clamp(1.0 / TUNING.most, TUNING.most);
            }
        }
        gains
    }
}

/// The logarithms of two views' gains should differ so that `log a - log b = -difference`.
struct Equation {
    a: usize,
    b: usize,
    difference: f64,
    weight: f64,
}

/// Least squares by conjugate gradients; from 0, so that the mean of views that hang together stays 0.
fn solve(equations: &[Equation], views: usize) -> Vec<f64> {
    let apply = |x: &[f64]| {
        let mut found = vec![0.0; views];
        for e in equations {
            let pull = e.weight * (x[e.a] - x[e.b]);
            found[e.a] += pull;
            found[e.b] -= pull;
        }
        found
    };
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let mut x = vec![0.0; views];
    let mut rest = vec![0.0; views];
    for e in equations {
        rest[e.a] -= e.weight * e.difference;
        rest[e.b] += e.weight * e.difference;
    }
    let mut direction = rest.clone();
    let mut square = dot(&rest, &rest);
    let enough = 1e-16 * square;
    for _ in 0..views {
        if square <= enough {
            break;
        }
        let along = apply(&direction);
        let step = square / dot(&direction, &along).max(f64::MIN_POSITIVE);
        for k in 0..views {
            x[k] += step * direction[k];
            rest[k] -= step * along[k];
        }
        let next = dot(&rest, &rest);
        direction.iter_mut().zip(&rest).for_each(|(d, r)| *d = r + next / square * *d);
        square = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_found_along_a_chain_of_views_in_spite_of_shine() {
        let exposures: [f32; 6] = [1.0, 1.2, 0.8, 0.9, 1.15, 0.85];
        let mut overlaps = Overlaps::default();
        for a in 0..5u16 {
            for k in 0..60 {
                let seen = |view: u16| [90.0f32, 120.0, 60.0].map(|x| (x + k as f32) * exposures[usize::from(view)]);
                // every fifth place shines in one of both views
                let other = if k % 5 == 0 { [240.0; 3] } else { seen(a + 1) };
                overlaps.add((a + 1, other), (a, seen(a)));
            }
        }
        // too few places to say anything
        overlaps.add((0, [100.0; 3]), (7, [200.0; 3]));
        let gains = overlaps.gains(8);
        let evened: Vec<f32> = (0..6).map(|k| gains[k][1] * exposures[k]).collect();
        assert!(evened.iter().all(|x| (x / evened[0] - 1.0).abs() < 0.02), "{evened:?}");
        let mean: f32 = gains[..6].iter().map(|gain| gain[1].ln()).sum::<f32>() / 6.0;
        assert!(mean.abs() < 1e-4, "together they stay as bright as they are: {mean}");
        assert_eq!(gains[7], [1.0; 3]);
    }
}
