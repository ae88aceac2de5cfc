//! How a surface passes through a cell: for each pattern of signs at its corners the polygons that separate them.
//!
//! The patterns of marching cubes (Lorensen and Cline, SIGGRAPH 1987), derived instead of listed. On a face whose signs
//! alternate the corners inside are cut off one by one. Both cells beside the face do so, since they see the same signs:
//! that is why the surface has no holes.

/// An edge of a cell by the corners that it joins. Corner `c` lies at `c & 1`, `c >> 1 & 1`, `c >> 2` along x, y, z.
pub const EDGES: [[u8; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The corners of each face in a circle, counter-clockwise seen from outside of the cell.
const FACES: [[u8; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// A triangle by the places of its corners: edges of the cell, or [`MIDDLE`] plus the number of the polygon.
pub type Triangle = [u8; 3];
/// From here on a corner is the middle of a polygon.
pub const MIDDLE: u8 = 12;

/// What separates the corners of one pattern.
#[derive(Debug, Clone, Default)]
pub struct Pattern {
    /// Triangles, counter-clockwise seen from where values are positive.
    pub triangles: Vec<Triangle>,
    /// The polygons whose middles the triangles need, by their edges.
    pub middles: Vec<Vec<u8>>,
    /// Whether the surface passes more than once, through the cell or one of its faces: sheets are near each other.
    pub is_folded: bool,
}

/// The patterns of all 256 sets of corners inside (bit c: corner c is inside).
pub fn patterns() -> Vec<Pattern> {
    (0..=255).map(pattern).collect()
}

fn edge_between(a: u8, b: u8) -> u8 {
    let wanted = [a.min(b), a.max(b)];
    EDGES.iter().position(|edge| *edge == wanted).unwrap_or(0) as u8
}

/// On each face the surface goes from edge to edge; `next[e]` is where it goes on from edge e.
fn pattern(inside: u8) -> Pattern {
    let is_inside = |corner: u8| inside >> corner & 1 == 1;
    let mut next = [None; 12];
    let mut is_folded = false;
    for face in FACES {
        let mut runs = 0;
        // each run of corners inside is cut off by a segment from the edge where it ends to the edge where it begins
        for k in 0..4 {
            let (corner, before) = (face[k], face[(k + 3) % 4]);
            if !is_inside(corner) || is_inside(before) {
                continue;
            }
            runs += 1;
            let mut last = k;
            while is_inside(face[(last + 1) % 4]) {
                last = (last + 1) % 4;
            }
            let (enter, leave) = (edge_between(before, corner), edge_between(face[last], face[(last + 1) % 4]));
            next[enter as usize] = Some(leave);
        }
        is_folded |= runs > 1;
    }
    let mut found = Pattern { is_folded, ..Pattern::default() };
    let mut polygons = 0;
    let mut is_done = [false; 12];
    for start in 0..12u8 {
        if is_done[start as usize] || next[start as usize].is_none() {
            continue;
        }
        let mut polygon = Vec::new();
        let mut edge = start;
        while !is_done[edge as usize] {
            is_done[edge as usize] = true;
            polygon.push(edge);
            edge = next[edge as usize].unwrap_or(start);
        }
        found.add(polygon);
        polygons += 1;
    }
    found.is_folded |= polygons > 1;
    found
}

/// Whether two edges lie on one face.
fn share_face(a: u8, b: u8) -> bool {
    let on = |edge: u8, face: &[u8; 4]| EDGES[edge as usize].iter().all(|corner| face.contains(corner));
    FACES.iter().any(|face| on(a, face) && on(b, face))
}

impl Pattern {
    /// Cuts a polygon into triangles. No diagonal lies on a face of the cell: the cell beyond might have the same one.
    fn add(&mut self, polygon: Vec<u8>) {
        let n = polygon.len();
        let is_root = |root: &usize| (2..n - 1).all(|k| !share_face(polygon[*root], polygon[(root + k) % n]));
        match (0..n).find(is_root) {
            Some(root) => {
                let at = |k: usize| polygon[(root + k) % n];
                self.triangles.extend((1..n - 1).map(|k| [at(0), at(k), at(k + 1)]));
            }
            None => {
                let middle = MIDDLE + self.middles.len() as u8;
                self.triangles.extend((0..n).map(|k| [middle, polygon[k], polygon[(k + 1) % n]]));
                self.middles.push(polygon);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_crossed_edge_is_in_one_polygon_and_one_corner_makes_one_triangle() {
        for (inside, pattern) in patterns().iter().enumerate() {
            let crossed = EDGES.iter().filter(|[a, b]| (inside >> a ^ inside >> b) & 1 == 1).count();
            let mut used: Vec<u8> = pattern.triangles.iter().flatten().copied().filter(|edge| *edge < MIDDLE).collect();
            used.sort_unstable();
            used.dedup();
            assert_eq!(used.len(), crossed, "{inside:08b}");
        }
        assert_eq!(patterns()[1].triangles.len(), 1);
        assert_eq!(patterns()[0b0000_1111].triangles.len(), 2);
    }

    #[test]
    fn triangles_face_the_outside() {
        // corner 0 alone is inside: the triangle faces away from it
        let [triangle] = patterns()[1].triangles[..] else { panic!("one triangle") };
        let middle = |edge: u8| -> [f32; 3] {
            let [a, b] = EDGES[edge as usize];
            std::array::from_fn(|axis| f32::from((a >> axis & 1) + (b >> axis & 1)) / 2.0)
        };
        let [a, b, c] = triangle.map(|edge| nalgebra::Vector3::from(middle(edge)));
        assert!((b - a).cross(&(c - a)).dot(&a) > 0.0);
    }

    #[test]
    fn cells_side_by_side_agree_on_their_face() {
        // segments on the face x = 1 of one cell are those on x = 0 of the next, the other way round
        let segments = |inside: u8, side: u8| -> Vec<[u8; 2]> {
            let on = |edge: u8| EDGES[edge as usize].iter().all(|corner| corner & 1 == side);
            let mut found: Vec<[u8; 2]> = Vec::new();
            for triangle in &patterns()[inside as usize].triangles {
                for k in 0..3 {
                    let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                    if a < MIDDLE && b < MIDDLE && on(a) && on(b) {
                        // name edges by their corners without x
                        let name = |edge: u8| EDGES[edge as usize].map(|corner| corner >> 1);
                        let flat = |edge: u8| name(edge)[0] * 4 + name(edge)[1];
                        found.push(if side == 1 { [flat(a), flat(b)] } else { [flat(b), flat(a)] });
                    }
                }
            }
            found.sort_unstable();
            found
        };
        for face in 0..16u8 {
            let spread = |shift: u8| (0..4).map(|k| (face >> k & 1) << (2 * k + shift)).sum::<u8>();
            let (left, right) = (spread(1), spread(0));
            assert_eq!(segments(left, 1), segments(right, 0), "{face:04b}");
            // whatever else is inside
            assert_eq!(segments(left | spread(0), 1), segments(right, 0), "{face:04b}");
        }
    }
}
