//! The paper's retrieval: models ranked by how far a probe's triangles of salient regions occur on them. Kept for comparison, since
//! salient regions come and go with noise and the mesh; all models are measured.

use rayon::prelude::*;

use super::live_segment::LiveSegment;
use super::probe::{Address, Found, Probe};
use super::{Match, ModelId, TopK};

impl Probe {
    /// The models with the most of the probe's triangles, best first, ties by id; those with none are left out.
    pub fn search_by_regions(&self, segments: &[LiveSegment], top_k: &TopK) -> Vec<Match> {
        let mut found = Found::new(top_k);
        for (which, live) in segments.iter().enumerate() {
            let places: Vec<u32> = live.places().collect();
            let scored = |place: &u32| {
                (live.segment.ids[*place as usize], (which, *place), self.regions_of(segments, (which, *place)).mean)
            };
            let scores: Vec<(ModelId, Address, f64)> = places.par_iter().map(scored).collect();
            scores.into_iter().for_each(|(id, address, score)| found.offer(id, address, score));
        }
        self.answers(segments, found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Gallery, Likeness, TopK, compare};
    use visage_shape::faces::signature::example::example;

    #[test]
    fn models_rank_by_the_triangles_that_they_share_with_the_probe() {
        let models: Vec<_> = (0..40).map(|id| (id, example(0.2 * id as f64, 6))).collect();
        let (gallery, probe) = (Gallery::build(models.clone()), example(1.25, 7));
        let found = gallery.by_likeness(&probe, Likeness::SalientRegions, None, &TopK::best(100));
        let mut expected: Vec<(f64, u128)> = models
            .iter()
            .map(|(id, model)| (compare(&probe, model).region_triangles, *id))
            .filter(|(score, _)| *score > 0.0)
            .collect();
        expected.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        assert!(expected.len() > 3);
        assert_eq!(found.iter().map(|m| (m.score, m.model_id)).collect::<Vec<_>>(), expected);
        let by_shape = gallery.by_likeness(&probe, Likeness::Shape, Some(3), &TopK::best(5));
        assert_eq!(by_shape, gallery.by_probe(&probe, Some(3), &TopK::best(5)));
    }
}
