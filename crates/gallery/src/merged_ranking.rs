//! All models by the score of one method: the parts' rankings merged as far as somebody reads.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::indexed_model::Standing;
use super::live_segment::LiveSegment;
use super::{ModelId, Rank};

/// The models of all parts by the method of a slot, best score first, ties by id; those after a rank, if one is given.
pub(super) fn ranked(
    segments: &[LiveSegment],
    slot: usize,
    after: Option<Rank>,
) -> impl Iterator<Item = (ModelId, &Standing)> {
    let rankings = segments.iter().map(move |live| Ranking { live, slot, next: begin(live, slot, after) });
    let mut heads: BinaryHeap<Head> = rankings.filter_map(Ranking::advanced).collect();
    std::iter::from_fn(move || {
        let Head { id, standing, ranking } = heads.pop()?;
        heads.extend(ranking.advanced());
        Some((id, standing))
    })
}

/// Where in a part's ranking the models after a rank begin.
fn begin(live: &LiveSegment, slot: usize, after: Option<Rank>) -> usize {
    let segment = &live.segment;
    let rank = |place: u32| {
        let place = place as usize;
        Rank { score: segment.standings[place][slot].score, model_id: segment.ids[place] }
    };
    after.map_or(0, |after| segment.rankings[slot].partition_point(|place| rank(*place).key() <= after.key()))
}

/// A part's models by one method's score, those before `next` done with.
struct Ranking<'a> {
    live: &'a LiveSegment,
    slot: usize,
    next: usize,
}

/// The best model that a part has left.
struct Head<'a> {
    id: ModelId,
    standing: &'a Standing,
    ranking: Ranking<'a>,
}

impl<'a> Ranking<'a> {
    /// Goes on to the next model that is there.
    fn advanced(mut self) -> Option<Head<'a>> {
        let (live, slot) = (self.live, self.slot);
        let segment = &live.segment;
        while let Some(&place) = segment.rankings[slot].get(self.next) {
            self.next += 1;
            if live.is_alive(place) {
                let standing = &segment.standings[place as usize][slot];
                return Some(Head { id: segment.ids[place as usize], standing, ranking: self });
            }
        }
        None
    }
}

/// The greatest is the best: the highest score, then the lowest id.
impl Ord for Head<'_> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.standing.score.total_cmp(&other.standing.score).then(other.id.cmp(&self.id))
    }
}

impl PartialOrd for Head<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Head<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Head<'_> {}

#[cfg(test)]
mod tests {
    use super::super::indexed_model::IndexedModel;
    use super::super::segment::Segment;
    use super::*;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn parts_are_merged_in_order_without_those_that_are_gone() {
        let entry = |k: ModelId| IndexedModel::new(k, example(0.29 * (k % 13) as f64, 5));
        let live =
            |ids: &[ModelId]| LiveSegment::new(Segment::build(&[], &ids.iter().map(|&k| entry(k)).collect::<Vec<_>>()));
        let mut segments = [live(&[1, 14, 3, 30]), live(&[2, 27, 15, 8]), live(&[5])];
        assert!(segments[0].forget(30) && segments[2].forget(5));
        for slot in [0, 1, 2] {
            let ranked: Vec<(f64, ModelId)> =
                ranked(&segments, slot, None).map(|(id, standing)| (standing.score, id)).collect();
            let mut sorted: Vec<(f64, ModelId)> =
                [1, 2, 3, 8, 14, 15, 27].map(|k| (entry(k).standings[slot].score, k)).into();
            sorted.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            assert_eq!(ranked, sorted);
        }
    }
}
