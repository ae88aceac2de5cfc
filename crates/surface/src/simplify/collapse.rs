//! A surface that becomes coarser edge by edge, the one that costs least first.

use rayon::prelude::*;

use super::fans::{Fans, Wedge};
use super::quadric::Quadric;
use super::queue::Queue;
use crate::SurfaceMesh;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Bounds, Mesh, Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// How far the normal of a triangle may be off, as its sine: a vertex on a plane is held to where it is by so much, and triangles
        /// become as large as the bend of the surface lets them.
        normal_noise: f64 = 0.01,
        /// How much more a rim weighs than a surface: what leaves it is seen at once.
        rim: f64 = 4.0,
        /// The least cosine between the normals of a triangle before and after.
        least_turn: f64 = 0.2,
        /// The least height of a triangle by its longest edge, unless it was less before.
        least_height: f64 = 0.02,
        /// How far from its edge a new vertex may be, in lengths of the edge.
        farthest: f64 = 2.0,
    }
}
/// Edges between two looks at the flag that stops.
const PATIENCE: usize = 1 << 13;

/// What a vertex may not do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Freedom {
    /// It is inside of the surface.
    Inner,
    /// It is on a rim.
    Rim,
    /// The surface is no surface here: nothing is changed.
    Locked,
}

/// An edge that may become a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Candidate {
    a: u32,
    b: u32,
    /// The versions of its vertices when it was judged.
    versions: u32,
}

/// A surface that becomes coarser.
#[derive(Debug, Clone)]
pub(super) struct Collapser {
    center: Vector3,
    fans: Fans,
    places: Vec<Vector3>,
    quadrics: Vec<Quadric>,
    colors: Option<Vec<[f32; 3]>>,
    support: Option<Vec<f32>>,
    freedom: Vec<Freedom>,
    versions: Vec<u32>,
    /// By which edge a vertex was looked at last.
    marks: Vec<u32>,
    mark: u32,
    queue: Queue<Candidate>,
    /// Candidates that were refused, with their costs: too far off, or in the way of what is around them as that was.
    refused: Vec<(f32, Candidate)>,
}

impl Collapser {
    pub(super) fn new(surface: &SurfaceMesh) -> Collapser {
        let mesh = &surface.mesh;
        let center = Bounds::of(&mesh.vertices).map_or(Vector3::zeros(), |bounds| bounds.center().coords);
        let places: Vec<Vector3> = mesh.vertices.iter().map(|vertex| vertex.coords - center).collect();
        let fans = Fans::new(&mesh.faces, places.len());
        let mut made = Collapser {
            center,
            quadrics: quadrics(&fans, &places),
            freedom: vec![Freedom::Inner; places.len()],
            versions: vec![0; places.len()],
            marks: vec![0; places.len()],
            mark: 0,
            colors: surface.colors.as_ref().map(|colors| colors.iter().map(|color| color.map(f32::from)).collect()),
            support: surface.support.clone(),
            queue: Queue::new(),
            refused: Vec::new(),
            places,
            fans,
        };
        made.begin();
        made
    }

    /// Becomes coarser until there are no more than so many triangles, or nothing is left that stays within a mean distance
    /// of `reach` of the planes that it was.
    pub(super) fn reduce(&mut self, triangles: usize, reach: f64, progress: &Progress) -> Result<(), Canceled> {
        let limit = reach * reach;
        let (mut of_a, mut of_b) = (Vec::new(), Vec::new());
        let mut looked_at = 0usize;
        loop {
            // what was refused may be possible by now
            for (cost, candidate) in std::mem::take(&mut self.refused) {
                self.queue.push(cost, candidate);
            }
            let before = self.fans.living();
            while self.fans.living() > triangles {
                let Some(next) = self.queue.pop() else { break };
                if looked_at.is_multiple_of(PATIENCE) {
                    progress.check()?;
                }
                looked_at += 1;
                let Candidate { a, b, versions } = next;
                if versions != self.versions(a, b) {
                    continue;
                }
                let joint = self.joint(a, b);
                self.fans.around(a, &mut of_a);
                self.fans.around(b, &mut of_b);
                if joint.mean <= limit
                    && self.stays_a_surface(a, b, &of_a, &of_b)
                    && self.stays_upright(a, b, &joint.place, &of_a, &of_b)
                {
                    self.collapse(a, b, &joint, &of_a, &of_b);
                } else {
                    self.refused.push((joint.cost as f32, next));
                }
            }
            // another pass must bring a hundredth
            if self.fans.living() <= triangles || (before - self.fans.living()) * 100 < before {
                return Ok(());
            }
        }
    }

