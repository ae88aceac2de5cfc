//! Components grown view by view from several beginnings, of which the one is kept that all its pairs speak for most.
//!
//! Joining the strongest pairs first goes wrong where a wrong pair is stronger than the right ones, as on flat sides and
//! repeated parts. What such a pair leads to contradicts itself: scanners look through surface that others saw, or miss
//! it. So several pairs are followed to their ends, and the ends compared.

use rayon::prelude::*;

use super::agglomerative::{self, measure, touching};
use super::coarse_set::CoarseSet;
use super::component::Component;
use super::consensus::alike;
use super::pair_hypothesis::PairHypothesis;
use super::slippage::can_slip;
use super::surfel_icp::align_onto;
use super::verification::verify;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels of a view that are queried of a place,
        samples: usize = 100,
        /// and of whether it could slide.
        slide_samples: usize = 200,
        /// Hypotheses that components are grown from.
        seeds: usize = 24,
        /// Places nearer to each other than this, in edges, are one.
        same: f64 = 2.5,
        /// A view is taken in if so much speaks for its place,
        least: f64 = 12.0,
        /// and if another place has less than this share of that.
        rival: f64 = 0.8,
        /// The agreement of one pair counts up to about so many surfels: views stacked on each other agree much, and a right
        /// set has many pairs that agree a little.
        enough: f64 = 60.0,
    }
}

/// Views with their poses in a world of their own, in the order in which they came.
type Placed = Vec<(usize, Motion)>;

/// A place that a view may have.
#[derive(Debug, Clone, Copy)]
struct Place {
    pose: Motion,
    /// How much speaks for it.
    balance: f64,
}

/// A view that has no place yet, with those that are proposed for it.
struct Waiting {
    view: usize,
    places: Vec<Place>,
}

/// What came of growing.
#[derive(Debug, Clone)]
pub struct Grown {
    /// Components of two views or more, no view in two of them.
    pub components: Vec<Component>,
    /// For each view whether it fits its component in several ways.
    pub ambiguous: Vec<bool>,
}

/// Components that are known before anything grows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Known<'a> {
    /// Those that are clear: they stay as they are, and take in views that are in none of them.
    pub clear: &'a [Component],
    /// Others, to begin from.
    pub open: &'a [Component],
}

/// Grows components from the best hypotheses and from those that are known, until nothing is left that speaks for more.
pub fn grow(
    coarse_set: &CoarseSet,
    hypotheses: &[PairHypothesis],
    known: &Known,
    progress: &Progress,
) -> Result<Grown, Canceled> {
    let mut is_clear = vec![false; coarse_set.coarse_views.len()];
    known.clear.iter().flat_map(|component| &component.views).for_each(|view| is_clear[*view] = true);
    let growth = IncrementalSearch { coarse_set, hypotheses, is_clear };
    let mut free: Vec<usize> = (0..coarse_set.coarse_views.len()).collect();
    let mut grown = Grown { components: Vec::new(), ambiguous: vec![false; free.len()] };
    while let Some(best) = growth.best(&free, known, progress)? {
        let settled = growth.settle(&best, known.clear);
        settled.ambiguous.iter().for_each(|view| grown.ambiguous[*view] = true);
        let is_done = |view: &usize| match &settled.component {
            Some(component) => component.views.contains(view) || settled.ambiguous.contains(view),
            None => best.iter().any(|(placed, _)| placed == view),
        };
        free.retain(|view| !is_done(view));
        grown.components.extend(settled.component);
    }
    Ok(grown)
}

/// A grown component without the views that have no clear place in it.
struct Settled {
    component: Option<Component>,
    ambiguous: Vec<usize>,
}

struct IncrementalSearch<'a> {
    coarse_set: &'a CoarseSet<'a>,
    hypotheses: &'a [PairHypothesis],
    /// For each view whether it is of a clear component.
    is_clear: Vec<bool>,
}

