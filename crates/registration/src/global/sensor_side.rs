//! The scanner's other side, for views that don't show which it was: the side is kept from which the view fits the
//! others better.

use rayon::prelude::*;

use super::pair_hypothesis::PairHypothesis;

use super::coarse_view::CoarseView;
use super::hinted::Prior;
use super::pair_hypotheses;
use crate::view::View;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A side that is less clear than this is tried from behind, too.
        unclear: f64 = 0.5,
        /// The other side is taken if the best hypotheses to all others are stronger by this factor, together.
        better: f64 = 1.2,
    }
}

/// Tries the other side of unclear views, one after the other, and puts the better coarse view and its hypotheses in the place of
/// the old. Whether any was better. `pairs` are those that are matched.
pub fn try_other_sensor_sides(
    views: &[View],
    prior: &Prior,
    pairs: &[(usize, usize)],
    coarse_views: &mut [CoarseView],
    hypotheses: &mut Vec<PairHypothesis>,
    edge: f64,
    progress: &Progress,
) -> Result<bool, Canceled> {
    let mut is_changed = false;
    for view in 0..views.len() {
        let clarity = coarse_views[view].side_clarity;
        if clarity >= TUNING.unclear {
            continue;
        }
        let mut reversed = CoarseView::new(&views[view], edge, Some(coarse_views[view].sensor.reversed()));
        if coarse_views[view].depth_image.is_cropped() {
            reversed.depth_image.crop();
        }
        let before = std::mem::replace(&mut coarse_views[view], CoarseView { side_clarity: clarity, ..reversed });
        let found = hypotheses_of_view(coarse_views, prior, pairs, view, edge, progress)?;
        if fit(&found, view, views.len()) > TUNING.better * fit(hypotheses, view, views.len()) {
            hypotheses.retain(|hypothesis| hypothesis.i != view && hypothesis.j != view);
            hypotheses.extend(found);
            is_changed = true;
        } else {
            coarse_views[view] = before;
        }
    }
    Ok(is_changed)
}

/// The hypotheses of a view to all others that it is matched with.
fn hypotheses_of_view(
    coarse_views: &[CoarseView],
    prior: &Prior,
    pairs: &[(usize, usize)],
    view: usize,
    edge: f64,
    progress: &Progress,
) -> Result<Vec<PairHypothesis>, Canceled> {
    let found: Vec<Vec<PairHypothesis>> = pairs
        .par_iter()
        .with_max_len(1)
        .filter(|(i, j)| *i == view || *j == view)
        .map(|&(i, j)| {
            progress.check()?;
            Ok(pair_hypotheses(coarse_views, i, j, prior, edge))
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// How well a view fits the others: the strengths of its best hypotheses to them, added.
fn fit(hypotheses: &[PairHypothesis], view: usize, n: usize) -> f64 {
    let best = |other: usize| {
        let between =
            hypotheses.iter().filter(|hypothesis| (hypothesis.i, hypothesis.j) == (view.min(other), view.max(other)));
        between.map(PairHypothesis::score).fold(0.0, f64::max)
    };
    (0..n).filter(|other| *other != view).map(best).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};
    use crate::hinted::Hinted;
    use crate::sensor::Sensor;
    use visage_geometry::{Motion, Vector3};

    #[test]
    fn a_view_that_was_taken_for_one_from_behind_is_turned_round() {
        let mut fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let behind = Sensor::Toward(Vector3::new(-1.0, 0.0, 0.0));
        let unclear = CoarseView::new(&fixture.views[0], EDGE, Some(behind));
        fixture.coarse_views[0] = CoarseView { side_clarity: 0.1, ..unclear };
        let given: [Option<Motion>; 3] = [0, 1, 2].map(|view| Some(fixture.i_from_j(0, view)));
        let hinted = Hinted::default();
        let prior = Prior { given: &given, hinted: &hinted, turning: None };
        let pairs = [(0, 1), (0, 2), (1, 2)];
        let mut hypotheses: Vec<PairHypothesis> =
            pairs.iter().flat_map(|&(i, j)| pair_hypotheses(&fixture.coarse_views, i, j, &prior, EDGE)).collect();
        let (views, coarse_views) = (&fixture.views, &mut fixture.coarse_views);
        let silent = Progress::silent();
        let mut turn = |hypotheses: &mut Vec<PairHypothesis>| {
            try_other_sensor_sides(views, &prior, &pairs, coarse_views, hypotheses, EDGE, &silent)
                .expect("not canceled")
        };
        assert!(turn(&mut hypotheses));
        assert!(!turn(&mut hypotheses), "and stays so");
        let toward = |direction: Vector3| fixture.coarse_views[0].sensor.direction_from(&[0.0; 3]).dot(&direction);
        assert!(toward(Vector3::x()) > 0.9);
    }
}
