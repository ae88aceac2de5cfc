//! Points far from the rest: specks in the air, bits of other things.

use super::survey::Survey;
use crate::geometry::neighbours::{IndexedPoints, LocalPoint, distance2};

/// Surfels within this many edges of each other hang together.
const LINK: f64 = 3.0;
/// A piece with this share of the points is no stray, however far off.
const PIECE: f64 = 0.002;
/// Nor is one that lies near the large pieces, since part of the object may be hidden between: speck by speck within the
/// first share of their extent, and almost as large as a piece within both together.
const NEAR: [f64; 2] = [0.1, 0.15];
/// A surfel with less than this share of the typical number of points about it holds nothing together.
const SPARSE: f64 = 0.12;
/// Points belong to the body within this many edges of its surfels,
const WITHIN: f64 = 2.0;
/// and within this share of its extent.
const BESIDE: f64 = 0.05;

/// What is left of a scan without strays.
pub struct Body {
    indexed: IndexedPoints,
    within2: f32,
}

impl Body {
    /// Whether a point belongs to it.
    pub fn reaches(&self, point: &LocalPoint) -> bool {
        self.indexed.tree.nearest(point, self.within2).is_some()
    }

    /// [`Body::reaches`] of each point. Points that follow each other mostly lie near the same surfel, so hardly any
    /// needs a search.
    pub fn reaches_each(&self, points: &[LocalPoint]) -> Vec<bool> {
        let mut last = None;
        let is_reached = |point: &LocalPoint| {
            let is_near = |index: usize| distance2(&self.indexed.points[index], point) < self.within2;
            if last.is_some_and(is_near) {
                return true;
            }
            let found = self.indexed.tree.nearest(point, self.within2);
            last = found.map(|neighbour| neighbour.index as usize);
            found.is_some()
        };
        points.iter().map(is_reached).collect()
    }
}

/// The surfels of `rest` without strays; `None` if there are none.
pub fn main_body(survey: &Survey, rest: &[usize]) -> Option<Body> {
    let points: Vec<LocalPoint> = rest.iter().map(|surfel| survey.indexed.points[*surfel]).collect();
    let indexed = IndexedPoints::new(points);
    let link2 = (LINK * survey.edge).powi(2) as f32;
    let held = holding(survey, rest, &indexed);
    let pieces = pieces(&indexed, &held, link2);
    let count = |piece: &[usize]| piece.iter().map(|k| f64::from(survey.counts[rest[*k]])).sum::<f64>();
    let total = count(&(0..rest.len()).collect::<Vec<_>>());
    let (large, small): (Vec<_>, Vec<_>) = pieces.into_iter().partition(|piece| count(piece) >= PIECE * total);
    if large.is_empty() {
        return None;
    }
    let at = |k: &usize| indexed.points[*k];
    let mut body: Vec<LocalPoint> = large.iter().flatten().map(at).collect();
    let trunk = IndexedPoints::new(body.clone());
    let extent = extent(&body);
    let is_near = |piece: &Vec<usize>| {
        let near2 = ((NEAR[0] + NEAR[1] * count(piece) / (PIECE * total)) * extent).powi(2) as f32;
        piece.iter().any(|k| trunk.tree.nearest(&at(k), near2.max(link2)).is_some())
    };
    body.extend(small.iter().filter(|piece| is_near(piece)).flatten().map(at));
    let within = (WITHIN * survey.edge).max(BESIDE * extent);
    let body = Body { indexed: IndexedPoints::new(body), within2: within.powi(2) as f32 };
    (!indexed.points.iter().all(|p| body.reaches(p))).then_some(body)
}

/// Which surfels have enough points about them to be surface.
fn holding(survey: &Survey, rest: &[usize], indexed: &IndexedPoints) -> Vec<bool> {
    let reach2 = (1.5 * survey.edge).powi(2) as f32;
    let around: Vec<u32> = indexed
        .points
        .iter()
        .map(|point| {
            let mut count = 0;
            indexed.tree.for_each_within(point, reach2, |n| count += survey.counts[rest[n.index as usize]]);
            count
        })
        .collect();
    let mut sorted = around.clone();
    sorted.sort_unstable();
    let typical = sorted.get(sorted.len() / 2).copied().unwrap_or(0);
    around.iter().map(|count| f64::from(*count) >= SPARSE * f64::from(typical)).collect()
}

/// Sets of surfels that hang together, each in order.
fn pieces(indexed: &IndexedPoints, held: &[bool], link2: f32) -> Vec<Vec<usize>> {
    let mut seen: Vec<bool> = held.iter().map(|held| !held).collect();
    let mut pieces = Vec::new();
    for first in 0..seen.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut piece = vec![first];
        let mut next = 0;
        while let Some(&surfel) = piece.get(next) {
            next += 1;
            indexed.tree.for_each_within(&indexed.points[surfel], link2, |n| {
                if !std::mem::replace(&mut seen[n.index as usize], true) {
                    piece.push(n.index as usize);
                }
            });
        }
        piece.sort_unstable();
        pieces.push(piece);
    }
    pieces
}

/// The diagonal of the box around the points.
fn extent(points: &[LocalPoint]) -> f64 {
    let side = |axis: usize| {
        let (least, most) = points.iter().fold((f32::MAX, f32::MIN), |(l, m), p| (l.min(p[axis]), m.max(p[axis])));
        most - least
    };
    f64::from(side(0).hypot(side(1)).hypot(side(2)))
}
