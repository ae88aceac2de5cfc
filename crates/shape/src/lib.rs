//! What a surface is: curvature and saliency, facial triangles, standards and signatures. Pure.
//!
//! - [`saliency`]: curvature, multi-scale saliency, salient regions
//! - [`faces`]: facial triangles, the built-in face, signatures
//! - [`classes`]: standards made by users, for anything with caps and pits

pub mod classes;
pub mod faces;
pub mod saliency;
