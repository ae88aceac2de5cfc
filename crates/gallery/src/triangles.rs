//! A model's triangles as points of Kendall's sphere, without labels: what the index holds.

use visage_geometry::{Point3, Vector3};
use visage_shape::faces::{Shape, Triangle};

/// Where a triangle came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// Three salient regions.
    Regions,
    /// A facial triangle.
    Face,
}

/// A triangle in canonical labelling: its corners run counter-clockwise seen from outside (`h_z >= 0`), begun
/// anywhere. Its three labelings are turns of one another by 120 degrees, so a search for all three finds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IndexedTriangle {
    /// The corners in the model's frame.
    pub corners: [Point3; 3],
    /// The direction that "outside" was taken from.
    pub outward: Vector3,
    /// Its place on the sphere.
    pub shape: Shape,
    /// For each corner, whether the surface is convex there (a cap or ridge) or concave.
    pub convex: [bool; 3],
    /// The logarithm of its size relative to the model's radius.
    pub log_size: f64,
    /// Where it came from.
    pub origin: Origin,
}

/// The triangle of three corners, each a place, a normal and whether the surface is convex there; `None` if it is
/// degenerate. `radius` is the model's.
pub(super) fn canonical(corners: [(Point3, Vector3, bool); 3], radius: f64, origin: Origin) -> Option<IndexedTriangle> {
    let outward: Vector3 = corners.iter().map(|(_, normal, _)| normal).sum();
    let triangle = Triangle::new(corners.map(|(point, ..)| point));
    let log_size = (triangle.size() / radius).ln();
    let shape = triangle.shape(&outward);
    if !log_size.is_finite() || !shape.0.iter().all(|x| x.is_finite()) {
        return None;
    }
    let [a, b, c] = if shape.0.z < 0.0 { [corners[1], corners[0], corners[2]] } else { corners };
    Some(IndexedTriangle {
        corners: [a.0, b.0, c.0],
        outward,
        shape: if shape.0.z < 0.0 { shape.swapped() } else { shape },
        convex: [a.2, b.2, c.2],
        log_size,
        origin,
    })
}

impl IndexedTriangle {
    /// The same triangle begun at its next corner.
    pub fn relabelled(&self) -> IndexedTriangle {
        let [a, b, c] = self.corners;
        let [x, y, z] = self.convex;
        IndexedTriangle { corners: [b, c, a], convex: [y, z, x], shape: self.shape.relabelled(), ..*self }
    }

    /// Its three labelings.
    pub fn labelings(&self) -> [IndexedTriangle; 3] {
        let next = self.relabelled();
        [*self, next, next.relabelled()]
    }
}

#[cfg(test)]
mod tests {
    use super::super::outline::triangles_of;
    use super::*;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn labelings_agree_with_their_corners() {
        for triangle in triangles_of(&example(0.4, 6)) {
            for labelled in triangle.labelings() {
                let shape = Triangle::new(labelled.corners).shape(&labelled.outward);
                assert!(shape.chord(&labelled.shape) < 1e-9);
            }
            assert!(triangle.labelings()[2].relabelled().shape.chord(&triangle.shape) < 1e-12);
        }
    }

    #[test]
    fn a_point_for_a_triangle_is_left_out() {
        let corner = (Point3::new(1.0, 2.0, 3.0), Vector3::z(), true);
        assert_eq!(canonical([corner; 3], 8.0, Origin::Regions), None);
    }
}
