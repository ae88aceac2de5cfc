//! Thinned views with normals: what the joint refinement matches.

use rayon::prelude::*;

use crate::sensor::{Facet, Sensor, viewing_axis};
use crate::view::View;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint, Neighbour};
use visage_geometry::normals::least_spread;
use visage_geometry::thinning::{representatives, thin};

/// The means of a view's voxels with the normals of the surface there, in the view's local frame.
#[derive(Debug, Clone)]
pub struct Surfels {
    /// Positions with their tree.
    pub indexed: IndexedPoints,
    /// Unit normals: towards the scanner where `is_sided`, else of any sign.
    pub normals: Vec<[f32; 3]>,
    /// Whether it is known from which side the surface was seen.
    pub is_sided: Vec<bool>,
    /// Points there for a unit of area, in a unit of the view's own: see [`Facet`](crate::sensor::Facet).
    pub densities: Vec<f32>,
    /// Whether the surface goes on all around. What lies beyond a rim was not seen, and the nearest point that was
    /// seen is no counterpart.
    pub is_inner: Vec<bool>,
    /// The indices of the inner surfels.
    pub inner: Vec<u32>,
    /// The largest distance of a surfel from the view's centroid.
    pub radius: f64,
}

/// Surfels of all views, and how they were matched in the end.
#[derive(Debug, Clone)]
pub struct FineSurfels {
    /// One entry a view.
    pub views: Vec<Surfels>,
    /// The edge of their voxels, a length.
    pub edge: f64,
    /// The largest distance of a correspondence, a length.
    pub reach: f64,
    /// The share that they are of the surfels the poses rest on.
    pub share: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points a normal is fitted to,
        neighbours: usize = 16,
        /// as long as noise is no more than this share of the spacing: with more of it, what they lie on has to be as much wider,
        /// or they hold no plane.
        calm: f64 = 0.25,
        /// up to so many points.
        most_neighbours: usize = 96,
        /// Surfels fitted one after the other.
        chunk: usize = 256,
        /// The next surfel's points are sought within so many times the squared distance of this one's.
        guess: f32 = 1.4,
        /// A surfel lies on a rim if the mean of its neighbours is farther off than this share of their mean distance.
        rim_offset: f64 = 0.4,
        /// The cosine below which a surface is seen so much from the side that noise decides which it is.
        grazing: f64 = 0.1,
    }
}

impl Surfels {
    /// One surfel for each voxel of edge `edge`.
    pub fn new(view: &View, edge: f64) -> Self {
        let centroids = thin(view.points(), edge as f32).centroids;
        let neighbours = neighbours(view);
        let fitted: Vec<(Facet, bool)> = centroids
            .par_chunks(TUNING.chunk)
            .flat_map_iter(|centroids| {
                // neighbours on the curve have their points about as near: a good guess, the same for any threads
                let (mut found, mut guess2) = (Vec::new(), 0.0f32);
                centroids.iter().map(move |centroid| {
                    view.indexed.tree.k_nearest_unordered(centroid, neighbours, guess2, &mut found);
                    let farthest2 = found.iter().map(|n| n.distance2).fold(0.0, f32::max);
                    guess2 = TUNING.guess * farthest2;
                    let (normal, is_inner) = fit(&view.indexed.points, centroid, &found);
                    (Facet::within(normal, farthest2), is_inner)
                })
            })
            .collect();
        let (facets, is_inner): (Vec<Facet>, Vec<bool>) = fitted.into_iter().unzip();
        let is_sided = vec![false; centroids.len()];
        let mut surfels = Surfels::of(centroids, facets, is_sided, is_inner);
        if let Some(sensor) = &view.sensor {
            surfels.turn_towards(sensor, TUNING.grazing);
        }
        surfels
    }

