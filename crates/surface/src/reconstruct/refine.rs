//! Finer triangles where the surface bends: a flat one as wide as a cell has the wrong normal over most of its area.
//!
//! An edge whose ends look different ways is split where a cubic curve with their normals passes (Vlachos, Peters, Boyd and
//! Mitchell, "Curved PN triangles", I3D 2001). Both triangles of an edge split it at the same vertex, so nothing opens.

use nalgebra::Vector3;

use super::extract::Triangles;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// An edge is split if its ends' normals are so far apart, degrees: a flat triangle is off by up to half of it, more than twice
        /// as much as the noise of laser scans makes normals waver (2.3 to 2.7 degrees, medians on simulated heads).
        bent_deg: f32 = 12.0,
        /// Where they are farther apart than this, degrees, there is a crease, and no curve to follow.
        crease_deg: f32 = 60.0,
        /// Edges shorter than this, in cells, are not: the normals of their ends waver.
        short: f32 = 0.3,
        /// A new vertex is off the middle of its edge by at most this share of the edge: as on an arc of 55 degrees.
        most: f32 = 0.12,
        /// It stays in the middle if a part of a triangle would turn from the whole by more than 60 degrees: its cosine.
        turned: f32 = 0.5,
    }
}
/// A new vertex stays so far from the sides of its cell, in cells.
const LEAST: f32 = 0.01;

fn at(of: &[[f32; 3]], v: u32) -> Vector3<f32> {
    of[v as usize].into()
}

/// Splits the edges at which the surface bends; `normals` has a unit normal for each vertex, or 0 where none is known. Each
/// edge is passed once in each direction.
pub fn refine(triangles: Triangles, normals: &[[f32; 3]]) -> Triangles {
    let Triangles { mut vertices, mut support, faces } = triangles;
    let bent = bent_edges(&vertices, &faces, normals);
    let first = vertices.len() as u32;
    for [a, b] in &bent {
        vertices.push(middle(&vertices, normals, *a, *b).into());
        support.push((support[*a as usize] + support[*b as usize]) / 2.0);
    }
    // where the edges of each lower vertex begin
    let mut starts = vec![0u32; first as usize + 1];
    bent.iter().for_each(|[a, _]| starts[*a as usize + 1] += 1);
    for v in 1..starts.len() {
        starts[v] += starts[v - 1];
    }
    let split_at = |a: u32, b: u32| {
        let (low, high) = (a.min(b) as usize, a.max(b));
        let mut edges = starts[low]..starts[low + 1];
        edges.find(|k| bent[*k as usize][1] == high).map(|k| first + k)
    };
    let mut flat = vec![false; bent.len()];
    for face in &faces {
        let whole = normal(&vertices, face);
        let parts = parts(&vertices, *face, split_at);
        if parts.iter().any(|part| normal(&vertices, part).dot(&whole) < TUNING.turned) {
            let added = parts.iter().flatten().filter(|v| **v >= first);
            added.for_each(|v| flat[(v - first) as usize] = true);
        }
    }
    for (k, [a, b]) in bent.iter().enumerate().filter(|(k, _)| flat[*k]) {
        vertices[first as usize + k] = ((at(&vertices, *a) + at(&vertices, *b)) / 2.0).into();
    }
    let faces = faces.into_iter().flat_map(|face| parts(&vertices, face, split_at)).collect();
    Triangles { vertices, support, faces }
}

/// The unit normal of a triangle, 0 if it has no area.
fn normal(vertices: &[[f32; 3]], [a, b, c]: &[u32; 3]) -> Vector3<f32> {
    let (a, b, c) = (at(vertices, *a), at(vertices, *b), at(vertices, *c));
    let normal = (b - a).cross(&(c - a));
    normal / normal.norm().max(f32::MIN_POSITIVE)
}

