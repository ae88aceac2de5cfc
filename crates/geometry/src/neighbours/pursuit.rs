//! The nearest neighbour of a query that moves a little from one search to the next.

use super::{IndexedPoints, LocalPoint, Neighbour, distance2};

/// What is remembered of a moving query: while it stays closer to its old neighbour than any other point can have come,
/// nothing needs to be searched.
#[derive(Debug, Clone, Copy)]
pub struct Pursuit {
    /// Where the query was when the tree was last searched.
    asked_at: LocalPoint,
    /// The nearest point found there; an index out of range if there was none.
    nearest: u32,
    /// All other points were at least this far from `asked_at`.
    rival_distance: f32,
}

impl Pursuit {
    /// Nothing known yet.
    #[inline]
    pub const fn new() -> Self {
        Pursuit { asked_at: [0.0; 3], nearest: u32::MAX, rival_distance: 0.0 }
    }

    /// The point nearest to `query` at a squared distance below `max_distance2`: the same answer as a search, mostly
    /// without one.
    #[inline]
    pub fn nearest(&mut self, indexed: &IndexedPoints, query: &LocalPoint, max_distance2: f32) -> Option<Neighbour> {
        let guess = indexed
            .points
            .get(self.nearest as usize)
            .map(|point| Neighbour { index: self.nearest, distance2: distance2(query, point) });
        // all others are at least this far by the triangle inequality; the factor is for rounding
        let others = self.rival_distance * (1.0 - 1e-5) - distance2(query, &self.asked_at).sqrt() * (1.0 + 1e-5);
        if others > 0.0 {
            match guess {
                Some(guess) if guess.distance2 < others * others => {
                    return (guess.distance2 < max_distance2).then_some(guess);
                }
                None if max_distance2 < others * others => return None,
                _ => {}
            }
        }
        let (nearest, rival_distance2) = indexed.tree.nearest_two(query, guess, max_distance2);
        *self = Pursuit {
            asked_at: *query,
            nearest: nearest.map_or(u32::MAX, |n| n.index),
            rival_distance: rival_distance2.sqrt(),
        };
        nearest
    }
}

impl Default for Pursuit {
    fn default() -> Self {
        Pursuit::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_moving_query_is_answered_like_a_fresh_one() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let points: Vec<LocalPoint> =
            (0..2000).map(|_| [rng.random(), rng.random(), rng.random::<f32>() * 0.1]).collect();
        let indexed = IndexedPoints::new(points);
        for start in 0..50u16 {
            let mut query: LocalPoint = [f32::from(start) / 50.0, rng.random(), 0.05];
            let mut pursuit = Pursuit::new();
            for step in 0..60 {
                // ever smaller steps, and a bound that changes
                let size = 0.2 * 0.85f32.powi(step);
                query = query.map(|x| x + size * (rng.random::<f32>() - 0.5));
                let max_distance2 = [0.01, 0.0004, 0.0025][step as usize % 3];
                let fresh = indexed.tree.nearest(&query, max_distance2);
                let pursued = pursuit.nearest(&indexed, &query, max_distance2);
                assert_eq!(pursued.map(|n| n.distance2), fresh.map(|n| n.distance2), "start {start}, step {step}");
            }
        }
    }

    #[test]
    fn a_query_that_stays_is_not_searched_again() {
        let indexed = IndexedPoints::new(vec![[0.0; 3], [1.0, 0.0, 0.0]]);
        let mut pursuit = Pursuit::new();
        pursuit.nearest(&indexed, &[0.1, 0.0, 0.0], 4.0);
        let asked_at = pursuit.asked_at;
        assert_eq!(pursuit.nearest(&indexed, &[0.3, 0.0, 0.0], 4.0).map(|n| n.index), Some(0));
        assert_eq!(pursuit.asked_at, asked_at);
        assert_eq!(pursuit.nearest(&indexed, &[0.8, 0.0, 0.0], 4.0).map(|n| n.index), Some(1));
        assert_ne!(pursuit.asked_at, asked_at);
    }
}
