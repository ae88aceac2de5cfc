//! The rims of an open surface, and closing those that are short: of a patch that reaches far from data behind a narrow
//! mouth nothing stays but the mouth.

use std::collections::BTreeMap;

use super::extract::Triangles;

/// The rims, each as vertices in the order in which a triangle that closes it passes them. Where rims touch at a vertex they
/// are left out.
fn rims(faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    // an edge and its direction in one number: they are many, and sorted
    let packed = |a: u32, b: u32| u64::from(a.min(b)) << 33 | u64::from(a.max(b)) << 1 | u64::from(a < b);
    let mut edges: Vec<u64> =
        faces.iter().flat_map(|face| (0..3).map(|k| packed(face[k], face[(k + 1) % 3]))).collect();
    edges.sort_unstable();
    // from each vertex where the rim goes on, against the direction of the triangle there; None: to several
    let mut next: BTreeMap<u32, Option<u32>> = BTreeMap::new();
    let is_same = |k: usize, l: usize| edges.get(k).zip(edges.get(l)).is_some_and(|(a, b)| a >> 1 == b >> 1);
    for (k, edge) in edges.iter().enumerate() {
        if (k > 0 && is_same(k - 1, k)) || is_same(k, k + 1) {
            continue;
        }
        let (low, high, is_upward) = ((edge >> 33) as u32, (edge >> 1) as u32, edge & 1 == 1);
        let (from, to) = if is_upward { (high, low) } else { (low, high) };
        next.entry(from).and_modify(|other| *other = None).or_insert(Some(to));
    }
    let mut found = Vec::new();
    while let Some((start, _)) = next.first_key_value() {
        let start = *start;
        let mut rim = vec![start];
        let mut at = next.remove(&start).flatten();
        while let Some(vertex) = at.filter(|vertex| *vertex != start) {
            rim.push(vertex);
            at = next.remove(&vertex).flatten();
        }
        if at == Some(start) && rim.len() >= 3 {
            found.push(rim);
        }
    }
    found
}

/// Closes the rims that are shorter than `shortest`; returns how many.
pub fn close_short(triangles: &mut Triangles, shortest: f32) -> usize {
    let place = |triangles: &Triangles, v: u32| nalgebra::Vector3::from(triangles.vertices[v as usize]);
    let mut closed = 0;
    for rim in rims(&triangles.faces) {
        let after = |k: usize| rim[(k + 1) % rim.len()];
        let length: f32 = (0..rim.len()).map(|k| (place(triangles, rim[k]) - place(triangles, after(k))).norm()).sum();
        if length >= shortest {
            continue;
        }
        closed += 1;
        if let [a, b, c] = rim[..] {
            triangles.faces.push([a, b, c]);
            continue;
        }
        let sum = rim.iter().fold(nalgebra::Vector3::zeros(), |sum, v| sum + place(triangles, *v));
        let middle = triangles.vertices.len() as u32;
        triangles.vertices.push((sum / rim.len() as f32).into());
        triangles.support.push(0.0);
        triangles.faces.extend((0..rim.len()).map(|k| [middle, rim[k], after(k)]));
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of `n` cells around an axis, open at both ends; radius 1 at one, `far` at the other.
    fn funnel(n: u32, far: f32) -> Triangles {
        let around = |k: u32, radius: f32, z: f32| {
            let (sine, cosine) = (k as f32 * std::f32::consts::TAU / n as f32).sin_cos();
            [radius * cosine, radius * sine, z]
        };
        let vertices: Vec<[f32; 3]> =
            (0..n).map(|k| around(k, 1.0, 0.0)).chain((0..n).map(|k| around(k, far, 1.0))).collect();
        let faces = (0..n).flat_map(|k| [[k, (k + 1) % n, n + k], [(k + 1) % n, n + (k + 1) % n, n + k]]).collect();
        Triangles { support: vec![1.0; vertices.len()], vertices, faces }
    }

    #[test]
    fn short_rims_are_closed_the_right_way_round_and_long_ones_stay() {
        let mut open = funnel(12, 5.0);
        assert_eq!(rims(&open.faces).len(), 2);
        assert_eq!(close_short(&mut open, 8.0), 1);
        let left = rims(&open.faces);
        assert_eq!(left.len(), 1);
        assert!(left[0].iter().all(|v| *v >= 12), "the wide one is left");
        assert_eq!(open.faces.len(), 24 + 12);
        assert_eq!(close_short(&mut open, 100.0), 1);
        let mut directed: Vec<(u32, u32)> =
            open.faces.iter().flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]).collect();
        directed.sort_unstable();
        assert!(directed.windows(2).all(|pair| pair[0] != pair[1]), "each edge once in each direction");
        assert!(directed.iter().all(|(a, b)| directed.binary_search(&(*b, *a)).is_ok()));
        let mut triangle = Triangles { support: vec![1.0; 6], ..funnel(3, 1.0) };
        assert_eq!((close_short(&mut triangle, 100.0), triangle.faces.len()), (2, 8));
    }
}
