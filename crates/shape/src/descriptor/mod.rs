//! The shape of a surface as a whole, in some hundred bytes that no turn, shift, scale, mirror or change of its mesh alters.
//!
//! After PANORAMA (Papadakis, Pratikakis, Theoharis and Perantonis 2010): the surface is put into a frame of its own and unrolled
//! from cylinders about each axis, as distance from the axis and as direction of the normals; of these images the magnitudes
//! of low frequencies are kept, which no sign of an axis changes. Two frames are kept, since either fails at some things: of two
//! surfaces the frames in which they are more alike count. Beside them [`pairs`] tell what no frame can spoil.
//!
//! Everything goes by area, so that vertices don't matter, and by normals without sides, since half of all files get them wrong.
//! - `area_samples`: the surface in samples of equal area (of a cloud: `cloud_surface`); `maps`, `spectrum`: its images, and what is kept of them
//! - `pairs`: how its samples lie to each other
//! - `views`: what single scans of it would see
//! - [`sampled_shape`]: its samples in the frame of its file, and the frames that it is described in

mod area_samples;
mod cloud_surface;
mod maps;
mod pairs;
pub mod sampled_shape;
mod spectrum;
mod views;

use nalgebra::Matrix3;

use crate::saliency::orientation::OrientedCloud;
use area_samples::AreaSamples;
use rayon::prelude::*;
pub use sampled_shape::{OwnFrame, SampledShape};
pub use views::{VIEW_BYTES, VIEWS, ViewCode, view_distance};
use visage_geometry::Mesh;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Samples of a surface.
        samples: usize = 20_000,
        /// What maps count beside the distance from the axis: cosine to the radius, cosine to the axis,
        outward: f32 = 0.7,
        along: f32 = 0.7,
        /// the silhouette along the axis, and what faces its viewer.
        silhouette: f32 = 0.4,
        facing: f32 = 0.6,
        /// What the distance of the pairs counts beside that of the frames.
        pairs: f64 = 0.31,
        /// Steps of a byte in one: the largest number of a real surface (a needle's) makes 233 of them.
        steps: f32 = 400.0,
    }
}

/// Maps of an axis.
const MAPS: usize = 5;
/// Bytes of a frame.
pub const FRAME_BYTES: usize = 3 * MAPS * spectrum::NUMBERS;
/// Bytes of the pairs.
pub const PAIR_BYTES: usize = pairs::CLASSES;

/// What tells one shape from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ShapeDescriptor {
    /// In the frame of the principal axes, and in that of the normals.
    frames: [[u8; FRAME_BYTES]; 2],
    pairs: [u8; PAIR_BYTES],
}

impl ShapeDescriptor {
    /// The length of [`ShapeDescriptor::to_bytes`].
    pub const BYTES: usize = 2 * FRAME_BYTES + PAIR_BYTES;

    /// That of a mesh; `None` if it has no area.
    pub fn of_mesh(mesh: &Mesh) -> Option<ShapeDescriptor> {
        Some(ShapeDescriptor::of(&AreaSamples::of_mesh(mesh, TUNING.samples)?))
    }

    /// A mesh's, and what single scans would see of it. Runs inside the caller's rayon pool.
    pub fn with_views_of_mesh(mesh: &Mesh) -> Option<(ShapeDescriptor, Vec<ViewCode>)> {
        AreaSamples::of_mesh(mesh, TUNING.samples).map(with_views)
    }

    /// A cloud's, and what single scans would see of it. Runs inside the caller's rayon pool.
    pub fn with_views_of_cloud(cloud: &OrientedCloud) -> Option<(ShapeDescriptor, Vec<ViewCode>)> {
        AreaSamples::of_cloud(cloud, TUNING.samples).map(with_views)
    }

    /// What it is as a view, if it is a single scan's.
    pub fn as_view(&self) -> ViewCode {
        views::code(&self.frames[0])
    }

    fn in_units(steps: f64) -> f64 {
        steps / f64::from(TUNING.steps)
    }

    fn of(samples: &AreaSamples) -> ShapeDescriptor {
        let frames = samples.moments.map(|moment| in_frame(samples, &axes(&moment)));
        ShapeDescriptor { frames, pairs: pairs::histogram(samples).map(step) }
    }

    /// How far two shapes are apart: 0 for the same.
    pub fn distance(&self, other: &ShapeDescriptor) -> f64 {
        let [first, second] = [0, 1].map(|frame| squared(&self.frames[frame], &other.frames[frame]));
        let pairs = squared(&self.pairs, &other.pairs);
        distance_of(f64::from(first.min(second)).sqrt(), f64::from(pairs).sqrt())
    }

    /// Its bytes in either frame.
    pub fn frames(&self) -> &[[u8; FRAME_BYTES]; 2] {
        &self.frames
    }

    /// The bytes of its pairs.
    pub fn pairs(&self) -> &[u8; PAIR_BYTES] {
        &self.pairs
    }

