//! The scanner's other side, for views that don't show which it was: the side is kept from which the view fits the
//! others better.

use rayon::prelude::*;

use super::link::Link;

use super::hinted::Prior;
use super::pair_links;
use super::sketch::Sketch;
use crate::progress::{Canceled, Progress};
use crate::registration::view::View;

/// A side that is less clear than this is tried from behind, too.
const UNCLEAR: f64 = 0.5;
/// The other side is taken if the best links to all others are stronger by this factor, together.
const BETTER: f64 = 1.2;

/// Tries the other side of unclear views, one after the other, and puts the better sketch and its links in the place of
/// the old. Whether any was better. `pairs` are those that are matched.
pub fn try_other_sides(
    views: &[View],
    prior: &Prior,
    pairs: &[(usize, usize)],
    sketches: &mut [Sketch],
    links: &mut Vec<Link>,
    edge: f64,
    progress: &Progress,
) -> Result<bool, Canceled> {
    let mut is_changed = false;
    for view in 0..views.len() {
        let clarity = sketches[view].side_clarity;
        if clarity >= UNCLEAR {
            continue;
        }
        let mut reversed = Sketch::new(&views[view], edge, Some(sketches[view].sensor.reversed()));
        if sketches[view].sight.is_cropped() {
            reversed.sight.crop();
        }
        let before = std::mem::replace(&mut sketches[view], Sketch { side_clarity: clarity, ..reversed });
        let found = links_of_view(sketches, prior, pairs, view, edge, progress)?;
        if fit(&found, view, views.len()) > BETTER * fit(links, view, views.len()) {
            links.retain(|link| link.i != view && link.j != view);
            links.extend(found);
            is_changed = true;
        } else {
            sketches[view] = before;
        }
    }
    Ok(is_changed)
}

/// The links of a view to all others that it is matched with.
fn links_of_view(
    sketches: &[Sketch],
    prior: &Prior,
    pairs: &[(usize, usize)],
    view: usize,
    edge: f64,
    progress: &Progress,
) -> Result<Vec<Link>, Canceled> {
    let found: Vec<Vec<Link>> = pairs
        .par_iter()
        .with_max_len(1)
        .filter(|(i, j)| *i == view || *j == view)
        .map(|&(i, j)| {
            progress.check()?;
            Ok(pair_links(sketches, i, j, prior, edge))
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// How well a view fits the others: the strengths of its best links to them, added.
fn fit(links: &[Link], view: usize, n: usize) -> f64 {
    let best = |other: usize| {
        let between = links.iter().filter(|link| (link.i, link.j) == (view.min(other), view.max(other)));
        between.map(Link::score).fold(0.0, f64::max)
    };
    (0..n).filter(|other| *other != view).map(best).sum()
}
