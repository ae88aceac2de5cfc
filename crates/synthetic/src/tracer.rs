//! Rays on meshes: the first face that a ray meets from outside. Every virtual sensor looks through it.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use bvh::ray::Ray;

use visage_geometry::{Mesh, Point3, Vector3};

/// Where a ray met the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// From the start of the ray.
    pub distance: f64,
    /// Cosine of the angle between the ray, looked back along, and the face's normal.
    pub cos_incidence: f64,
    /// The face's normal.
    pub normal: Vector3,
}

/// Components of directions are at least this large.
const LEAST: f64 = 1e-12;

/// A mesh prepared for ray casting.
pub struct Target {
    triangles: Vec<Triangle>,
    tree: Bvh<f64, 3>,
}

struct Triangle {
    corners: [Point3; 3],
    normal: Vector3,
    /// The tree's own note of where the triangle is.
    node: usize,
}

impl Target {
    /// Builds the tree over the faces of a mesh that is wound outward.
    pub fn new(mesh: &Mesh) -> Self {
        let triangle = |face: usize| {
            let normal = mesh.area_normal(face).try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
            Triangle { corners: mesh.corners(face), normal, node: 0 }
        };
        let mut triangles: Vec<Triangle> = (0..mesh.faces.len()).map(triangle).collect();
        let tree = Bvh::build(&mut triangles);
        Target { triangles, tree }
    }

    /// The nearest face that the ray meets from outside.
    pub fn first_hit(&self, origin: Point3, direction: Vector3) -> Option<Hit> {
        // the tree misses a box in whose side the ray lies, for 0 times infinity is no number
        let ray = Ray::new(origin, direction.map(|x| if x.abs() < LEAST { LEAST } else { x }));
        let mut nearest: Option<Hit> = None;
        for triangle in self.tree.traverse_iterator(&ray, &self.triangles) {
            let [a, b, c] = &triangle.corners;
            let distance = ray.intersects_triangle(a, b, c).distance;
            if distance.is_finite() && nearest.as_ref().is_none_or(|hit| distance < hit.distance) {
                nearest =
                    Some(Hit { distance, cos_incidence: -triangle.normal.dot(&direction), normal: triangle.normal });
            }
        }
        nearest
    }
}

impl Bounded<f64, 3> for Triangle {
    fn aabb(&self) -> Aabb<f64, 3> {
        let [a, b, c] = self.corners;
        Aabb::with_bounds(a.inf(&b).inf(&c), a.sup(&b).sup(&c))
    }
}

impl BHShape<f64, 3> for Triangle {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solids::ground;

    #[test]
    fn a_ray_along_the_side_of_the_boxes_meets_what_is_in_them() {
        let target = Target::new(&ground(2.0, 4, |_, _| 0.0));
        for x in [0.0, 0.3, 1.0] {
            let hit = target.first_hit(Point3::new(x, 5.0, 0.6), -Vector3::y()).expect("it meets the ground");
            assert!((hit.distance - 5.0).abs() < 1e-9 && (hit.cos_incidence - 1.0).abs() < 1e-9);
        }
    }
}
