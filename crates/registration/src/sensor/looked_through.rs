//! Free space: between a scanner and the surface that it saw there is nothing.

use super::Sensor;
use super::depth_image::DepthImage;
use crate::view::View;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Edge of a picture's cell at the surface, in spacings: wide enough that a surface leaves no holes.
        cell: f64 = 3.0,
        /// Nearer to the scanner than the surface it saw by more than this, in spacings, is in free space.
        depth: f64 = 5.0,
    }
}

/// What the scanner of one view looked through.
#[derive(Debug, Clone)]
pub struct LookedThrough {
    image: DepthImage,
    /// Nearer before the surface than this nothing is said, a length.
    depth: f32,
}

impl LookedThrough {
    /// By what the scanner of a view saw; `spacing` is that of a scan, a length.
    pub fn new(view: &View, sensor: &Sensor, spacing: f64) -> Self {
        let image = DepthImage::new(view.points(), sensor, TUNING.cell * spacing);
        LookedThrough { image, depth: (TUNING.depth * spacing) as f32 }
    }

    /// Whether a place of the view's local frame was looked through; `None` but where the scanner saw surface in its
    /// direction and all around that.
    pub fn is_free(&self, place: &nalgebra::Vector3<f32>) -> Option<bool> {
        self.image.height_over_unbroken(place).map(|height| height > self.depth)
    }
}
