//! Pieces, handles and open edges of a surface.

use visage::geometry::{Mesh, UnionFind};

/// How a surface hangs together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Topology {
    /// Parts that share no vertex.
    pub pieces: usize,
    /// Edges that aren't passed once in each direction.
    pub open_edges: usize,
    /// Handles of all pieces, if nothing is open.
    pub genus: i64,
}

impl Topology {
    pub fn of(mesh: &Mesh) -> Topology {
        let mut joined = UnionFind::new(mesh.vertices.len());
        let mut edges: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * mesh.faces.len());
        for face in &mesh.faces {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                joined.join(a as usize, b as usize);
                edges.push(([a.min(b), a.max(b)], a < b));
            }
        }
        edges.sort_unstable();
        let of_edge = |a: &([u32; 2], bool), b: &([u32; 2], bool)| a.0 == b.0;
        let (mut all, mut open_edges) = (0, 0);
        for passed in edges.chunk_by(of_edge) {
            all += 1;
            open_edges += usize::from(!matches!(passed, [(_, false), (_, true)]));
        }
        let pieces = joined.numbered().into_iter().max().map_or(0, |last| last + 1);
        let euler = mesh.vertices.len() as i64 - all + mesh.faces.len() as i64;
        Topology { pieces, open_edges, genus: pieces as i64 - euler / 2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage::synthetic::shapes::catalogue;

    #[test]
    fn handles_are_counted_and_what_is_cut_open_is_seen() {
        let of = |name: &str| {
            catalogue().into_iter().find(|shape| shape.name == name).expect("it is in the catalogue").mesh(1)
        };
        assert_eq!(Topology::of(&of("torus")), Topology { pieces: 1, open_edges: 0, genus: 1 });
        let mut open = of("sphere");
        assert_eq!(Topology::of(&open), Topology { pieces: 1, open_edges: 0, genus: 0 });
        open.faces.pop();
        assert_eq!(Topology::of(&open).open_edges, 3);
    }
}
