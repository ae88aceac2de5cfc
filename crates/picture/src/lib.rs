//! Geometry to pixels, without window or graphics card: how does it look? Pure: values in, bytes out.
//!
//! ```
//! use visage_geometry::Point3;
//! use visage_geometry::progress::Progress;
//! use visage_picture::camera::{Axes, Camera, Side};
//! use visage_picture::raster::{Paint, Scene, render};
//! use visage_picture::size::Size;
//!
//! let corners = [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
//! let size: Size = "160x120".parse()?;
//! let camera = Camera::fit(&corners, Axes::of_side(Side::Front), size, false);
//! let paint = Paint::Material;
//! let scene = Scene { points: &corners, normals: None, faces: &[[0, 1, 2]], colors: None, paint, spacing: 1.0 };
//! let rendered = render(&scene, &camera, size, &Progress::silent())?;
//! assert!(rendered.covered() > 0.2);
//! assert_eq!(&rendered.image.to_png()?[1..4], b"PNG");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`size`], [`image`], [`color`]: how large, pixels and PNG, maps from figures to colours
//! - [`camera`], [`raster`]: from which side; points and triangles to pixels
//! - [`drawing`]: lines, shapes and text, on a picture or as SVG; [`legend`]: scale bars and what colours mean
//! - [`plots`]: matrices, graphs and curves

pub mod camera;
pub mod color;
pub mod drawing;
pub mod image;
pub mod legend;
pub mod plots;
pub mod raster;
pub mod size;