    /// The surface as it is now.
    pub(super) fn surface(&self) -> SurfaceMesh {
        let byte = |value: &f32| value.round().clamp(0.0, 255.0) as u8;
        let whole = SurfaceMesh {
            mesh: Mesh {
                vertices: self.places.iter().map(|place| Point3::from(place + self.center)).collect(),
                faces: self.fans.faces().collect(),
            },
            colors: self.colors.as_ref().map(|colors| colors.iter().map(|color| color.each_ref().map(byte)).collect()),
            support: self.support.clone(),
        };
        whole.kept(|_| true)
    }

    /// Finds rims and what is no surface, and judges all edges.
    fn begin(&mut self) {
        let edges = edges(&self.fans, self.places.len());
        for Edge { ends, kind, face } in &edges {
            let freedom = match kind {
                EdgeKind::Inner => continue,
                EdgeKind::Rim => {
                    self.hold_rim(*ends, *face);
                    Freedom::Rim
                }
                EdgeKind::Branch => Freedom::Locked,
            };
            for end in ends {
                let of_end = &mut self.freedom[*end as usize];
                if *of_end != Freedom::Locked {
                    *of_end = freedom;
                }
            }
        }
        let this = &*self;
        let candidates: Vec<(f32, Candidate)> =
            edges.par_iter().with_min_len(1024).filter_map(|edge| this.candidate(edge.ends[0], edge.ends[1])).collect();
        self.refused = candidates;
    }

    /// Holds the ends of a rim's edge to the plane through it that is square to its triangle.
    fn hold_rim(&mut self, [a, b]: [u32; 2], face: u32) {
        let (from, to) = (self.places[a as usize], self.places[b as usize]);
        let along = to - from;
        let corners = self.fans.face(face).map(|vertex| self.places[vertex as usize]);
        let normal = area_normal(&corners);
        let Some(side) = normal.cross(&along).try_normalize(0.0) else { return };
        let plane = Quadric::plane(&side, &from, TUNING.rim * along.norm_squared()).weightless();
        for end in [a, b] {
            self.quadrics[end as usize] = self.quadrics[end as usize].plus(&plane);
        }
    }

    fn versions(&self, a: u32, b: u32) -> u32 {
        self.versions[a as usize].wrapping_add(self.versions[b as usize])
    }

    /// An edge with its cost, unless it has to stay.
    fn candidate(&self, a: u32, b: u32) -> Option<(f32, Candidate)> {
        let (a, b) = (a.min(b), a.max(b));
        let is_free = |vertex: u32| self.freedom[vertex as usize] != Freedom::Locked;
        if !(is_free(a) && is_free(b)) {
            return None;
        }
        let cost = self.joint(a, b).cost as f32;
        cost.is_finite().then(|| (cost, Candidate { a, b, versions: self.versions(a, b) }))
    }

    /// The vertex that an edge would become.
    #[inline]
    fn joint(&self, a: u32, b: u32) -> Joint {
        let (at_a, at_b) = (&self.places[a as usize], &self.places[b as usize]);
        let quadric = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        let place = match [a, b].map(|end| self.freedom[end as usize]) {
            // a rim stays where it is
            [Freedom::Rim, Freedom::Inner] => *at_a,
            [Freedom::Inner, Freedom::Rim] => *at_b,
            _ => {
                let middle = (at_a + at_b) / 2.0;
                let most = TUNING.farthest * TUNING.farthest * (at_a - at_b).norm_squared();
                let least = quadric.least().filter(|place| (place - middle).norm_squared() <= most);
                least.unwrap_or_else(|| {
                    let by_cost = |x: &&Vector3, y: &&Vector3| quadric.at(x).total_cmp(&quadric.at(y));
                    [&middle, at_a, at_b].into_iter().min_by(by_cost).copied().unwrap_or(middle)
                })
            }
        };
        let cost = quadric.at(&place);
        Joint { place, cost, mean: quadric.mean(cost), quadric }
    }

