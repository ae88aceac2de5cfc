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
