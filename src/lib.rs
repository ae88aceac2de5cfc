//! visage registers batches of 3D range scans into one model and finds faces among the models it keeps.
//!
//! Modules are layers and point one way; the map is `docs/ARCHITECTURE.md`, the equations are tied to
//! their functions in `docs/ALGORITHM.md`.
//!
//! Pure (no HTTP, SQL, files, clock or async; parallel inside the caller's rayon pool):
//! - [`geometry`]: clouds, meshes, rigid motions, neighbours, normals, thinning
//! - [`registration`]: from scans and initial poses to accurate poses and a verdict
//! - [`reconstruction`]: one cloud from the posed views
//! - [`saliency`]: curvature, multi-scale saliency, salient regions
//! - [`faces`]: facial triangles, standards, signatures
//! - [`retrieval`]: the in-memory gallery index and its queries
//! - [`pipeline`]: scans to model to signature, stage by stage
//! - [`progress`]: the progress sink and the cancel flag
//!
//! Around them:
//! - [`formats`]: bytes to geometry and back

#![warn(missing_docs)]

pub mod faces;
pub mod formats;
pub mod geometry;
pub mod pipeline;
pub mod progress;
pub mod reconstruction;
pub mod registration;
pub mod retrieval;
pub mod saliency;