/// What a triangle becomes whose edges are split at the vertices that `split_at` names.
fn parts(vertices: &[[f32; 3]], [a, b, c]: [u32; 3], split_at: impl Fn(u32, u32) -> Option<u32>) -> Vec<[u32; 3]> {
    match [split_at(a, b), split_at(b, c), split_at(c, a)] {
        [None, None, None] => vec![[a, b, c]],
        [Some(m), None, None] => vec![[a, m, c], [m, b, c]],
        [None, Some(m), None] => vec![[b, m, a], [m, c, a]],
        [None, None, Some(m)] => vec![[c, m, b], [m, a, b]],
        [Some(m), Some(n), None] => in_three(vertices, [a, b, c], m, n).to_vec(),
        [None, Some(m), Some(n)] => in_three(vertices, [b, c, a], m, n).to_vec(),
        [Some(n), None, Some(m)] => in_three(vertices, [c, a, b], m, n).to_vec(),
        [Some(m), Some(n), Some(o)] => vec![[a, m, o], [m, b, n], [n, c, o], [m, n, o]],
    }
}

/// The edges that are split, each with the lower vertex first, in order.
fn bent_edges(vertices: &[[f32; 3]], faces: &[[u32; 3]], normals: &[[f32; 3]]) -> Vec<[u32; 2]> {
    let bent = TUNING.crease_deg.to_radians().cos()..TUNING.bent_deg.to_radians().cos();
    let is_known = |v: u32| at(normals, v).norm_squared() > 0.5;
    let is_bent = |a: u32, b: u32| {
        bent.contains(&at(normals, a).dot(&at(normals, b)))
            && (at(vertices, a) - at(vertices, b)).norm() > TUNING.short
            && is_known(a)
            && is_known(b)
    };
    let mut bent: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|face| (0..3).map(|k| [face[k], face[(k + 1) % 3]]))
        .filter(|[a, b]| a < b && is_bent(*a, *b))
        .collect();
    bent.sort_unstable();
    bent
}

/// The middle of the cubic curve from a to b that is square to the normals at its ends, in the cell of the edge: an edge on a
/// side of a cell stays there. So what is in different cells doesn't come to cross.
fn middle(vertices: &[[f32; 3]], normals: &[[f32; 3]], a: u32, b: u32) -> Vector3<f32> {
    let (p, q) = (at(vertices, a), at(vertices, b));
    let (along, between) = (q - p, (p + q) / 2.0);
    let rises = |v: u32| at(normals, v) * along.dot(&at(normals, v));
    let off = (rises(b) - rises(a)) / 8.0;
    let is_on_side = |axis: usize| p[axis] == q[axis] && p[axis].fract() == 0.0;
    let in_side = Vector3::from_fn(|axis, _| if is_on_side(axis) { 0.0 } else { off[axis] });
    // as far as the surface is in the side of the cell
    let off = in_side * (off.norm_squared() / in_side.norm_squared().max(f32::MIN_POSITIVE));
    let most = TUNING.most * along.norm();
    let found = between + off * (most / off.norm().max(most).max(f32::MIN_POSITIVE));
    Vector3::from_fn(|axis, _| {
        let low = between[axis].floor();
        if is_on_side(axis) { low } else { found[axis].clamp(low + LEAST, low + 1.0 - LEAST) }
    })
}

