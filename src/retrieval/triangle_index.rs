//! All triangles of all indexed models in one immutable kd-tree over the sphere, searched exactly.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::triangles::IndexedTriangle;
use crate::faces::Shape;

/// The triangles of a fixed list of models. A model is known here by its place in that list.
#[derive(Debug, Default)]
pub struct TriangleIndex {
    tree: Option<ImmutableKdTree<f64, 3>>,
    /// For each point of the tree: its model's place.
    models: Vec<u32>,
    /// For each point of the tree: the triangle's place among its model's.
    triangles: Vec<u32>,
}

/// A triangle that a search found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// The model's place in the list.
    pub model: u32,
    /// The triangle's place among its model's.
    pub triangle: u32,
    /// The chord between it and the query.
    pub chord: f64,
}

impl TriangleIndex {
    /// An index over the triangles of `models`, in that order.
    pub fn build<'a>(models: impl Iterator<Item = &'a [IndexedTriangle]>) -> TriangleIndex {
        let mut index = TriangleIndex::default();
        let mut points = Vec::new();
        for (model, triangles) in models.enumerate() {
            for (place, triangle) in triangles.iter().enumerate() {
                points.push(triangle.shape.coordinates());
                index.models.push(model as u32);
                index.triangles.push(place as u32);
            }
        }
        // the only failures are of mutable trees (full buckets) and of item numbers beyond u32
        index.tree = ImmutableKdTree::new_from_slice(&points).ok().filter(|_| !points.is_empty());
        index
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.models.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.models.is_empty()
    }

    fn hit(&self, item: u32, squared: f64) -> Hit {
        let item = item as usize;
        Hit { model: self.models[item], triangle: self.triangles[item], chord: squared.max(0.0).sqrt() }
    }

    /// Every triangle within `chord` of `shape` (the bound included), in no particular order.
    pub fn within(&self, shape: &Shape, chord: f64) -> Vec<Hit> {
        let Some(tree) = &self.tree else { return Vec::new() };
        tree.query(&shape.coordinates())
            .within::<SquaredEuclidean<f64>>(chord * chord)
            .unsorted()
            .execute()
            .into_iter()
            .map(|found| self.hit(found.item, found.distance))
            .collect()
    }

    /// The `count` nearest triangles, nearest first.
    pub fn nearest(&self, shape: &Shape, count: NonZero<usize>) -> Vec<Hit> {
        let Some(tree) = &self.tree else { return Vec::new() };
        tree.query(&shape.coordinates())
            .nearest_n::<SquaredEuclidean<f64>>(count)
            .execute()
            .into_iter()
            .map(|found| self.hit(found.item, found.distance))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::triangles::triangles_of;
    use super::*;
    use crate::faces::signature::tests::example;

    #[test]
    fn searches_equal_brute_force() {
        let models: Vec<Vec<IndexedTriangle>> =
            (0..30).map(|k| triangles_of(&example(0.7 * f64::from(k), 8))).collect();
        let index = TriangleIndex::build(models.iter().map(Vec::as_slice));
        assert_eq!(index.len(), 30 * 57);
        for query in [models[3][5].shape, models[7][50].shape.relabelled()] {
            let mut brute: Vec<f64> = models.iter().flatten().map(|t| t.shape.chord(&query)).collect();
            brute.sort_by(f64::total_cmp);
            let nearest = index.nearest(&query, NonZero::new(40).expect("40 is not 0"));
            assert_eq!(nearest.len(), 40);
            assert!(nearest.iter().zip(&brute).all(|(hit, chord)| (hit.chord - chord).abs() < 1e-9));
            let inside = index.within(&query, 0.1);
            assert_eq!(inside.len(), brute.iter().filter(|c| **c <= 0.1).count());
            assert!(inside.iter().all(|hit| {
                let triangle = &models[hit.model as usize][hit.triangle as usize];
                (triangle.shape.chord(&query) - hit.chord).abs() < 1e-9
            }));
        }
    }

    #[test]
    fn an_empty_index_finds_nothing() {
        let index = TriangleIndex::build(std::iter::empty());
        assert!(index.is_empty());
        let shape = Shape(crate::geometry::Vector3::new(0.0, 0.0, 0.5));
        assert!(index.within(&shape, 1.0).is_empty());
        assert!(index.nearest(&shape, NonZero::<usize>::MIN).is_empty());
    }
}
