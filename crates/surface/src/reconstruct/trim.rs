//! What of a closed surface is kept: what was seen, and the holes that may be closed.

use std::collections::BTreeMap;

use super::extract::Triangles;
use super::field::REACH;
use super::rims::close_short;
use super::samples::Samples;
use visage_geometry::UnionFind;
use visage_geometry::names::UnknownName;
use visage_geometry::neighbours::IndexedPoints;

/// What becomes of surface that nobody saw.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case", parse_err_ty = UnknownName, parse_err_fn = no_fill)]
pub enum Fill {
    /// Holes are closed that are hardly wider than what the scans resolve.
    #[default]
    Small,
    /// It is left out.
    None,
    /// All holes are closed: the surface is that of a solid.
    All,
}

impl Fill {
    /// Every choice, the default first.
    pub const ALL: &[Fill] = <Fill as strum::VariantArray>::VARIANTS;

    /// The name used in options and messages.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_fill(text: &str) -> UnknownName {
    UnknownName::of::<Fill>("kind of filling", text)
}

/// A vertex was seen if the points around weigh this much: one of them at its place, or several farther off. In the
/// middle of what a single scan sees they weigh some ten times as much, at grazing angles two times.
pub(super) const SEEN: f32 = 1.0;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The support is levelled in so many rounds, each between neighbours,
        rounds: usize = 2,
        /// up to so many times [`SEEN`].
        plenty: f32 = 2.0,
        /// and raised to so many times its own, at most.
        raised: f32 = 100.0,
        /// A piece of surface of its own is dropped if its area, in squared cells, is smaller than this: points that were not told
        /// from the object make such pieces.
        least_area: f64 = 60.0,
        /// Where all holes are closed a piece is kept if its area is this share of the largest's.
        least_share: f64 = 0.02,
    }
}

/// What was kept.
#[derive(Debug, Clone)]
pub struct Kept {
    /// The surface.
    pub triangles: Triangles,
    /// Patches that nobody saw and that were closed.
    pub closed: usize,
    /// Patches that nobody saw and that were left open.
    pub open: usize,
    /// Pieces that were dropped because they were small.
    pub dropped: usize,
}

/// Keeps of a closed surface what `fill` says. Unseen patches of which no place is farther than `reach` cells from data
/// count as small, and so do rims that are shorter than twice that.
pub fn trim(mut triangles: Triangles, samples: &Samples, fill: Fill, reach: f32) -> Kept {
    smooth_support(&mut triangles);
    let (triangles, dropped) = without_small_pieces(triangles, fill);
    let patches = patches(&triangles);
    let is_closed: Vec<bool> = match fill {
        Fill::All => vec![true; patches.count],
        Fill::None => vec![false; patches.count],
        Fill::Small => within_reach(&triangles, &patches, samples, reach),
    };
    let closed = is_closed.iter().filter(|closed| **closed).count();
    let triangles = cut(triangles, |face| patches.of_face[face].is_some_and(|patch| !is_closed[patch]));
    // what is left of a piece may be too small
    let (mut triangles, dropped_then) = match fill {
        Fill::All => (triangles, 0),
        _ => without_small_pieces(triangles, fill),
    };
    let mouths = if fill == Fill::Small { close_short(&mut triangles, 2.0 * reach) } else { 0 };
    let (closed, dropped) = ((closed + mouths).min(patches.count), dropped + dropped_then);
    Kept { triangles, closed, open: patches.count - closed, dropped }
}

/// Levels the support along the rim of the data, whose last points lie here and there: the line on which it is cut
/// becomes clean. Beyond a few times [`SEEN`] more support makes no difference; where there is none, none arises.
fn smooth_support(triangles: &mut Triangles) {
    let own = triangles.support.clone();
    for _ in 0..TUNING.rounds {
        let mut sums = vec![[0.0f32; 2]; triangles.vertices.len()];
        for face in &triangles.faces {
            let sum: f32 = face.iter().map(|v| triangles.support[*v as usize].min(TUNING.plenty * SEEN)).sum();
            for v in face {
                let sums = &mut sums[*v as usize];
                *sums = [sums[0] + sum, sums[1] + 3.0];
            }
        }
        for ((support, own), [sum, count]) in triangles.support.iter_mut().zip(&own).zip(sums) {
            if *support < TUNING.plenty * SEEN && count > 0.0 {
                *support = (sum / count).min(TUNING.raised * own);
            }
        }
    }
}

