//! The corners of models' triangles, packed: what a triangle is made from when it is needed.
//!
//! A model with N salient regions has C(N, 3) triangles of them, and facial ones. Only the corners are kept; a
//! triangle is known by its number, first those of the regions in lexicographic order, then the facial ones.

use super::column::Column;
use super::columns::stored;
use super::triangles::{IndexedTriangle, Origin, canonical};
use bytemuck::{Pod, Zeroable};
use visage_geometry::{Point3, Vector3};
use visage_shape::faces::Signature;

/// Triangles are formed of this many regions at most, the strongest: their numbers then fit into 16 bits.
const MOST_REGIONS: usize = 64;
/// The same for facial triangles.
const MOST_FACIAL: usize = 4096;

/// A place on a model.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Corner {
    point: [f64; 3],
    /// Kept as signatures keep it.
    normal: [f32; 3],
    convex: u32,
}

impl Corner {
    fn new(point: &Point3, normal: &Vector3, convex: bool) -> Corner {
        Corner { point: (*point).into(), normal: normal.cast::<f32>().into(), convex: convex.into() }
    }

    fn segments(&self) -> (Point3, Vector3, bool) {
        (self.point.into(), Vector3::from(self.normal.map(f64::from)), self.convex == 1)
    }
}

/// What one model's outline holds beside its corners.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    /// Where its corners begin; the regions come first.
    corners: u64,
    /// Where its facial triangles begin.
    facial: u64,
    regions: u64,
    radius: f64,
}

/// The outlines of a list of models.
#[derive(Debug, Default)]
pub(super) struct Outlines {
    headers: Column<Header>,
    corners: Column<Corner>,
    /// Corners by place among the model's, of every facial triangle.
    facial: Column<[u16; 3]>,
}

stored!(Outlines { headers, corners, facial });

impl Outlines {
    /// Adds a model's.
    pub fn push(&mut self, signature: &Signature) {
        let (first, facial) = (self.corners.len(), self.facial.len());
        let regions = signature.regions().take(MOST_REGIONS);
        self.corners.extend(regions.map(|r| Corner::new(&r.center, &r.normal, r.mean_curvature > 0.0)));
        let regions = (self.corners.len() - first) as u64;
        let (corners, facial) = (first as u64, facial as u64);
        self.headers.push(Header { corners, facial, regions, radius: signature.radius() });
        let shared = self.corners.len();
        for candidate in signature.candidates().take(MOST_FACIAL) {
            let triangle = [0, 1, 2].map(|k| Corner::new(&candidate.corners[k], &candidate.normals[k], k == 2));
            self.facial.push(triangle.map(|corner| {
                // the same pits and caps make many facial triangles
                let known = self.corners[shared..].iter().position(|other| *other == corner);
                let place = shared + known.unwrap_or(self.corners.len() - shared);
                if known.is_none() {
                    self.corners.push(corner);
                }
                (place - first) as u16
            }));
        }
    }

    /// Adds one from another list.
    pub fn push_from(&mut self, others: &Outlines, place: u32) {
        let other = others.outline(place);
        self.headers.push(Header {
            corners: self.corners.len() as u64,
            facial: self.facial.len() as u64,
            regions: other.regions as u64,
            radius: other.radius,
        });
        self.corners.extend(other.corners.iter().copied());
        self.facial.extend(other.facial.iter().copied());
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.headers.len()
    }

    /// The outline at a place.
    pub fn outline(&self, place: u32) -> Outline<'_> {
        let place = place as usize;
        let header = self.headers[place];
        let (corners, facial) = match self.headers.get(place + 1) {
            Some(next) => (next.corners as usize, next.facial as usize),
            None => (self.corners.len(), self.facial.len()),
        };
        Outline {
            corners: &self.corners[header.corners as usize..corners],
            facial: &self.facial[header.facial as usize..facial],
            regions: header.regions as usize,
            radius: header.radius,
        }
    }

    /// Gives back what was reserved but not used.
    pub fn shrink(&mut self) {
        self.headers.shrink();
        self.corners.shrink();
        self.facial.shrink();
    }

    /// Whether each model's part is one, and the parts lie one after the other.
    pub fn is_sound(&self) -> bool {
        let end = (self.corners.len() as u64, self.facial.len() as u64, 0);
        let starts = self.headers.iter().map(|h| (h.corners, h.facial, h.regions)).chain([end]);
        let mut before: Option<(u64, u64, u64)> = None;
        starts.into_iter().all(|(corners, facial, regions)| {
            let (first_corner, first_facial, of_regions) =
                before.replace((corners, facial, regions)).unwrap_or_default();
            let corners = corners.checked_sub(first_corner);
            facial >= first_facial
                && of_regions <= MOST_REGIONS as u64
                && corners.is_some_and(|count| of_regions <= count)
        })
    }
}

