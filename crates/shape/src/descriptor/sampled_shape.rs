//! A surface as samples of equal area in the frame of its file, with the frames in which it, and what single scans would see of it,
//! are described: two things of one shape lie alike in these.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::area_samples::AreaSamples;
use super::{TUNING, principal, views};
use crate::saliency::orientation::OrientedCloud;
use visage_geometry::{Mesh, Point3, Vector3};

/// A frame that the surface gives itself, but for the signs of the axes.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnFrame {
    /// The centroid.
    pub center: Point3,
    /// The axes as rows, the one along which there is most first.
    pub axes: Matrix3<f64>,
    /// What the second moment is along each: axes are known as far as these differ.
    pub moments: [f64; 3],
    /// The mean distance from the centroid.
    pub size: f64,
}

/// Samples of equal area.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledShape {
    /// Where they are.
    pub points: Vec<Point3>,
    /// Unit normals, of either side.
    pub normals: Vec<Vector3>,
    /// The frames of the whole: of its surface, and of its normals.
    pub whole: [OwnFrame; 2],
    /// Those of what single scans would see.
    pub views: Vec<OwnFrame>,
}

impl SampledShape {
    /// That of a mesh; `None` if it has no area. Runs inside the caller's rayon pool.
    pub fn of_mesh(mesh: &Mesh) -> Option<SampledShape> {
        AreaSamples::of_mesh(mesh, TUNING.samples).map(SampledShape::of)
    }

    /// That of a cloud; `None` without normals. Runs inside the caller's rayon pool.
    pub fn of_cloud(cloud: &OrientedCloud) -> Option<SampledShape> {
        AreaSamples::of_cloud(cloud, TUNING.samples).map(SampledShape::of)
    }

    fn of(samples: AreaSamples) -> SampledShape {
        let place = |p: &Vector3| Point3::from(samples.center + p * samples.size);
        let frame = |of: &AreaSamples, moment: usize| {
            let (axes, moments) = principal(&of.moments[moment]);
            // of the whole: the centroid and the mean distance are the origin and the unit of its samples
            OwnFrame { center: Point3::from(of.center), axes, moments, size: of.size }
        };
        let of_view = |direction: &Vector3| {
            let seen = views::seen_from(&samples, direction)?;
            let OwnFrame { center, size, axes, moments } = frame(&seen, 0);
            Some(OwnFrame { center: place(&center.coords), size: size * samples.size, axes, moments })
        };
        SampledShape {
            points: samples.points.iter().map(place).collect(),
            whole: [0, 1].map(|moment| frame(&samples, moment)),
            views: views::directions().par_iter().filter_map(of_view).collect(),
            normals: samples.normals,
        }
    }
}