    /// The link condition (Dey et al. 1999): the edge's ends have no other neighbours in common than those of its triangles.
    fn stays_a_surface(&mut self, a: u32, b: u32, of_a: &[Wedge], of_b: &[Wedge]) -> bool {
        let shared = || of_b.iter().filter(|wedge| wedge.others.contains(&a));
        let is_rim = |vertex: u32| self.freedom[vertex as usize] == Freedom::Rim;
        let kind = (shared().count(), is_rim(a) && is_rim(b));
        if !matches!(kind, (1, true) | (2, false)) {
            return false;
        }
        // what would be left of a vertex opposite must have a triangle on either side of each of its edges
        for opposite in shared().flat_map(|wedge| wedge.others).filter(|vertex| *vertex != a) {
            let least = if is_rim(opposite) { 2 } else { 4 };
            if self.fans.count(opposite) < least {
                return false;
            }
        }
        // one mark for neighbours of a, the next for those that b has too
        self.fresh_mark();
        for vertex in of_a.iter().flat_map(|wedge| wedge.others) {
            self.marks[vertex as usize] = self.mark;
        }
        let mut in_common = 0;
        for vertex in of_b.iter().flat_map(|wedge| wedge.others) {
            let mark = &mut self.marks[vertex as usize];
            if *mark == self.mark {
                *mark = self.mark + 1;
                in_common += 1;
            }
        }
        in_common == kind.0
    }

    /// Two marks that no vertex has.
    fn fresh_mark(&mut self) {
        if self.mark >= u32::MAX - 3 {
            self.marks.fill(0);
            self.mark = 0;
        }
        self.mark += 2;
    }

    /// Whether no triangle is turned over when `a` and `b` are at `place`, and none becomes a worse sliver than there was.
    fn stays_upright(&self, a: u32, b: u32, place: &Vector3, of_a: &[Wedge], of_b: &[Wedge]) -> bool {
        let corners = |own: &Vector3, wedge: &Wedge| {
            let [second, third] = wedge.others.map(|vertex| self.places[vertex as usize]);
            [*own, second, third]
        };
        let (at_a, at_b) = (&self.places[a as usize], &self.places[b as usize]);
        let of_both = || of_a.iter().map(|wedge| (at_a, b, wedge)).chain(of_b.iter().map(|wedge| (at_b, a, wedge)));
        // the normal of a sliver says nothing: that of all around it does
        let (mut all, mut least_height) = (Vector3::zeros(), TUNING.least_height);
        for (own, _, wedge) in of_both() {
            let before = corners(own, wedge);
            let normal = area_normal(&before);
            all += normal;
            least_height = least_height.min(height(&normal, &before));
        }
        of_both().filter(|(_, other, wedge)| !wedge.others.contains(other)).all(|(own, _, wedge)| {
            let (before, after) = (corners(own, wedge), corners(place, wedge));
            let (old, new) = (area_normal(&before), area_normal(&after));
            let is_sliver = height(&old, &before) < TUNING.least_height;
            let right = if is_sliver { &all } else { &old };
            let turn = new.dot(right);
            height(&new, &after) >= least_height
                && turn >= 0.0
                && turn * turn >= TUNING.least_turn * TUNING.least_turn * right.norm_squared() * new.norm_squared()
        })
    }

    fn collapse(&mut self, a: u32, b: u32, joint: &Joint, of_a: &[Wedge], of_b: &[Wedge]) {
        let (kept, gone) = (a as usize, b as usize);
        let along = self.places[gone] - self.places[kept];
        let share = (joint.place - self.places[kept]).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
        let share = share.clamp(0.0, 1.0) as f32;
        if let Some(colors) = &mut self.colors {
            let other = colors[gone];
            colors[kept].iter_mut().zip(other).for_each(|(own, other)| *own += share * (other - *own));
        }
        if let Some(support) = &mut self.support {
            support[kept] += share * (support[gone] - support[kept]);
        }
        self.places[kept] = joint.place;
        self.quadrics[kept] = joint.quadric;
        if self.freedom[gone] == Freedom::Rim {
            self.freedom[kept] = Freedom::Rim;
        }
        self.versions[kept] = self.versions[kept].wrapping_add(1);
        self.fans.unite(a, b, of_a, of_b);
        // each neighbour once
        self.fresh_mark();
        for vertex in of_a.iter().chain(of_b).flat_map(|wedge| wedge.others) {
            if vertex == a || vertex == b || self.marks[vertex as usize] == self.mark {
                continue;
            }
            self.marks[vertex as usize] = self.mark;
            if let Some((cost, candidate)) = self.candidate(a, vertex) {
                self.queue.push(cost, candidate);
            }
        }
    }
}

