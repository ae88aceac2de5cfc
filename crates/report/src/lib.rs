//! A model as people see it: which pictures there are of it, how each is drawn, and a page that says how it came about. Pure: values in,
//! bytes out.
//!
//! ```
//! use visage_geometry::progress::Progress;
//! use visage_geometry::{Cloud, Point3, Surface};
//! use visage_report::{Kind, Material, Wish, draw};
//!
//! let place = |k: usize| Point3::new((k % 60) as f64, (k / 60) as f64, 0.002 * (k % 60) as f64 * (k % 60) as f64);
//! let bent = Surface { cloud: Cloud::from_points((0..3600).map(place).collect()), ..Surface::default() };
//! let material = Material { surface: bent, ..Material::default() };
//! let made = draw(Kind::Thumbnail, &material, &Wish::of(Kind::Thumbnail), &Progress::silent())?;
//! assert_eq!(&made.to_png()?[1..4], b"PNG");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`kind`]: the kinds of pictures; [`material`]: what they are made of, and what may be wished
//! - [`mod@draw`]: how each is drawn; [`scans`]: what was uploaded, before anything runs
//! - [`found`]: what a report says, as far as it is shown; [`advice`]: the same in words, with what to do about it
//! - [`page`]: all on one page

pub mod advice;
pub mod draw;
pub mod found;
pub mod kind;
pub mod material;
pub mod page;
pub mod scans;

pub use draw::{draw, saliency_ply};
pub use kind::{Kind, Source};
pub use material::{Made, Material, PictureError, Plane, Wish};
