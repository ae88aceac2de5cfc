//! Which triangles meet at a vertex, while triangles go and vertices become one.

/// Marks the end of a list, and a triangle that is gone.
const NONE: u32 = u32::MAX;

/// Triangles, and for each vertex the list of its corners: corner `3 f + k` is the place of the vertex in triangle `f`.
/// Corners of triangles that are gone leave a list when it is next walked.
#[derive(Debug, Clone)]
pub(super) struct Fans {
    faces: Vec<[u32; 3]>,
    first: Vec<u32>,
    next: Vec<u32>,
    living: usize,
}

impl Fans {
    /// Triangles with a corner twice are left out.
    pub(super) fn new(faces: &[[u32; 3]], vertices: usize) -> Fans {
        let faces: Vec<[u32; 3]> = faces.iter().copied().filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let (mut first, mut next) = (vec![NONE; vertices], vec![NONE; 3 * faces.len()]);
        // from the last: lists are in the order of the triangles
        for corner in (0..next.len()).rev() {
            let head = &mut first[faces[corner / 3][corner % 3] as usize];
            next[corner] = std::mem::replace(head, corner as u32);
        }
        Fans { living: faces.len(), faces, first, next }
    }

    /// Triangles that are left.
    pub(super) fn living(&self) -> usize {
        self.living
    }

    /// The triangles that are left, in their order.
    pub(super) fn faces(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.faces.iter().copied().filter(|face| face[0] != NONE)
    }

    /// The corners of a triangle.
    #[inline]
    pub(super) fn face(&self, face: u32) -> [u32; 3] {
        self.faces[face as usize]
    }

    /// The triangles of a vertex, into `found`; each with the two corners that follow the vertex.
    #[inline]
    pub(super) fn around(&mut self, vertex: u32, found: &mut Vec<Wedge>) {
        found.clear();
        let mut corner = self.first[vertex as usize];
        let mut last = NONE;
        while corner != NONE {
            let face = self.faces[(corner / 3) as usize];
            let following = self.next[corner as usize];
            if face[0] == NONE {
                // unlink
                match last {
                    NONE => self.first[vertex as usize] = following,
                    last => self.next[last as usize] = following,
                }
            } else {
                let place = (corner % 3) as usize;
                let [b, c] = [face[(place + 1) % 3], face[(place + 2) % 3]];
                found.push(Wedge { corner, others: [b, c] });
                last = corner;
            }
            corner = following;
        }
    }

    /// Visits the triangles of a vertex.
    #[inline]
    pub(super) fn each_around(&self, vertex: u32, mut visit: impl FnMut(Wedge)) {
        let mut corner = self.first[vertex as usize];
        while corner != NONE {
            let face = self.faces[(corner / 3) as usize];
            if face[0] != NONE {
                let place = (corner % 3) as usize;
                visit(Wedge { corner, others: [face[(place + 1) % 3], face[(place + 2) % 3]] });
            }
            corner = self.next[corner as usize];
        }
    }

    /// How many triangles a vertex has.
    #[inline]
    pub(super) fn count(&self, vertex: u32) -> usize {
        let mut count = 0;
        self.each_around(vertex, |_| count += 1);
        count
    }

    /// Makes `gone` one with `kept`: triangles that have both go. `of_kept` and `of_gone` are what [`Fans::around`] found.
    pub(super) fn unite(&mut self, kept: u32, gone: u32, of_kept: &[Wedge], of_gone: &[Wedge]) {
        for wedge in of_gone {
            let face = &mut self.faces[(wedge.corner / 3) as usize];
            if wedge.others.contains(&kept) {
                *face = [NONE; 3];
                self.living -= 1;
            } else {
                face[(wedge.corner % 3) as usize] = kept;
            }
        }
        self.first[gone as usize] = NONE;
        let mut head = NONE;
        for wedge in of_kept.iter().chain(of_gone).rev() {
            if self.faces[(wedge.corner / 3) as usize][0] != NONE {
                self.next[wedge.corner as usize] = head;
                head = wedge.corner;
            }
        }
        self.first[kept as usize] = head;
    }
}

/// A triangle as one of its vertices sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wedge {
    /// Where the vertex stands in its triangle.
    pub(super) corner: u32,
    /// The two that follow it.
    pub(super) others: [u32; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_takes_over_the_triangles_of_another() {
        // a fan of four about vertex 0, and a triangle with a corner twice
        let mut fans = Fans::new(&[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 1, 2]], 5);
        assert_eq!((fans.living(), fans.count(0), fans.count(1)), (4, 4, 2));
        let (mut kept, mut gone) = (Vec::new(), Vec::new());
        fans.around(1, &mut kept);
        fans.around(0, &mut gone);
        assert_eq!(gone.iter().map(|wedge| wedge.others).collect::<Vec<_>>(), [[1, 2], [2, 3], [3, 4], [4, 1]]);
        fans.unite(1, 0, &kept, &gone);
        assert_eq!(fans.faces().collect::<Vec<_>>(), [[1, 2, 3], [1, 3, 4]]);
        assert_eq!([0, 1, 2, 3].map(|vertex| fans.count(vertex)), [0, 2, 1, 2]);
        fans.around(2, &mut kept);
        assert_eq!(kept, [Wedge { corner: 4, others: [3, 1] }]);
    }
}
