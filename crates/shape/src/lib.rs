//! What a surface is: curvature and saliency, facial triangles, standards and signatures. Pure.
//!
//! ```
//! use visage_geometry::progress::Progress;
//! use visage_geometry::{Cloud, Point3, Surface, Unit};
//! use visage_shape::faces::{MatchMethod, describe, judge, standard};
//!
//! let place = |k: usize| Point3::new((k % 60) as f64, (k / 60) as f64, 0.002 * (k % 60) as f64 * (k % 60) as f64);
//! let bent = Surface { cloud: Cloud::from_points((0..3600).map(place).collect()), ..Surface::default() };
//! let signature = describe(&bent, Unit::Mm, &Progress::silent())?;
//! assert_eq!(judge(&signature, &standard::face(), MatchMethod::Verified).score, 0.0, "a bent sheet is no face");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`descriptor`]: the shape as a whole, by which things are found
//! - [`saliency`]: curvature, multi-scale saliency, salient regions
//! - [`faces`]: facial triangles, the built-in face, signatures
//! - [`standards`]: standards made by users, for anything with caps and pits

pub mod descriptor;
pub mod faces;
pub mod saliency;
pub mod standards;