impl IncrementalSearch<'_> {
    /// The component of free views that most speaks for.
    fn best(&self, free: &[usize], known: &Known, progress: &Progress) -> Result<Option<Placed>, Canceled> {
        let components = known.clear.iter().chain(known.open);
        let seeds: Vec<Placed> =
            self.seeds(free)
                .into_iter()
                .map(|hypothesis| vec![(hypothesis.i, Motion::identity()), (hypothesis.j, hypothesis.i_from_j)])
                .chain(components.map(|component| {
                    component.views.iter().copied().zip(component.local_poses.iter().copied()).collect()
                }))
                .filter(|seed: &Placed| seed.len() > 1 && seed.iter().all(|(view, _)| free.contains(view)))
                .collect();
        let grown: Vec<(f64, Placed)> = seeds
            .into_par_iter()
            .with_max_len(1)
            .map(|seed| {
                progress.check()?;
                let placed = self.grown(seed, free);
                Ok((self.total(&placed), placed))
            })
            .collect::<Result<_, Canceled>>()?;
        let best = grown.into_iter().reduce(|best, next| if next.0 > best.0 { next } else { best });
        Ok(best.filter(|(total, _)| *total >= TUNING.least).map(|(_, placed)| placed))
    }

    /// The hypotheses between free views that most speaks for. Clear components are beginnings themselves.
    fn seeds(&self, free: &[usize]) -> Vec<&PairHypothesis> {
        let is_free = |view: &usize| free.contains(view) && !self.is_clear[*view];
        let between_free =
            self.hypotheses.par_iter().filter(|hypothesis| is_free(&hypothesis.i) && is_free(&hypothesis.j));
        let mut seeds: Vec<(f64, &PairHypothesis)> = between_free
            .map(|hypothesis| (self.balance(hypothesis.i, hypothesis.j, &hypothesis.i_from_j), hypothesis))
            .filter(|(balance, _)| *balance >= TUNING.least)
            .collect();
        seeds.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1.i, a.1.j).cmp(&(b.1.i, b.1.j))));
        seeds.truncate(TUNING.seeds);
        seeds.into_iter().map(|(_, hypothesis)| hypothesis).collect()
    }

    /// Takes in free views one by one, the clearest first.
    fn grown(&self, seed: Placed, free: &[usize]) -> Placed {
        let is_waiting = |view: &&usize| !self.is_clear[**view] && seed.iter().all(|(placed, _)| placed != *view);
        let mut waiting: Vec<Waiting> =
            free.iter().filter(is_waiting).map(|view| Waiting { view: *view, places: Vec::new() }).collect();
        let mut placed = Placed::new();
        for view in seed {
            placed.push(view);
            self.tell(&placed, &mut waiting);
        }
        while let Some((index, pose)) = clearest(&waiting) {
            let view = waiting.remove(index).view;
            placed.push((view, self.refined(&placed, view, &pose)));
            self.tell(&placed, &mut waiting);
        }
        placed
    }

    /// What the view that came last says of the places of those that wait, and the places that it proposes.
    fn tell(&self, placed: &[(usize, Motion)], waiting: &mut [Waiting]) {
        let Some(&(last, at)) = placed.last() else { return };
        for Waiting { view, places } in waiting {
            for place in places.iter_mut() {
                place.balance += self.balance(last, *view, &at.inv_mul(&place.pose));
            }
            for pose in self.proposed(last, &at, *view) {
                if !places.iter().any(|other| self.is_same(*view, &other.pose, &pose)) {
                    places.push(Place { pose, balance: self.balance_at(placed, *view, &pose) });
                }
            }
        }
    }

    /// The poses of `view` that its hypotheses to another at `pose_other` propose.
    fn proposed(&self, other: usize, pose_other: &Motion, view: usize) -> impl Iterator<Item = Motion> {
        self.hypotheses.iter().filter_map(move |hypothesis| match (hypothesis.i, hypothesis.j) {
            (i, j) if i == other && j == view => Some(pose_other * hypothesis.i_from_j),
            (i, j) if i == view && j == other => Some(pose_other * hypothesis.i_from_j.inverse()),
            _ => None,
        })
    }

    fn is_same(&self, view: usize, a: &Motion, b: &Motion) -> bool {
        alike(a, b, self.coarse_set.coarse_views[view].radius, TUNING.same * self.coarse_set.edge)
    }

    /// A pose refined on the surface of all that are placed, if that stays near.
    fn refined(&self, placed: &[(usize, Motion)], view: usize, pose: &Motion) -> Motion {
        let others: Vec<_> = placed.iter().map(|(other, at)| (&self.coarse_set.coarse_views[*other], *at)).collect();
        let refined = align_onto(&others, &self.coarse_set.coarse_views[view], pose, self.coarse_set.edge);
        if self.is_same(view, &refined, pose) { refined } else { *pose }
    }

    /// How much speaks for a motion between two views.
    fn balance(&self, i: usize, j: usize, i_from_j: &Motion) -> f64 {
        let (a, b) = (&self.coarse_set.coarse_views[i], &self.coarse_set.coarse_views[j]);
        if i_from_j.translation.vector.norm() > a.radius + b.radius {
            return 0.0;
        }
        let votes = verify(a, b, i_from_j, self.coarse_set.edge, TUNING.samples).both();
        TUNING.enough * (1.0 - (-votes.agree / self.coarse_set.excess(&votes) / TUNING.enough).exp()) - votes.against()
    }

    /// How much those that are placed speak for a view's pose.
    fn balance_at(&self, placed: &[(usize, Motion)], view: usize, pose: &Motion) -> f64 {
        placed.iter().map(|(other, at)| self.balance(*other, view, &at.inv_mul(pose))).sum()
    }

    /// How much all pairs speak for a component.
    fn total(&self, placed: &[(usize, Motion)]) -> f64 {
        (0..placed.len()).map(|k| self.balance_at(&placed[..k], placed[k].0, &placed[k].1)).sum()
    }

    /// Leaves out the views that could as well stand elsewhere or slide, and those that don't touch the others at full
    /// resolution; those of clear components stay.
    fn settle(&self, placed: &[(usize, Motion)], clear: &[Component]) -> Settled {
        let CoarseSet { coarse_views, edge, .. } = *self.coarse_set;
        let mut placed = placed.to_vec();
        placed.sort_by_key(|(view, _)| *view);
        let is_open = |(k, l): &(usize, usize)| !(self.is_clear[placed[*k].0] && self.is_clear[placed[*l].0]);
        let pairs = (0..placed.len()).flat_map(|k| (0..k).map(move |l| (l, k)));
        let pairs: Vec<(usize, usize)> = pairs.filter(is_open).collect();
        let measured: Vec<PairHypothesis> = pairs
            .par_iter()
            .with_max_len(1)
            .filter_map(|&(k, l)| {
                let ((i, pose_i), (j, pose_j)) = (placed[k], placed[l]);
                measure(coarse_views, i, j, &pose_i.inv_mul(&pose_j), edge)
            })
            .collect();
        let (mut kept, mut ambiguous) = (Placed::new(), Vec::new());
        for (index, &(view, pose)) in placed.iter().enumerate() {
            if self.is_clear[view] {
                kept.push((view, pose));
                continue;
            }
            let others: Placed = [&placed[..index], &placed[index + 1..]].concat();
            let own: Vec<PairHypothesis> =
                measured.iter().filter(|hypothesis| hypothesis.i == view || hypothesis.j == view).copied().collect();
            if self.has_rival(&others, view, &pose) || can_slip(coarse_views, &own, edge, TUNING.slide_samples) {
                ambiguous.push(view);
            } else if touching(self.coarse_set, &own) >= agglomerative::TUNING.touching {
                kept.push((view, pose));
            }
        }
        let clear_links = clear.iter().flat_map(|component| &component.hypotheses).copied();
        let component = (kept.len() > 1).then(|| self.component(kept, measured.into_iter().chain(clear_links)));
        Settled { component, ambiguous }
    }

    /// Whether a view could as well stand elsewhere.
    fn has_rival(&self, others: &[(usize, Motion)], view: usize, pose: &Motion) -> bool {
        let limit = TUNING.rival * self.balance_at(others, view, pose);
        let elsewhere = others.iter().flat_map(|(other, at)| self.proposed(*other, at, view));
        let mut elsewhere = elsewhere.filter(|rival| !self.is_same(view, rival, pose));
        elsewhere.any(|rival| self.balance_at(others, view, &rival) > limit)
    }

    fn component(&self, kept: Placed, measured: impl Iterator<Item = PairHypothesis>) -> Component {
        let (views, local_poses): (Vec<usize>, Vec<Motion>) = kept.into_iter().unzip();
        let holds = |hypothesis: &PairHypothesis| {
            hypothesis.is_promising() && views.contains(&hypothesis.i) && views.contains(&hypothesis.j)
        };
        let hypotheses = measured.filter(holds).collect();
        let mut component = Component { views, local_poses, hypotheses, search: 0 };
        component.average(self.coarse_set.coarse_views, self.coarse_set.edge);
        component
    }
}