fn area(triangles: &Triangles, face: &[u32; 3]) -> f64 {
    let [a, b, c] = face.map(|v| nalgebra::Vector3::from(triangles.vertices[v as usize]));
    f64::from((b - a).cross(&(c - a)).norm()) / 2.0
}

/// A piece of surface of its own.
#[derive(Debug, Clone, Copy, Default)]
struct Piece {
    /// Area that was seen, in squared cells: what nobody saw says nothing for a piece.
    seen: f64,
    /// Six times the volume that it encloses: below 0 where it is the surface of a void.
    volume_6: f64,
}

/// Without the pieces that are too small to be told from outliers and, where all holes are closed, without those of voids within
/// what is solid: a scanner saw in there through an opening, and of that nothing is known.
fn without_small_pieces(triangles: Triangles, fill: Fill) -> (Triangles, usize) {
    let mut joined = UnionFind::new(triangles.vertices.len());
    for [a, b, c] in &triangles.faces {
        joined.join(*a as usize, *b as usize);
        joined.join(*b as usize, *c as usize);
    }
    let mut pieces: BTreeMap<usize, Piece> = BTreeMap::new();
    for face in &triangles.faces {
        let is_seen = face.iter().any(|v| triangles.support[*v as usize] >= SEEN);
        let piece = pieces.entry(joined.find(face[0] as usize)).or_default();
        piece.seen += if is_seen { area(&triangles, face) } else { 0.0 };
        let [a, b, c] = face.map(|v| nalgebra::Vector3::from(triangles.vertices[v as usize]).cast::<f64>());
        piece.volume_6 += a.dot(&b.cross(&c));
    }
    let largest = pieces.values().map(|piece| piece.seen).fold(0.0, f64::max);
    let is_kept = |piece: &Piece| match fill {
        Fill::All => piece.seen >= TUNING.least_share * largest && (piece.volume_6 >= 0.0 || piece.seen == largest),
        Fill::Small | Fill::None => piece.seen >= TUNING.least_area.min(0.5 * largest),
    };
    let dropped = pieces.values().filter(|piece| !is_kept(piece)).count();
    if dropped == 0 {
        return (triangles, 0);
    }
    let kept: Vec<bool> = triangles.faces.iter().map(|face| is_kept(&pieces[&joined.find(face[0] as usize)])).collect();
    (with_faces(triangles, |face| kept[face]), dropped)
}

/// The unseen patches: faces that hang together by unseen vertices.
struct Patches {
    count: usize,
    /// For each face the patch that it belongs to.
    of_face: Vec<Option<usize>>,
}

fn patches(triangles: &Triangles) -> Patches {
    let is_unseen = |v: u32| triangles.support[v as usize] < SEEN;
    let mut joined = UnionFind::new(triangles.vertices.len());
    for face in &triangles.faces {
        let unseen: Vec<usize> = face.iter().filter(|v| is_unseen(**v)).map(|v| *v as usize).collect();
        for pair in unseen.windows(2) {
            joined.join(pair[0], pair[1]);
        }
    }
    let mut names: BTreeMap<usize, usize> = BTreeMap::new();
    let of_face = triangles
        .faces
        .iter()
        .map(|face| {
            let root = joined.find(*face.iter().find(|v| is_unseen(**v))? as usize);
            let next = names.len();
            Some(*names.entry(root).or_insert(next))
        })
        .collect();
    Patches { count: names.len(), of_face }
}

/// For each patch whether data is near all of it.
fn within_reach(triangles: &Triangles, patches: &Patches, samples: &Samples, reach: f32) -> Vec<bool> {
    let indexed = IndexedPoints::new(samples.samples.iter().map(|sample| sample.place).collect());
    let mut is_near = vec![true; patches.count];
    let mut is_known: Vec<Option<bool>> = vec![None; triangles.vertices.len()];
    for (face, patch) in triangles.faces.iter().zip(&patches.of_face) {
        let Some(patch) = patch else { continue };
        for v in face.map(|v| v as usize) {
            if !is_near[*patch] {
                break;
            }
            // a vertex with some weight has a sample within the field's reach
            let near = *is_known[v].get_or_insert_with(|| {
                (triangles.support[v] > 0.0 && reach >= REACH)
                    || indexed.tree.has_within(&triangles.vertices[v], reach * reach)
            });
            is_near[*patch] &= near;
        }
    }
    is_near
}

