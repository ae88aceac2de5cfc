//! From points and triangles to pixels, without a graphics card.
//!
//! The picture is cut into bands of rows, each drawn by itself: what covers a place is the nearest thing there, of equally near ones
//! the first, whatever the order in which they are drawn. So the pixels are the same for any number of threads.
//!
//! - [`bands`]: which things touch which band; [`triangles`], [`splats`]: which samples a thing covers
//! - [`surface`]: what is seen at each pixel, before light; [`occlusion`]: how much of the sky is hidden there
//! - [`light`]: the light itself

mod bands;
mod light;
mod occlusion;
mod splats;
mod surface;
mod triangles;
mod vector;

use crate::camera::Camera;
use crate::color::GROUND;
use crate::image::{Image, Rgb};
use crate::size::Size;
use bands::Covering;
use splats::Splats;
use surface::Seen;
use triangles::Triangles;
use visage_geometry::Point3;
use visage_geometry::progress::{Canceled, Progress};

/// What is to be seen.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// Points, or the corners of triangles.
    pub points: &'a [Point3],
    /// Outward normals of the points; of triangles they follow from these.
    pub normals: Option<&'a [nalgebra::Vector3<f32>]>,
    /// Triangles; without any the points are drawn.
    pub faces: &'a [[u32; 3]],
    /// A colour for each point.
    pub colors: Option<&'a [Rgb]>,
    /// How the colours are meant.
    pub paint: Paint,
    /// The distance of neighbours, for the size of points.
    pub spacing: f64,
}

/// How colours are meant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Paint {
    /// As what the surface looks like: light and shadow at full strength.
    #[default]
    Material,
    /// As figures that are to be read: just enough shading to see the shape.
    Figure,
    /// As they are, without light.
    Flat,
}

/// A drawn scene.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// The picture.
    pub image: Image,
    /// How near what is seen at each pixel is; 0 where there is nothing.
    nearness: Vec<f32>,
    camera: Camera,
}

impl Rendered {
    /// Where a point is on the picture, and whether something is before it.
    pub fn locate(&self, point: &Point3, tolerance: f64) -> ([f64; 2], bool) {
        let placed = self.camera.place(point);
        let toward = point + self.camera.axes().toward * tolerance;
        let lifted = self.camera.place(&toward).nearness;
        let size = self.image.size();
        let [x, y] = placed.at;
        let is_inside = x >= 0.0 && y >= 0.0 && x < f64::from(size.width()) && y < f64::from(size.height());
        let index = if is_inside { y as usize * size.width() as usize + x as usize } else { usize::MAX };
        let is_hidden = self.nearness.get(index).is_some_and(|near| f64::from(*near) > lifted);
        (placed.at, is_hidden)
    }

    /// From where it is seen.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The share of the pixels on which something is seen.
    pub fn covered(&self) -> f64 {
        let covered = self.nearness.iter().filter(|near| **near > 0.0).count();
        covered as f64 / self.nearness.len().max(1) as f64
    }
}

/// Samples of a pixel in each direction.
const FINE: usize = 2;
/// Pixels for which a pixel has but one sample: nobody sees single pixels of so many.
const LARGE: usize = 5_000_000;

/// Draws a scene. Runs inside the caller's rayon pool.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn render(scene: &Scene, camera: &Camera, size: Size, progress: &Progress) -> Result<Rendered, Canceled> {
    let fine = if size.pixels() > LARGE { 1 } else { FINE };
    let grid = Grid { width: size.width() as usize, height: size.height() as usize, fine };
    let seen = if scene.faces.is_empty() {
        draw(&Splats::new(scene, camera, grid), grid, progress)?
    } else {
        draw(&Triangles::new(scene, camera, grid), grid, progress)?
    };
    let image = light::lit(&seen, camera, size, scene.paint, GROUND);
    Ok(Rendered { image, nearness: seen.nearness(), camera: *camera })
}

fn draw(things: &impl Covering, grid: Grid, progress: &Progress) -> Result<Seen, Canceled> {
    let bands = bands::Bands::new(things, grid, progress)?;
    surface::seen(things, &bands, grid, progress)
}

/// The samples of a picture.
#[derive(Debug, Clone, Copy)]
struct Grid {
    /// Pixels in a row.
    width: usize,
    /// Rows of pixels.
    height: usize,
    /// Samples of a pixel in each direction.
    fine: usize,
}

impl Grid {
    /// Samples in a row.
    fn columns(self) -> usize {
        self.width * self.fine
    }

    /// Rows of samples.
    fn rows(self) -> usize {
        self.height * self.fine
    }
}

#[cfg(test)]
mod tests;
