//! A model's surface as the dense check asks it: what lies opposite a point, and does the surface end there?

use crate::saliency::{CellGrid, Samples};
use visage_geometry::{Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A sample lies on a rim if its neighbours leave a sector this wide empty, radians.
        rim_sector: f64 = 2.0 * std::f64::consts::FRAC_PI_3,
        /// Its neighbours are looked for within this, in spacings.
        rim_radius: f64 = 3.2,
    }
}

/// Samples of a model with their grid, normals as they are; `sign` turns them outward.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// The samples.
    pub samples: &'a Samples,
    /// Their grid.
    pub grid: &'a CellGrid,
    /// 1, or -1 if the samples' normals point inward.
    pub sign: f64,
}

/// A template point's counterpart on the surface.
#[derive(Debug, Clone, Copy)]
pub struct Counterpart {
    /// The sample.
    pub sample: usize,
    /// Its position.
    pub point: Point3,
    /// Its outward normal.
    pub normal: Vector3,
    /// Its squared distance.
    pub squared: f64,
}

impl Target<'_> {
    /// The nearest sample within `radius` that looks the way of `normal`.
    pub fn counterpart(&self, point: &Point3, normal: &Vector3, radius: f64, least_cosine: f64) -> Option<Counterpart> {
        let looks_the_same_way = |sample: usize| self.samples.normals[sample].dot(normal) * self.sign > least_cosine;
        let nearest = self.grid.nearest_where(point, radius, looks_the_same_way);
        nearest.map(|(sample, squared)| Counterpart {
            sample,
            point: self.samples.points[sample],
            normal: self.samples.normals[sample] * self.sign,
            squared,
        })
    }

    /// Whether the sample's neighbours leave a wide sector empty.
    pub fn is_on_rim(&self, sample: usize) -> bool {
        let (center, normal) = (self.samples.points[sample], self.samples.normals[sample]);
        let [x, y] = crate::saliency::quadric::tangents(&normal);
        let mut angles = Vec::new();
        self.grid.for_each_within(&center, TUNING.rim_radius * self.samples.spacing, |other, _| {
            let offset = self.samples.points[other] - center;
            if other != sample && self.samples.normals[other].dot(&normal) > 0.0 {
                angles.push(offset.dot(&y).atan2(offset.dot(&x)));
            }
        });
        angles.sort_by(f64::total_cmp);
        let Some((first, last)) = angles.first().zip(angles.last()) else { return true };
        let around = first + std::f64::consts::TAU - last;
        angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max) > TUNING.rim_sector
    }
}
