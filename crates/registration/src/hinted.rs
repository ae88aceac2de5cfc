//! Hints as the views of a set see them: local frames and places in the list instead of names.

use crate::hints::{Hints, PickFit, Place, pick_distances};
use crate::view::View;
use visage_geometry::{Motion, Vector3};

/// What was said of pairs of views.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hinted {
    /// Pairs with picked points.
    pub picked: Vec<PickedPair>,
    /// Pairs `i < j` that are said to overlap.
    pub overlapping: Vec<(usize, usize)>,
    /// Views of which a part was cut away: that nothing is there says nothing of what was scanned.
    pub cut: Vec<usize>,
}

/// Two views, `i < j`, with places that are the same.
#[derive(Debug, Clone, PartialEq)]
pub struct PickedPair {
    /// The view whose frame is the target.
    pub i: usize,
    /// The view that is mapped.
    pub j: usize,
    /// The places in the local frames of both.
    pub places: Vec<[Place; 2]>,
    /// The motion that they fix, from view j's local frame to view i's.
    pub fit: PickFit,
    /// How far they may lie apart where the motion is right, root mean square.
    pub tolerance: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A place on a scan is picked this well, in radii of the view, whatever the other picks say.
        picked_within: f64 = 0.06,
        /// Picks that lie apart by this many times what their misfit shows are no picks of that motion.
        misfit: f64 = 2.0,
    }
}

impl Hinted {
    /// What `hints` say of views with these names. Names that are not there were refused before.
    pub fn of(hints: &Hints, names: &[String], views: &[View]) -> Self {
        let place = |name: &String| names.iter().position(|other| other == name);
        let pair = |a: &String, b: &String| place(a).zip(place(b)).filter(|(a, b)| a != b);
        let mut hinted = Hinted::default();
        for [a, b] in &hints.overlaps {
            let Some((a, b)) = pair(a, b) else { continue };
            hinted.overlapping.push((a.min(b), a.max(b)));
        }
        hinted.overlapping.sort_unstable();
        hinted.overlapping.dedup();
        hinted.cut = hints.regions.iter().filter_map(|region| place(&region.scan)).collect();
        let mut collected: std::collections::BTreeMap<(usize, usize), Vec<[Place; 2]>> = Default::default();
        for picked in &hints.points {
            let Some((a, b)) = pair(&picked.a, &picked.b) else { continue };
            let local = |view: usize, place: Place| -> Place {
                (Vector3::from(place) * views[view].scale - views[view].center).into()
            };
            let of_pair = collected.entry((a.min(b), a.max(b))).or_default();
            of_pair.extend(picked.pairs.iter().map(|[in_a, in_b]| {
                let (in_a, in_b) = (local(a, *in_a), local(b, *in_b));
                if a < b { [in_a, in_b] } else { [in_b, in_a] }
            }));
        }
        for ((i, j), places) in collected {
            let Some(fit) = PickFit::of(&places) else { continue };
            let least = TUNING.picked_within * views[i].radius.min(views[j].radius);
            let tolerance = least.max(TUNING.misfit * fit.pick_error(places.len()));
            hinted.picked.push(PickedPair { i, j, places, fit, tolerance });
        }
        hinted
    }

    /// What is said of the views `rest`, which rise, named by their place there.
    pub fn among(&self, rest: &[usize]) -> Hinted {
        let place = |view: usize| rest.iter().position(|other| *other == view);
        let named = |pair: &PickedPair| Some(PickedPair { i: place(pair.i)?, j: place(pair.j)?, ..pair.clone() });
        Hinted {
            picked: self.picked.iter().filter_map(named).collect(),
            overlapping: self.overlapping.iter().filter_map(|&(i, j)| place(i).zip(place(j))).collect(),
            cut: self.cut.iter().filter_map(|view| place(*view)).collect(),
        }
    }

    /// The motion that picked points fix for a pair, view j's local frame to view i's.
    pub fn motion(&self, i: usize, j: usize) -> Option<Motion> {
        self.picked.iter().find(|pair| (pair.i, pair.j) == (i, j)).map(|pair| pair.fit.a_from_b)
    }

    /// Whether a pair is said to overlap; picked points say it too.
    pub fn is_overlapping(&self, i: usize, j: usize) -> bool {
        self.overlapping.contains(&(i, j)) || self.picked.iter().any(|pair| (pair.i, pair.j) == (i, j))
    }

    /// Whether all picked points lie on each other at these poses.
    pub fn is_met(&self, local_poses: &[Motion], placed: &[bool]) -> bool {
        let is_met = |pair: &PickedPair| {
            placed[pair.i] && placed[pair.j] && pair.is_met(&local_poses[pair.i].inv_mul(&local_poses[pair.j]))
        };
        self.picked.iter().all(is_met)
    }
}

impl PickedPair {
    /// Root mean square and largest distance of the picked places at a motion.
    pub fn distances(&self, i_from_j: &Motion) -> (f64, f64) {
        pick_distances(&self.places, i_from_j)
    }

    /// Whether the picked places lie on each other at a motion, as well as a person picks.
    pub fn is_met(&self, i_from_j: &Motion) -> bool {
        self.distances(i_from_j).0 <= self.tolerance
    }
}
