//! The nearest place on the triangles of a mesh.

use rayon::prelude::*;

use visage_geometry::{Bounds, Mesh, Point3, Vector3};

/// Triangles of a leaf.
const LEAF: usize = 6;

/// The place of a mesh that is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The place.
    pub place: Point3,
    /// The triangle that it is on.
    pub face: u32,
    /// The square of the distance.
    pub distance2: f64,
}

/// A tree of boxes over the triangles of a mesh.
#[derive(Debug, Clone)]
pub struct TriangleTree {
    /// Corners of the triangles, in the order of the leaves.
    triangles: Vec<[Point3; 3]>,
    /// Their indices in the mesh.
    faces: Vec<u32>,
    /// Boxes, level by level as in a heap: the children of `i` are `2 i + 1` and `2 i + 2`.
    boxes: Vec<Bounds>,
    /// Leaves are the last of the boxes.
    leaves: usize,
}

impl TriangleTree {
    /// Indexes the triangles of a mesh; `None` if it has none.
    pub fn new(mesh: &Mesh) -> Option<TriangleTree> {
        if mesh.faces.is_empty() {
            return None;
        }
        let mut faces: Vec<u32> = (0..mesh.faces.len() as u32).collect();
        let leaves = mesh.faces.len().div_ceil(LEAF).next_power_of_two();
        let middles: Vec<Point3> = (0..mesh.faces.len())
            .into_par_iter()
            .map(|face| {
                let [a, b, c] = mesh.corners(face);
                Point3::from((a.coords + b.coords + c.coords) / 3.0)
            })
            .collect();
        let whole = Whole { leaves, count: faces.len() };
        split(&mut faces, &middles, &whole, 0, leaves);
        drop(middles);
        let triangles: Vec<[Point3; 3]> = faces.par_iter().map(|face| mesh.corners(*face as usize)).collect();
        let mut boxes = vec![EMPTY; 2 * leaves - 1];
        for leaf in 0..leaves {
            let (from, to) = range(leaf, leaves, triangles.len());
            boxes[leaves - 1 + leaf] = Bounds::of(triangles[from..to].iter().flatten()).unwrap_or(EMPTY);
        }
        for node in (0..leaves - 1).rev() {
            let (left, right) = (boxes[2 * node + 1], boxes[2 * node + 2]);
            boxes[node] = Bounds { min: left.min.inf(&right.min), max: left.max.sup(&right.max) };
        }
        Some(TriangleTree { triangles, faces, boxes, leaves })
    }

    /// The nearest place, if one is nearer than the root of `within2`. Where an edge or corner of several triangles is nearest,
    /// it is said to be on that which faces the point most: the point is on the side that this one says.
    pub fn nearest(&self, point: &Point3, within2: f64) -> Option<Nearest> {
        let mut best: Option<(usize, Point3)> = None;
        let mut best2 = within2;
        // deep enough for more triangles than an index counts
        let mut stack = [(0u32, 0.0f64); 64];
        stack[0] = (0, self.distance2(0, point));
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (node, distance2) = stack[depth];
            let node = node as usize;
            if distance2 > best2 * (1.0 + TIE) {
                continue;
            }
            if node + 1 >= self.leaves {
                let (from, to) = range(node + 1 - self.leaves, self.leaves, self.triangles.len());
                for index in from..to {
                    let place = nearest_of_triangle(point, &self.triangles[index]);
                    let found2 = (place - point).norm_squared();
                    let is_nearer = found2 < best2 * (1.0 - TIE);
                    let is_tie = !is_nearer && found2 <= best2 * (1.0 + TIE) && best.is_some();
                    let faces_more = |other: usize| {
                        let own = facing(point, &place, &self.triangles[index]);
                        let others = facing(point, &place, &self.triangles[other]);
                        own > others || own == others && self.faces[index] < self.faces[other]
                    };
                    if is_nearer || is_tie && best.is_some_and(|(other, _)| faces_more(other)) {
                        best = Some((index, place));
                        best2 = found2.min(best2);
                    }
                }
                continue;
            }
            let children = [2 * node + 1, 2 * node + 2].map(|child| (child as u32, self.distance2(child, point)));
            let [near, far] = if children[0].1 <= children[1].1 { children } else { [children[1], children[0]] };
            for child in [far, near] {
                if child.1 <= best2 * (1.0 + TIE) && depth < stack.len() {
                    stack[depth] = child;
                    depth += 1;
                }
            }
        }
        best.map(|(index, place)| Nearest { place, face: self.faces[index], distance2: (place - point).norm_squared() })
    }

    #[inline]
    fn distance2(&self, node: usize, point: &Point3) -> f64 {
        let Bounds { min, max } = &self.boxes[node];
        let mut sum = 0.0;
        for k in 0..3 {
            let off = (min[k] - point[k]).max(point[k] - max[k]).max(0.0);
            sum += off * off;
        }
        sum
    }
}

/// By what share two squared distances may differ and still be one: that of a corner is rounded differently in each triangle.
const TIE: f64 = 1e-9;

const EMPTY: Bounds = Bounds {
    min: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    max: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
};

/// The triangles of a leaf: all have as many, but for one.
#[inline]
fn range(leaf: usize, leaves: usize, count: usize) -> (usize, usize) {
    let at = |leaf: usize| (leaf as u128 * count as u128 / leaves as u128) as usize;
    (at(leaf), at(leaf + 1))
}

/// What all leaves share.
struct Whole {
    leaves: usize,
    count: usize,
}