/// Cuts the faces for which `is_cut` holds along the line where data ends.
fn cut(triangles: Triangles, is_cut: impl Fn(usize) -> bool) -> Triangles {
    let mut found = Triangles { faces: Vec::new(), ..triangles.clone() };
    let mut between: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for (index, face) in triangles.faces.iter().enumerate() {
        if !is_cut(index) {
            found.faces.push(*face);
            continue;
        }
        let is_seen = face.map(|v| triangles.support[v as usize] >= SEEN);
        let mut polygon: Vec<u32> = Vec::new();
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            if is_seen[k] {
                polygon.push(a);
            }
            if is_seen[k] != is_seen[(k + 1) % 3] {
                polygon.push(
                    *between.entry((a.min(b), a.max(b))).or_insert_with(|| found.add_between(a.min(b), a.max(b))),
                );
            }
        }
        if polygon.len() >= 3 {
            found.faces.extend((1..polygon.len() - 1).map(|k| [polygon[0], polygon[k], polygon[k + 1]]));
        }
    }
    with_faces(found, |_| true)
}

impl Triangles {
    /// The share of the area that nobody saw.
    pub fn unseen_area(&self) -> f64 {
        let is_unseen = |face: &&[u32; 3]| face.iter().all(|v| self.support[*v as usize] < SEEN);
        let all: f64 = self.faces.iter().map(|face| area(self, face)).sum();
        (self.faces.iter().filter(is_unseen).map(|face| area(self, face)).sum::<f64>() + 0.0)
            / all.max(f64::MIN_POSITIVE)
    }

    /// A vertex on an edge where its support is [`SEEN`].
    fn add_between(&mut self, a: u32, b: u32) -> u32 {
        let (from, to) = (self.support[a as usize], self.support[b as usize]);
        let share = ((SEEN - from) / (to - from)).clamp(0.05, 0.95);
        let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
        self.vertices.push(std::array::from_fn(|k| p[k] + share * (q[k] - p[k])));
        self.support.push(SEEN);
        self.vertices.len() as u32 - 1
    }
}

/// The faces that are kept and the vertices that they need, in their order.
fn with_faces(triangles: Triangles, is_kept: impl Fn(usize) -> bool) -> Triangles {
    let mut places = vec![u32::MAX; triangles.vertices.len()];
    let faces: Vec<[u32; 3]> =
        triangles.faces.iter().enumerate().filter(|(k, _)| is_kept(*k)).map(|(_, face)| *face).collect();
    faces.iter().flatten().for_each(|v| places[*v as usize] = 0);
    let mut found = Triangles::default();
    for (v, place) in places.iter_mut().enumerate() {
        if *place == 0 {
            *place = found.vertices.len() as u32;
            found.vertices.push(triangles.vertices[v]);
            found.support.push(triangles.support[v]);
        }
    }
    found.faces = faces.into_iter().map(|face| face.map(|v| places[v as usize])).collect();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::grid::Blocks;

    /// Octahedra that were seen, each by its radius; those of negative radius are the surface of a void.
    fn octahedra(radii: &[f32]) -> Triangles {
        let faces = [[0, 1, 2], [1, 0, 5], [0, 2, 4], [2, 1, 3], [3, 4, 2], [4, 3, 5], [3, 1, 5], [4, 5, 0]];
        let mut found = Triangles::default();
        for radius in radii {
            let first = found.vertices.len() as u32;
            found.vertices.extend((0..6).map(|k: usize| {
                let mut place = [50.0; 3];
                place[k % 3] += if k < 3 { radius.abs() } else { -radius.abs() };
                place
            }));
            let turned = |[a, b, c]: [u32; 3]| if *radius < 0.0 { [a, c, b] } else { [a, b, c] };
            found.faces.extend(faces.map(|face| turned(face).map(|v| first + v)));
        }
        found.support = vec![10.0; found.vertices.len()];
        found
    }

    #[test]
    fn where_all_is_closed_a_void_is_filled_and_what_stands_beside_or_all_around_stays() {
        let nothing = Samples { samples: Vec::new(), blocks: Blocks::new(Vec::new(), Vec::new()) };
        let kept = |radii: &[f32], fill: Fill| {
            let kept = trim(octahedra(radii), &nothing, fill, 3.0);
            (kept.triangles.faces.len() / 8, kept.dropped)
        };
        assert_eq!(kept(&[20.0, -10.0], Fill::All), (1, 1));
        assert_eq!(kept(&[20.0, -10.0], Fill::Small), (2, 0), "what was seen is shown");
        assert_eq!(kept(&[20.0, 10.0], Fill::All), (2, 0), "a second thing");
        assert_eq!(kept(&[-20.0, 5.0], Fill::All), (2, 0), "a room and what stands in it");
        assert_eq!(kept(&[20.0, 1.0], Fill::All), (1, 1), "an outlier");
    }
}