/// The view whose best place is ahead of its next best by most, and that place.
fn clearest(waiting: &[Waiting]) -> Option<(usize, Motion)> {
    let mut best: Option<(f64, usize, Motion)> = None;
    for (index, Waiting { places, .. }) in waiting.iter().enumerate() {
        let Some(first) = places.iter().max_by(|a, b| a.balance.total_cmp(&b.balance)) else { continue };
        let others = places.iter().filter(|place| !std::ptr::eq(*place, first));
        let second = others.map(|place| place.balance).fold(0.0, f64::max);
        let is_clear = first.balance >= TUNING.least && second < TUNING.rival * first.balance;
        if is_clear && best.is_none_or(|(lead, ..)| first.balance - second > lead) {
            best = Some((first.balance - second, index, first.pose));
        }
    }
    best.map(|(_, index, pose)| (index, pose))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};

    #[test]
    fn a_wrong_pair_is_outweighed_by_what_all_pairs_say() {
        let fixture = Fixture::from_around(&[0.0, 60.0, 120.0]);
        let coarse_set = fixture.coarse_set();
        // the first and the last laid on each other, and two pairs as they are
        let hypotheses = [fixture.hypothesis(0, 2, Motion::identity()), fixture.right(0, 1), fixture.right(1, 2)];
        let grown = grow(&coarse_set, &hypotheses, &Known::default(), &Progress::silent()).expect("not cancelled");
        assert_eq!(grown.components.len(), 1);
        assert_eq!((grown.components[0].views.clone(), grown.ambiguous), (vec![0, 1, 2], vec![false; 3]));
        let component = &grown.components[0];
        let found = component.local_poses[0].inv_mul(&component.local_poses[2]);
        assert!(fixture.off(0, 2, &found) < 0.5 * EDGE, "{found}");
        let none = grow(&coarse_set, &[], &Known::default(), &Progress::silent()).expect("not cancelled");
        assert!(none.components.is_empty());
    }
}