    /// One of these surfels for each voxel of edge `edge`: that nearest to the mean.
    pub fn thinned(&self, edge: f64) -> Self {
        let kept = representatives(&self.indexed.points, edge as f32);
        let kept = || kept.iter().map(|index| *index as usize);
        Surfels::of(
            kept().map(|index| self.indexed.points[index]).collect(),
            kept().map(|index| self.facet(index)).collect(),
            kept().map(|index| self.is_sided[index]).collect(),
            kept().map(|index| self.is_inner[index]).collect(),
        )
    }

    /// The surface at a surfel.
    fn facet(&self, index: usize) -> Facet {
        Facet { normal: self.normals[index].into(), density: self.densities[index] }
    }

    /// The axis along which the view was seen, its sign arbitrary, read off the inner surfels.
    pub fn viewing_axis(&self) -> nalgebra::Vector3<f32> {
        let facets: Vec<Facet> = self.inner.iter().map(|index| self.facet(*index as usize)).collect();
        viewing_axis(&facets).cast::<f32>()
    }

    /// Whether it is known from which side some of the surface was seen.
    pub fn has_side(&self) -> bool {
        self.is_sided.contains(&true)
    }

    fn of(points: Vec<LocalPoint>, facets: Vec<Facet>, is_sided: Vec<bool>, is_inner: Vec<bool>) -> Self {
        let normals = facets.iter().map(|facet| facet.normal.into()).collect();
        let densities = facets.iter().map(|facet| facet.density).collect();
        let inner = (0..is_inner.len() as u32).filter(|index| is_inner[*index as usize]).collect();
        let radius = points.iter().map(|c| nalgebra::Vector3::from(*c).norm()).fold(0.0f32, f32::max).into();
        Surfels { indexed: IndexedPoints::new(points), normals, densities, is_sided, is_inner, inner, radius }
    }

    /// Turns the normals towards the scanner; those more from the side than the cosine `grazing` have no clear side.
    pub fn turn_towards(&mut self, sensor: &Sensor, grazing: f64) {
        let places = self.indexed.points.iter().zip(&mut self.normals);
        for ((place, normal), is_sided) in places.zip(&mut self.is_sided) {
            let direction = sensor.direction_from(place);
            let facing = nalgebra::Vector3::from(*normal).cast::<f64>().dot(&direction);
            if facing < 0.0 {
                *normal = normal.map(|x| -x);
            }
            *is_sided = facing.abs() > grazing * direction.norm();
        }
    }

    /// How alike the normals of surfel `index` and surfel `target` of another view are, from their cosine: where both
    /// sides are known the two sides of a wall are not alike at all.
    #[inline]
    pub fn likeness<T: nalgebra::RealField + Copy>(
        &self,
        index: usize,
        other: &Surfels,
        target: usize,
        cosine: T,
    ) -> T {
        if self.is_sided[index] && other.is_sided[target] { cosine } else { cosine.abs() }
    }
}

/// How many points of a view a normal is fitted to.
fn neighbours(view: &View) -> usize {
    let wider = (view.range_accuracy / (TUNING.calm * view.spacing)).max(1.0).powi(2);
    ((TUNING.neighbours as f64 * wider) as usize).min(TUNING.most_neighbours)
}

fn fit(points: &[LocalPoint], center: &LocalPoint, neighbours: &[Neighbour]) -> ([f32; 3], bool) {
    let count = neighbours.len().max(1) as f64;
    let center = nalgebra::Vector3::from(*center);
    let mut sum = nalgebra::Vector3::<f64>::zeros();
    let mut squares = nalgebra::Matrix3::<f64>::zeros();
    let mut distance = 0.0;
    for neighbour in neighbours {
        let d = (nalgebra::Vector3::from(points[neighbour.index as usize]) - center).cast::<f64>();
        sum += d;
        squares += d * d.transpose();
        distance += d.norm();
    }
    let mean = sum / count;
    let (normal, _) = least_spread(&(squares / count - mean * mean.transpose()));
    (normal.cast::<f32>().into(), mean.norm() < TUNING.rim_offset * distance / count)
}
