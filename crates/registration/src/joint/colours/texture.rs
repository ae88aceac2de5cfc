//! How bright the surface of a view is at its surfels, and which way it gets brighter.

use nalgebra::{Matrix2, Vector2, Vector3};
use rayon::prelude::*;

use crate::joint::surfels::Surfels;
use crate::view::View;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// What surrounds a surfel reaches so many edges: exposure and light change over longer ways.
        surroundings: f64 = 5.0,
        /// Slopes are fitted to the surfels within so many edges,
        slope: f64 = 1.8,
        /// of which there are so many at least.
        least: usize = 5,
        /// The share of what varies from surfel to surfel that is no noise of their means, below which a view has no texture to
        /// speak of; as in `quality/colour.rs`.
        textured: f64 = 0.3,
    }
}

/// A place of a texture.
#[derive(Debug, Clone, Copy)]
pub struct Shade {
    /// How much brighter it is than what surrounds it, in root mean squares of that over the view: no light, no exposure.
    pub relief: f32,
    /// How that rises along the surface, for a unit of length, in the view's local frame.
    pub slope: Vector3<f32>,
}

/// The shades at the surfels of a view; `None` where too little is known.
#[derive(Debug, Clone)]
pub struct Texture(pub Vec<Option<Shade>>);

impl Texture {
    /// Of a view whose points are so bright, at surfels of voxels of edge `edge`; `None` if what differs is noise.
    pub fn new(view: &View, brightness: &[f32], surfels: &Surfels, edge: f64) -> Option<Self> {
        let means = means(view, brightness, surfels, edge);
        let places = &surfels.indexed.points;
        let around2 = (TUNING.surroundings * edge).powi(2) as f32;
        let relief = |index: usize| {
            let (own, _) = means[index]?;
            let (mut sum, mut count) = (0.0, 0.0f32);
            surfels.indexed.tree.for_each_within(&places[index], around2, |near| {
                if let Some((mean, _)) = means[near.index as usize] {
                    (sum, count) = (sum + mean, count + 1.0);
                }
            });
            Some(own - sum / count)
        };
        let reliefs: Vec<Option<f32>> = (0..places.len()).into_par_iter().map(relief).collect();
        let known = reliefs.iter().flatten().count().max(1) as f32;
        let square = reliefs.iter().flatten().map(|relief| relief * relief).sum::<f32>() / known;
        let noise = means.iter().flatten().map(|(_, variance)| variance).sum::<f32>() / known;
        let is_textured = f64::from(square - noise) >= TUNING.textured * f64::from(square) && square > 0.0;
        let unit = 1.0 / square.sqrt().max(f32::MIN_POSITIVE);
        let shade = |index: usize| {
            let slope = slope(&reliefs, surfels, index, edge)?;
            Some(Shade { relief: reliefs[index]? * unit, slope: slope * unit })
        };
        is_textured.then(|| Texture((0..places.len()).into_par_iter().map(shade).collect()))
    }
}

/// For each surfel the mean brightness of the points that are nearest to it, and the variance of that mean.
fn means(view: &View, brightness: &[f32], surfels: &Surfels, edge: f64) -> Vec<Option<(f32, f32)>> {
    let reach2 = (edge * edge) as f32;
    let nearest = |place| surfels.indexed.tree.nearest(place, reach2).map(|found| found.index as usize);
    let nearest: Vec<Option<usize>> = view.points().par_iter().map(nearest).collect();
    let mut sums = vec![[0.0f64; 3]; surfels.indexed.points.len()];
    for (surfel, value) in nearest.into_iter().zip(brightness).filter_map(|(surfel, value)| Some((surfel?, *value))) {
        let value = f64::from(value);
        let sum = &mut sums[surfel];
        *sum = [sum[0] + 1.0, sum[1] + value, sum[2] + value * value];
    }
    let mean = |[count, sum, squares]: [f64; 3]| {
        let mean = sum / count;
        let variance = (squares / count - mean * mean).max(0.0) / count;
        (count > 0.0).then_some((mean as f32, variance as f32))
    };
    sums.into_iter().map(mean).collect()
}

/// The plane through the reliefs about a surfel, over its tangent plane.
fn slope(reliefs: &[Option<f32>], surfels: &Surfels, index: usize, edge: f64) -> Option<Vector3<f32>> {
    let normal = Vector3::from(surfels.normals[index]);
    let along = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let across = normal.cross(&along);
    let place = Vector3::from(surfels.indexed.points[index]);
    let mut found: Vec<(Vector2<f32>, f32)> = Vec::new();
    surfels.indexed.tree.for_each_within(&place.into(), (TUNING.slope * edge).powi(2) as f32, |near| {
        let offset = Vector3::from(surfels.indexed.points[near.index as usize]) - place;
        found.extend(
            reliefs[near.index as usize].map(|relief| (Vector2::new(offset.dot(&along), offset.dot(&across)), relief)),
        );
    });
    if found.len() < TUNING.least {
        return None;
    }
    let count = found.len() as f32;
    let middle = found.iter().map(|(at, _)| at).sum::<Vector2<f32>>() / count;
    let mean = found.iter().map(|(_, relief)| relief).sum::<f32>() / count;
    let (mut squares, mut products) = (Matrix2::zeros(), Vector2::zeros());
    for (at, relief) in &found {
        let offset = at - middle;
        squares += offset * offset.transpose();
        products += offset * (relief - mean);
    }
    let slope = squares.try_inverse()? * products;
    Some(along * slope.x + across * slope.y)
}