    /// Its bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let all = self.frames.iter().flatten().chain(&self.pairs);
        bytes.iter_mut().zip(all).for_each(|(byte, value)| *byte = *value);
        bytes
    }

    /// The inverse of [`ShapeDescriptor::to_bytes`].
    pub fn from_bytes(bytes: &[u8; Self::BYTES]) -> ShapeDescriptor {
        let (mut descriptor, mut rest) =
            (ShapeDescriptor { frames: [[0; FRAME_BYTES]; 2], pairs: [0; PAIR_BYTES] }, bytes.iter());
        let slots = descriptor.frames.iter_mut().flatten().chain(&mut descriptor.pairs);
        slots.zip(&mut rest).for_each(|(slot, byte)| *slot = *byte);
        descriptor
    }
}

/// The distance made of those of the nearer frames and of the pairs, in steps of bytes.
#[inline]
pub fn distance_of(frames: f64, pairs: f64) -> f64 {
    ShapeDescriptor::in_units(frames + TUNING.pairs * pairs)
}

/// A distance in steps of bytes.
pub fn steps(distance: f64) -> f64 {
    distance * f64::from(TUNING.steps)
}

/// The sum of the squared differences.
fn squared(a: &[u8], b: &[u8]) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum()
}

fn step(value: f32) -> u8 {
    (value * TUNING.steps).round() as u8
}

fn with_views(samples: AreaSamples) -> (ShapeDescriptor, Vec<ViewCode>) {
    let seen = |direction: &visage_geometry::Vector3| {
        let seen = views::seen_from(&samples, direction)?;
        Some(views::code(&in_frame(&seen, &axes(&seen.moments[0]))))
    };
    (ShapeDescriptor::of(&samples), views::directions().par_iter().filter_map(seen).collect())
}

/// The axes of a moment as rows, the greatest first.
fn axes(moment: &Matrix3<f64>) -> Matrix3<f64> {
    principal(moment).0
}

/// The axes of a moment as rows, and what it is along each, the greatest first.
fn principal(moment: &Matrix3<f64>) -> (Matrix3<f64>, [f64; 3]) {
    let eigen = moment.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axes = Matrix3::from_rows(&order.map(|axis| eigen.eigenvectors.column(axis).transpose()));
    (axes, order.map(|axis| eigen.eigenvalues[axis]))
}

fn in_frame(samples: &AreaSamples, frame: &Matrix3<f64>) -> [u8; FRAME_BYTES] {
    let mut bytes = [0; FRAME_BYTES];
    for (axis, bytes) in bytes.chunks_exact_mut(FRAME_BYTES / 3).enumerate() {
        let [radius, outward, along] = maps::panorama(samples, frame, axis).map(|map| spectrum::spectrum(&map));
        let [silhouette, above, below] = maps::views(samples, frame, axis).map(|map| spectrum::spectrum(&map));
        // no one knows which end is which
        let facing = std::array::from_fn(|k| 0.5 * (above[k] + below[k]));
        let weighed = [
            (radius, 1.0),
            (outward, TUNING.outward),
            (along, TUNING.along),
            (silhouette, TUNING.silhouette),
            (facing, TUNING.facing),
        ];
        let values = weighed.iter().flat_map(|(spectrum, weight)| spectrum.iter().map(move |value| weight * value));
        bytes.iter_mut().zip(values).for_each(|(byte, value)| *byte = step(value));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::curvature::tests::sphere;
    use visage_geometry::{Motion, Point3, Vector3};

    /// A ball stretched along its axes, turned and moved.
    fn egg(x: f64, y: f64, turn: f64) -> ShapeDescriptor {
        let mut mesh = sphere(50.0, 4);
        let motion = Motion::new(Vector3::new(3.0, 2.0, 1.0), Vector3::new(0.4, 1.0, -0.7) * turn);
        mesh.vertices.iter_mut().for_each(|p| *p = motion * Point3::new(x * p.x, y * p.y, p.z));
        ShapeDescriptor::of_mesh(&mesh).expect("it has an area")
    }

    #[test]
    fn the_distance_grows_with_the_difference_and_no_turn_makes_any() {
        let own = egg(2.0, 1.4, 0.0);
        assert!(own.distance(&egg(2.0, 1.4, 1.0)) < 0.1);
        let distances = [2.2, 2.6, 3.4].map(|x| own.distance(&egg(x, 1.4, 0.3)));
        assert!(distances.is_sorted() && distances[2] > 0.3, "{distances:?}");
        assert_eq!(own.distance(&own), 0.0);
    }

    #[test]
    fn bytes_round_trip() {
        let own = egg(2.0, 1.4, 0.0);
        assert_eq!(ShapeDescriptor::from_bytes(&own.to_bytes()), own);
        assert!(ShapeDescriptor::of_mesh(&Mesh::default()).is_none());
    }

    #[test]
    fn numbers_are_not_cut_off() {
        let needle = egg(40.0, 1.0, 0.0);
        let most = needle.to_bytes().into_iter().max();
        assert!(most.is_some_and(|most| most < 255), "{most:?}");
    }
}
