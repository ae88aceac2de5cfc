//! The best few models of a search so far.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use super::ModelId;

/// A cost in its total order.
#[derive(Debug, Clone, Copy)]
struct Cost(f64);

impl Ord for Cost {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Cost {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Cost {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cost {}

/// Keeps the `limit` models of least cost, ties by id, each with its least `(cost, place)`.
#[derive(Debug)]
pub(super) struct Best<P> {
    limit: usize,
    ranked: BTreeSet<(Cost, ModelId)>,
    places: BTreeMap<ModelId, (Cost, P)>,
}

impl<P: Ord> Best<P> {
    /// None so far.
    pub fn new(limit: usize) -> Best<P> {
        Best { limit, ranked: BTreeSet::new(), places: BTreeMap::new() }
    }

    /// The greatest cost with which a model may still come in.
    pub fn reach(&self) -> f64 {
        match self.ranked.last() {
            _ if self.limit == 0 => f64::NEG_INFINITY,
            Some((cost, _)) if self.ranked.len() >= self.limit => cost.0,
            _ => f64::INFINITY,
        }
    }

    /// Whether an offer would change anything.
    pub fn would_take(&self, cost: f64, id: ModelId, place: &P) -> bool {
        match self.places.get(&id) {
            Some((kept, at)) => (Cost(cost), place) < (*kept, at),
            None if self.ranked.len() < self.limit => true,
            None => self.ranked.last().is_some_and(|worst| (Cost(cost), id) < *worst),
        }
    }

    /// Takes a model in, if it is among the best.
    pub fn offer(&mut self, cost: f64, id: ModelId, place: P) {
        if self.limit == 0 || !self.would_take(cost, id, &place) {
            return;
        }
        if let Some((kept, _)) = self.places.insert(id, (Cost(cost), place)) {
            self.ranked.remove(&(kept, id));
        }
        self.ranked.insert((Cost(cost), id));
        if self.ranked.len() > self.limit
            && let Some((_, worst)) = self.ranked.pop_last()
        {
            self.places.remove(&worst);
        }
    }

    /// Best first: cost, model, place.
    pub fn into_ranked(mut self) -> impl Iterator<Item = (f64, ModelId, P)> {
        self.ranked.into_iter().filter_map(move |(cost, id)| Some((cost.0, id, self.places.remove(&id)?.1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nothing_is_kept_where_nothing_is_wanted() {
        let mut best = Best::new(0);
        best.offer(0.5, 1, ());
        assert_eq!(best.reach(), f64::NEG_INFINITY);
        assert_eq!(best.into_ranked().count(), 0);
    }

    proptest! {
        #[test]
        fn it_keeps_what_sorting_all_keeps(offers in prop::collection::vec((0u8..6, 0u128..9, 0u8..4), 0..60), limit in 1usize..8) {
            let mut best = Best::new(limit);
            let mut least: BTreeMap<u128, (f64, u8)> = BTreeMap::new();
            for (cost, id, place) in &offers {
                let cost = f64::from(*cost) - 2.0;
                let would = best.would_take(cost, *id, place);
                let reach = best.reach();
                best.offer(cost, *id, *place);
                prop_assert!(!would || cost <= reach);
                let kept = least.entry(*id).or_insert((cost, *place));
                if (cost, *place) < *kept {
                    *kept = (cost, *place);
                }
            }
            let mut sorted: Vec<(f64, u128, u8)> = least.into_iter().map(|(id, (cost, place))| (cost, id, place)).collect();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            sorted.truncate(limit);
            prop_assert_eq!(best.into_ranked().collect::<Vec<_>>(), sorted);
        }
    }
}