/// The vertex that an edge would become.
struct Joint {
    place: Vector3,
    /// The order is by this: distances count by the area that is off.
    cost: f64,
    /// The mean square distance from the planes that the vertex stands for.
    mean: f64,
    quadric: Quadric,
}

/// What an edge is to the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EdgeKind {
    /// Two triangles meet, passing it in either direction.
    Inner,
    /// It has one triangle.
    Rim,
    /// It has more, or they are wound against each other.
    Branch,
}

/// An edge with one of its triangles.
struct Edge {
    ends: [u32; 2],
    kind: EdgeKind,
    face: u32,
}

/// All edges, in the order of their lower vertices.
fn edges(fans: &Fans, vertices: usize) -> Vec<Edge> {
    const CHUNK: usize = 1 << 12;
    let of_chunk = |chunk: usize| {
        let mut found = Vec::new();
        // the far end, a triangle, and how often it is passed away from the vertex and towards it
        let mut ends: Vec<(u32, u32, [u8; 2])> = Vec::new();
        for vertex in (chunk * CHUNK..((chunk + 1) * CHUNK).min(vertices)).map(|vertex| vertex as u32) {
            ends.clear();
            fans.each_around(vertex, |wedge| {
                for (direction, end) in wedge.others.into_iter().enumerate().filter(|(_, end)| *end > vertex) {
                    let known = match ends.iter().position(|known| known.0 == end) {
                        Some(known) => known,
                        None => {
                            ends.push((end, wedge.corner / 3, [0; 2]));
                            ends.len() - 1
                        }
                    };
                    let count = &mut ends[known].2[direction];
                    *count = count.saturating_add(1);
                }
            });
            found.extend(ends.iter().map(|(end, face, counts)| {
                let kind = match counts {
                    [1, 1] => EdgeKind::Inner,
                    [1, 0] | [0, 1] => EdgeKind::Rim,
                    _ => EdgeKind::Branch,
                };
                Edge { ends: [vertex, *end], kind, face: *face }
            }));
        }
        found
    };
    let chunks: Vec<Vec<Edge>> = (0..vertices.div_ceil(CHUNK)).into_par_iter().map(of_chunk).collect();
    chunks.into_iter().flatten().collect()
}

/// For each vertex the planes of its triangles, and what holds it to its place where these don't.
fn quadrics(fans: &Fans, places: &[Vector3]) -> Vec<Quadric> {
    let of_vertex = |vertex: usize| {
        let mut sum = Quadric::default();
        let mut areas = 0.0;
        fans.each_around(vertex as u32, |wedge| {
            let corners = fans.face(wedge.corner / 3).map(|corner| places[corner as usize]);
            let normal = area_normal(&corners);
            let size = normal.norm();
            if size > 0.0 {
                // a third of the triangle is this vertex's
                sum = sum.plus(&Quadric::plane(&(normal / size), &places[vertex], size / 6.0));
                areas += size / 6.0;
            }
        });
        sum.plus(&Quadric::place(&places[vertex], TUNING.normal_noise * TUNING.normal_noise * areas))
    };
    (0..places.len()).into_par_iter().with_min_len(1024).map(of_vertex).collect()
}

/// The normal of a triangle, as long as twice its area.
#[inline]
fn area_normal([a, b, c]: &[Vector3; 3]) -> Vector3 {
    (b - a).cross(&(c - a))
}

/// The height of a triangle by its longest edge.
#[inline]
fn height(area_normal: &Vector3, corners: &[Vector3; 3]) -> f64 {
    area_normal.norm() / longest2(corners).max(f64::MIN_POSITIVE)
}

/// The square of the longest edge.
#[inline]
fn longest2([a, b, c]: &[Vector3; 3]) -> f64 {
    (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared())
}