/// Orders the triangles of so many leaves, from the first of them on, so that those of a leaf lie together: halving along the
/// longest side of their box.
fn split(faces: &mut [u32], middles: &[Point3], whole: &Whole, first: usize, leaves: usize) {
    if leaves <= 1 || faces.len() <= 1 {
        return;
    }
    let Some(bounds) = Bounds::of(faces.iter().map(|face| &middles[*face as usize])) else { return };
    let axis = (bounds.max - bounds.min).imax();
    let start = |leaf: usize| range(leaf, whole.leaves, whole.count).0;
    let middle = start(first + leaves / 2) - start(first);
    let by_axis =
        |a: &u32, b: &u32| middles[*a as usize][axis].total_cmp(&middles[*b as usize][axis]).then_with(|| a.cmp(b));
    if middle < faces.len() {
        faces.select_nth_unstable_by(middle, by_axis);
    }
    let (left, right) = faces.split_at_mut(middle);
    let mut halves = (
        || split(left, middles, whole, first, leaves / 2),
        || split(right, middles, whole, first + leaves / 2, leaves / 2),
    );
    if middle > 4096 {
        rayon::join(halves.0, halves.1);
    } else {
        halves.0();
        halves.1();
    }
}

/// How straight a triangle faces a point, seen from a place on it.
fn facing(point: &Point3, place: &Point3, [a, b, c]: &[Point3; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    normal.try_normalize(0.0).map_or(0.0, |normal| normal.dot(&(point - place)).abs())
}

/// The place of a triangle that is nearest to a point (Ericson, Real-Time Collision Detection, 5.1.5).
#[inline]
pub fn nearest_of_triangle(point: &Point3, [a, b, c]: &[Point3; 3]) -> Point3 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return along(a, &ab, d1, d1 - d3);
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return along(a, &ac, d2, d2 - d6);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return along(b, &(c - b), d4 - d3, (d4 - d3) + (d5 - d6));
    }
    let sum = va + vb + vc;
    // a triangle without an area has no inside
    if sum > 0.0 { a + ab * (vb / sum) + ac * (vc / sum) } else { *a }
}

#[inline]
fn along(from: &Point3, edge: &Vector3, part: f64, whole: f64) -> Point3 {
    if whole > 0.0 { from + edge * (part / whole) } else { *from }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bumpy sheet.
    fn sheet(side: u32) -> Mesh {
        let place = |k: u32| {
            let (x, y) = (f64::from(k % side), f64::from(k / side));
            Point3::new(x, y, (x * 0.7).sin() + (y * 1.1).cos())
        };
        let cell = |k: u32| {
            let a = k / (side - 1) * side + k % (side - 1);
            [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]
        };
        Mesh {
            vertices: (0..side * side).map(place).collect(),
            faces: (0..(side - 1) * (side - 1)).flat_map(cell).collect(),
        }
    }

    #[test]
    fn the_tree_finds_what_a_look_at_all_triangles_finds() {
        let mesh = sheet(23);
        let tree = TriangleTree::new(&mesh).expect("triangles");
        for k in 0..500 {
            let t = f64::from(k);
            let point =
                Point3::new(11.0 + 14.0 * (t * 0.37).sin(), 11.0 + 14.0 * (t * 0.11).cos(), 4.0 * (t * 0.73).sin());
            let of_face = |face: usize| (nearest_of_triangle(&point, &mesh.corners(face)) - point).norm_squared();
            let least = (0..mesh.faces.len()).map(of_face).fold(f64::INFINITY, f64::min);
            let found = tree.nearest(&point, f64::INFINITY).expect("there is one");
            assert!((found.distance2 - least).abs() <= 1e-9 * least, "{point}: {found:?}, {least}");
            assert!((of_face(found.face as usize) - least).abs() <= 1e-8 * least.max(1e-12));
            assert_eq!(tree.nearest(&point, least * 0.9), None);
        }
        assert!(TriangleTree::new(&Mesh::default()).is_none());
    }

    #[test]
    fn a_place_of_a_triangle_is_no_farther_than_any_other() {
        let triangle = [Point3::new(0.0, 0.0, 0.0), Point3::new(3.0, 0.0, 1.0), Point3::new(1.0, 2.0, -1.0)];
        for k in 0..200 {
            let t = f64::from(k);
            let point = Point3::new(5.0 * (t * 0.9).sin(), 5.0 * (t * 1.7).cos(), 5.0 * (t * 0.31).sin());
            let found = (nearest_of_triangle(&point, &triangle) - point).norm();
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let [a, b, c] = triangle;
                    assert!(found <= (a + (b - a) * u + (c - a) * v - point).norm() + 1e-12);
                }
            }
        }
        let flat = [Point3::origin(); 3];
        assert_eq!(nearest_of_triangle(&Point3::new(1.0, 0.0, 0.0), &flat), Point3::origin());
    }

    #[test]
    fn at_a_sharp_edge_the_triangle_that_faces_the_point_is_named() {
        // two sides of a sharp ridge along x; the point is above the ridge, far to the side of the first
        let vertices = vec![
            Point3::new(-5.0, 0.0, 0.0),
            Point3::new(5.0, 0.0, 0.0),
            Point3::new(0.0, -1.0, -9.0),
            Point3::new(0.0, 1.0, -9.0),
        ];
        let mesh = Mesh { vertices, faces: vec![[0, 2, 1], [0, 1, 3]] };
        let tree = TriangleTree::new(&mesh).expect("triangles");
        for (y, face) in [(-1.0, 0), (1.0, 1)] {
            let found = tree.nearest(&Point3::new(0.0, y, 0.05), f64::INFINITY).expect("there is one");
            assert_eq!(found.face, face);
        }
    }
}