/// The triangles of one model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outline<'a> {
    corners: &'a [Corner],
    facial: &'a [[u16; 3]],
    regions: usize,
    radius: f64,
}

impl Outline<'_> {
    /// The triangle with this number; `None` if it is degenerate (or there is none).
    pub fn triangle(&self, number: u16) -> Option<IndexedTriangle> {
        let number = usize::from(number);
        match nth_triple(self.regions, number) {
            Some(corners) => self.canonical(corners, Origin::Regions),
            None => {
                let facial = self.facial.get(number - choose_three(self.regions))?;
                self.canonical(facial.map(usize::from), Origin::Face)
            }
        }
    }

    /// The triangles of three regions that are not degenerate, with their numbers.
    pub fn of_regions(&self) -> impl Iterator<Item = (u16, IndexedTriangle)> + '_ {
        let count = self.regions;
        let triples =
            (0..count).flat_map(move |i| (i + 1..count).flat_map(move |j| (j + 1..count).map(move |k| [i, j, k])));
        let numbered = (0u16..).zip(triples);
        numbered.filter_map(|(number, corners)| Some((number, self.canonical(corners, Origin::Regions)?)))
    }

    /// All that are not degenerate, with their numbers.
    pub fn triangles(&self) -> impl Iterator<Item = (u16, IndexedTriangle)> + '_ {
        let first = choose_three(self.regions) as u16;
        let facial = (first..).zip(self.facial);
        let facial = facial
            .filter_map(|(number, corners)| Some((number, self.canonical(corners.map(usize::from), Origin::Face)?)));
        self.of_regions().chain(facial)
    }

    fn canonical(&self, corners: [usize; 3], origin: Origin) -> Option<IndexedTriangle> {
        let [a, b, c] = corners.map(|corner| self.corners.get(corner).map(Corner::segments));
        canonical([a?, b?, c?], self.radius, origin)
    }
}

fn choose_three(count: usize) -> usize {
    count * count.saturating_sub(1) * count.saturating_sub(2) / 6
}

/// The triple of `count` items that has this number in lexicographic order.
fn nth_triple(count: usize, number: usize) -> Option<[usize; 3]> {
    let mut rest = number;
    for i in 0..count {
        let later = count - 1 - i;
        let with_i = later * later.saturating_sub(1) / 2;
        if rest >= with_i {
            rest -= with_i;
            continue;
        }
        for j in i + 1..count {
            let with_j = count - 1 - j;
            if rest < with_j {
                return Some([i, j, j + 1 + rest]);
            }
            rest -= with_j;
        }
    }
    None
}

/// All triangles of a signature that are not degenerate.
#[cfg(test)]
pub(super) fn triangles_of(signature: &Signature) -> Vec<IndexedTriangle> {
    let mut outlines = Outlines::default();
    outlines.push(signature);
    outlines.outline(0).triangles().map(|(_, triangle)| triangle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::judgement::triples;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn triples_are_numbered_as_they_are_listed() {
        for count in [0, 2, 3, 4, 10, 13] {
            let items: Vec<usize> = (0..count).collect();
            for (number, triple) in triples(&items).enumerate() {
                assert_eq!(nth_triple(count, number), Some(triple));
            }
            assert_eq!(nth_triple(count, choose_three(count)), None);
        }
        assert!(choose_three(MOST_REGIONS) + MOST_FACIAL <= usize::from(u16::MAX));
    }

    #[test]
    fn every_triple_and_every_facial_triangle_is_there() {
        let all = triangles_of(&example(0.4, 10));
        assert_eq!(all.len(), 121);
        assert_eq!(all[120].origin, Origin::Face);
        assert!(all.iter().all(|t| t.shape.0.z >= 0.0 && (t.shape.0.norm() - 0.5).abs() < 1e-9));
    }

    #[test]
    fn a_number_gives_the_triangle_that_the_list_gives_also_when_moved_to_another_list() {
        let mut outlines = Outlines::default();
        for count in [4, 0, 9, 3] {
            outlines.push(&example(0.3, count));
        }
        let mut moved = Outlines::default();
        for place in [2, 3, 1] {
            moved.push_from(&outlines, place);
        }
        assert_eq!((outlines.len(), moved.len()), (4, 3));
        for (place, from) in [2, 3, 1].into_iter().enumerate() {
            let (moved, original) = (moved.outline(place as u32), outlines.outline(from));
            assert!(moved.triangles().eq(original.triangles()));
            assert!(original.triangles().all(|(number, triangle)| original.triangle(number) == Some(triangle)));
            assert_eq!(original.triangle(u16::MAX), None);
        }
    }
}