/// The triangles of one that is split at `m` between a and b and at `n` between b and c: along the shorter diagonal.
fn in_three(vertices: &[[f32; 3]], [a, b, c]: [u32; 3], m: u32, n: u32) -> [[u32; 3]; 3] {
    let length = |v: u32, w: u32| (at(vertices, v) - at(vertices, w)).norm_squared();
    if length(a, n) < length(m, c) { [[m, b, n], [a, m, n], [a, n, c]] } else { [[m, b, n], [a, m, c], [m, n, c]] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A sphere of radius 5 as an octahedron whose faces are cut in four three times: edges of 11 degrees and a little more, the
    /// longer ones beyond 15.
    fn sphere() -> Triangles {
        let corner = |axis: usize, sign: f32| {
            let mut place = [0.0; 3];
            place[axis] = 5.0 * sign;
            place
        };
        let vertices: Vec<[f32; 3]> = (0..6).map(|k| corner(k % 3, if k < 3 { 1.0 } else { -1.0 })).collect();
        let faces = vec![[0, 1, 2], [1, 0, 5], [0, 2, 4], [2, 1, 3], [3, 4, 2], [4, 3, 5], [3, 1, 5], [4, 5, 0]];
        let mut found = Triangles { support: vec![1.0; 6], vertices, faces };
        for _ in 0..3 {
            let normals = vec![[0.0, 0.0, 1.0]; found.vertices.len()];
            let all = found.faces.iter().flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]]);
            let all: BTreeSet<[u32; 2]> = all.filter(|[a, b]| a < b).collect();
            let first = found.vertices.len() as u32;
            for [a, b] in &all {
                let place = middle(&found.vertices, &normals, *a, *b).normalize() * 5.0;
                found.vertices.push(place.into());
                found.support.push(1.0);
            }
            let all: Vec<[u32; 2]> = all.into_iter().collect();
            let named = |a: u32, b: u32| first + all.binary_search(&[a.min(b), a.max(b)]).expect("an edge") as u32;
            let in_four = |[a, b, c]: &[u32; 3]| {
                let [m, n, o] = [named(*a, *b), named(*b, *c), named(*c, *a)];
                [[*a, m, o], [m, *b, n], [n, *c, o], [m, n, o]]
            };
            found.faces = found.faces.iter().flat_map(in_four).collect();
        }
        found
    }

    fn is_closed(faces: &[[u32; 3]]) -> bool {
        let edges: Vec<(u32, u32)> = faces.iter().flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]).collect();
        let different: BTreeSet<(u32, u32)> = edges.iter().copied().collect();
        different.len() == edges.len() && different.iter().all(|(a, b)| different.contains(&(*b, *a)))
    }

    fn volume(of: &Triangles) -> f32 {
        of.faces
            .iter()
            .map(|f| at(&of.vertices, f[0]).dot(&at(&of.vertices, f[1]).cross(&at(&of.vertices, f[2]))))
            .sum::<f32>()
            / 6.0
    }

    #[test]
    fn new_vertices_lie_on_the_bent_surface_and_nothing_opens() {
        let coarse = sphere();
        let normals: Vec<[f32; 3]> = coarse.vertices.iter().map(|place| place.map(|x| x / 5.0)).collect();
        let fine = refine(coarse.clone(), &normals);
        let added = fine.vertices.len() - coarse.vertices.len();
        assert!(added > 50 && added < 3 * coarse.faces.len() / 2, "the longer edges alone: {added}");
        assert!(is_closed(&coarse.faces) && is_closed(&fine.faces));
        assert_eq!(fine.support.len(), fine.vertices.len());
        let off = fine.vertices.iter().map(|place| (Vector3::from(*place).norm() - 5.0).abs()).fold(0.0, f32::max);
        assert!(off < 0.001, "{off}");
        let whole = 4.0 / 3.0 * std::f32::consts::PI * 125.0;
        let missing = |of: &Triangles| 1.0 - volume(of) / whole;
        assert!(missing(&fine) > 0.0 && missing(&fine) < 0.75 * missing(&coarse));
    }

    #[test]
    fn what_is_flat_stays_as_it_is_also_beside_what_is_bent() {
        let coarse = sphere();
        let flat = vec![[0.0, 0.0, 1.0]; coarse.vertices.len()];
        assert_eq!(refine(coarse.clone(), &flat).faces, coarse.faces);
        let unknown: Vec<[f32; 3]> =
            flat.iter().enumerate().map(|(k, flat)| flat.map(|x| x * (k % 2) as f32)).collect();
        assert_eq!(refine(coarse.clone(), &unknown).faces, coarse.faces);
        // normals that turn here and there: triangles with one, two and three edges that are split
        let turned = |k: usize| [[0.0, 0.0, 1.0], [0.5, 0.0, 0.866], [0.0, 0.5, 0.866]][k * k % 7 % 3];
        let normals: Vec<[f32; 3]> = (0..coarse.vertices.len()).map(turned).collect();
        let fine = refine(coarse.clone(), &normals);
        assert!(fine.faces.len() > coarse.faces.len() && is_closed(&fine.faces));
    }
}
