//! Single scans: models ranked by the nearest of their simulated scans.
//!
//! A sum of squares only grows: a view is left as soon as what was summed up is more than its model could still come in with. What is left is
//! no nearer than that, so the answer is the one of measuring all.

use rayon::prelude::*;

use super::column::Column;
use super::columns::stored;
use super::likeness::{as_views, reach_of_views};
use super::live_segment::LiveSegment;
use super::probe::{Found, Probe};
use super::{Match, ModelId, TopK};
use visage_shape::descriptor::{ViewCode, steps, view_distance};

/// Bytes that are summed up before what was summed is looked at.
const CHUNK: usize = 32;
/// Models that are measured against one reach; the next ones against that of what was found by then.
const BLOCK: usize = if cfg!(test) { 16 } else { 8192 };

/// The views of a list of models, one model's after the other's.
#[derive(Debug, Default)]
pub(super) struct ViewRows {
    views: Column<ViewCode>,
    /// Where each model's end.
    ends: Column<u32>,
}

stored!(ViewRows { views, ends });

impl ViewRows {
    /// Adds a model's.
    pub fn push(&mut self, views: &[ViewCode]) {
        self.views.extend(views.iter().copied());
        self.ends.push(self.views.len() as u32);
    }

    /// Adds one from another list.
    pub fn push_from(&mut self, others: &ViewRows, place: u32) {
        self.push(others.of(place));
    }

    /// Gives back what is not needed.
    pub fn shrink(&mut self) {
        self.views.shrink();
        self.ends.shrink();
    }

    /// Whether there are some, or none, for each of so many models.
    pub fn are_of(&self, models: usize) -> bool {
        let last = self.ends.last().map_or(0, |end| *end as usize);
        self.ends.len() == models && self.ends.is_sorted() && last == self.views.len()
    }

    /// A model's.
    pub fn of(&self, place: u32) -> &[ViewCode] {
        let place = place as usize;
        let start = place.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.views[start as usize..self.ends[place] as usize]
    }
}

/// How far a scan is from the nearest view; `None` if none is within `reach`.
fn nearest(scan: &ViewCode, views: &[ViewCode], reach: f64) -> Option<f64> {
    // in steps of bytes; a hair more, for roundings
    let mut most = ((steps(reach).powi(2) * (1.0 + 1e-6)) as u32).saturating_add(1);
    let mut nearest = None;
    for view in views {
        if let Some(square) = square_within(scan, view, most) {
            (most, nearest) = (square, Some(view));
        }
    }
    nearest.map(|view| view_distance(scan, view))
}

/// The squared distance in steps of bytes; `None` if it is more than `most`.
fn square_within(a: &ViewCode, b: &ViewCode, most: u32) -> Option<u32> {
    let mut sum = 0;
    for (a, b) in a.chunks_exact(CHUNK).zip(b.chunks_exact(CHUNK)) {
        sum += a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum::<u32>();
        if sum > most {
            return None;
        }
    }
    Some(sum)
}

impl Probe {
    /// The models that one of whose views the probe is most like, best first, ties by id.
    pub fn search_by_view(&self, segments: &[LiveSegment], top_k: &TopK) -> Vec<Match> {
        let mut found = Found::new(top_k);
        let Some(scan) = self.shape.as_ref().map(|shape| shape.as_view()) else { return Vec::new() };
        for (which, live) in segments.iter().enumerate() {
            let places: Vec<u32> = live.places().collect();
            for block in places.chunks(BLOCK) {
                let reach = reach_of_views(found.least());
                let scored = |place: &u32| {
                    let nearest = nearest(&scan, live.segment.views.of(*place), reach);
                    (live.segment.ids[*place as usize], *place, as_views(nearest))
                };
                let scores: Vec<(ModelId, u32, f64)> = block.par_iter().with_min_len(256).map(scored).collect();
                scores.into_iter().for_each(|(id, place, score)| found.offer(id, (which, place), score));
            }
        }
        self.answers(segments, found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Gallery, Likeness, TopK};
    use super::*;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn a_scan_finds_the_models_with_the_nearest_views_wherever_these_are_kept() {
        let models: Vec<_> = (0..60u128).map(|id| (id, example(0.31 * id as f64, 4 + (id % 5) as usize))).collect();
        let mut gallery = Gallery::build(models[..40].to_vec());
        models[40..].iter().for_each(|(id, signature)| gallery.insert(*id, signature.clone()));
        assert!(gallery.remove(7));
        let probe = example(3.3, 5);
        let scan = probe.shape().expect("it has one").as_view();
        let distances = |views: &[ViewCode]| views.iter().map(|view| view_distance(&scan, view)).min_by(f64::total_cmp);
        let score = |views: &[ViewCode]| as_views(distances(views));
        let others = models.iter().filter(|(id, _)| *id != 7);
        let mut expected: Vec<(f64, u128)> = others.map(|(id, model)| (score(model.views()), *id)).collect();
        expected.retain(|(score, _)| *score > 0.0);
        expected.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for limit in [1, 2, 5, 100] {
            let found = gallery.by_likeness(&probe, Likeness::View, None, &TopK::best(limit));
            let expected = &expected[..limit.min(expected.len())];
            assert_eq!(found.iter().map(|m| (m.score, m.model_id)).collect::<Vec<_>>(), expected);
        }
        assert!(expected.len() > 20 && expected.len() < 59, "some have no views");
    }
}
