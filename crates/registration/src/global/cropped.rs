//! Scans whose picture ends in the middle of a surface: a camera's frame, a cut-out, a part of a room.
//!
//! Of a whole object before a wide view it says much that a scanner saw nothing beside it. Of a frame it says nothing.
//! Which of both a scan is shows where another one lies on it: much surface beyond the picture, and hardly any that
//! contradicts what is inside.

use super::coarse_view::CoarseView;
use super::pair_hypothesis::PairHypothesis;
use super::votes::SurfelVotes;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels that have to agree before a hypothesis says something of pictures.
        least_agree: f64 = 60.0,
        /// Of what is said inside both pictures this share has to agree.
        coherent: f64 = 0.75,
        /// A picture is cropped if this share of what should be in it is missed: on right motions of whole objects hardly anything
        /// is, whatever the scanner.
        missed: f64 = 0.12,
        /// Frames come in sets: fewer than this share of cropped pictures are whole objects that were laid on each other wrongly,
        frames: f64 = 1.0 / 3.0,
        /// and where this share of a large set is cropped all are: one scanner took them, and of some the best hypothesis shows it by
        /// chance not.
        all_frames: f64 = 2.0 / 3.0,
    }
}

/// How many coarse views of a set have to be cropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// As many as come in sets.
    Some,
    /// So many that all are: plain enough before anything is laid together.
    All,
}

/// Marks the coarse views that are cropped by what the best hypotheses of their pairs say together; whether any is.
pub fn crop(coarse_views: &mut [CoarseView], hypotheses: &[PairHypothesis], wanted: Frames) -> bool {
    let mut said: Vec<(f64, f64)> = vec![(0.0, 0.0); coarse_views.len()];
    for hypothesis in best_of_pairs(hypotheses) {
        for (picture, votes) in
            [(hypothesis.i, &hypothesis.evidence.j_in_i), (hypothesis.j, &hypothesis.evidence.i_in_j)]
        {
            said[picture].0 += votes.missed;
            said[picture].1 += votes.agree;
        }
    }
    let is_cropped = |view: &usize| said[*view].0 > TUNING.missed * (said[*view].0 + said[*view].1);
    let cropped: Vec<usize> = (0..coarse_views.len()).filter(is_cropped).collect();
    let is_share = |share: f64| cropped.len() as f64 >= share * coarse_views.len() as f64;
    if cropped.is_empty() || !is_share(if wanted == Frames::All { TUNING.all_frames } else { TUNING.frames }) {
        return false;
    }
    if wanted == Frames::All {
        coarse_views.iter_mut().for_each(|coarse_view| coarse_view.depth_image.crop());
    } else {
        cropped.into_iter().for_each(|view| coarse_views[view].depth_image.crop());
    }
    true
}

/// For each pair the hypothesis that most agrees, if that is coherent.
fn best_of_pairs(hypotheses: &[PairHypothesis]) -> Vec<&PairHypothesis> {
    let mut best: std::collections::BTreeMap<(usize, usize), &PairHypothesis> = std::collections::BTreeMap::new();
    for hypothesis in hypotheses.iter().filter(|hypothesis| is_coherent(hypothesis)) {
        let known = best.entry((hypothesis.i, hypothesis.j)).or_insert(hypothesis);
        if balance(hypothesis) > balance(known) {
            *known = hypothesis;
        }
    }
    best.into_values().collect()
}

fn inside(hypothesis: &PairHypothesis) -> (f64, f64) {
    let votes: SurfelVotes = hypothesis.evidence.both();
    (votes.agree, votes.contradict + votes.looked_through)
}

fn balance(hypothesis: &PairHypothesis) -> f64 {
    let (agree, against) = inside(hypothesis);
    agree - against
}

fn is_coherent(hypothesis: &PairHypothesis) -> bool {
    let (agree, against) = inside(hypothesis);
    agree >= TUNING.least_agree && agree >= TUNING.coherent * (agree + against)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::Fixture;
    use crate::global::verification::PairVotes;

    /// Hypotheses of the true motions of views around, in which each picture misses that many of the other's surfels.
    fn hypotheses(fixture: &Fixture, missed: f64, contradict: f64) -> Vec<PairHypothesis> {
        let votes = SurfelVotes { queried: 300.0, agree: 120.0, missed, contradict, ..SurfelVotes::default() };
        let evidence = PairVotes { j_in_i: votes, i_in_j: votes };
        [(0, 1), (1, 2)].map(|(i, j)| PairHypothesis { evidence, ..fixture.right(i, j) }).into()
    }

    #[test]
    fn pictures_are_cropped_that_miss_much_of_what_else_agrees() {
        let cropped = |missed: f64, contradict: f64| {
            let mut fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
            let hypotheses = hypotheses(&fixture, missed, contradict);
            let any = crop(&mut fixture.coarse_views, &hypotheses, Frames::Some);
            (any, fixture.coarse_views.iter().filter(|view| view.depth_image.is_cropped()).count())
        };
        assert_eq!(cropped(0.0, 0.0), (false, 0));
        assert_eq!(cropped(60.0, 0.0), (true, 3));
        assert_eq!(cropped(60.0, 90.0), (false, 0), "what crosses inside says nothing of the rest");
    }
}
