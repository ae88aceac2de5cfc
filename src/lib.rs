//! visage registers batches of 3D range scans into one model and finds faces among the models it keeps.
//!
//! Its layers are crates, which stand here under one roof; this one is the command line. They point one way; the map is
//! `docs/ARCHITECTURE.md`, the equations are tied to their functions in `docs/ALGORITHM.md`.
//!
//! Pure (no HTTP, SQL, files, clock or async; parallel inside the caller's rayon pool):
//! - [`geometry`]: clouds, meshes, rigid motions, neighbours, normals, thinning
//! - [`registration`]: from scans and initial poses to accurate poses and a verdict
//! - [`surface`]: one cloud and a mesh from the posed views
//! - [`descriptor`]: the shape of a surface as a whole
//! - [`saliency`]: curvature, multi-scale saliency, salient regions
//! - [`faces`]: facial triangles, standards, signatures
//! - [`standards`]: standards made by users, for anything with caps and pits
//! - [`gallery`]: the in-memory gallery index and its queries
//! - [`picture`]: geometry to pixels; [`report`]: pictures of models, and the page of a report
//! - [`synthetic`]: objects and scans made by code, for the demo and the tests
//! - [`pipeline`]: scans to model to signature, stage by stage
//! - [`progress`]: the progress sink and the cancel flag
//!
//! - [`formats`]: bytes to geometry and back
//! - [`domain`]: what the service keeps and its users choose, as plain values
//!
//! Around them:
//! - [`storage`]: the database and the files, each behind a trait
//! - [`app`]: use cases: models are added and deleted, the gallery is searchable and evaluated
//! - [`jobs`]: the durable queue and its runner
//! - [`http`]: router, resources, problem+json
//! - [`cli`]: the commands of the binary
//! - [`config`], [`machine`], [`telemetry`]: settings, memory, logs

pub mod cli;
pub mod telemetry;

pub use visage_domain as domain;
pub use visage_formats as formats;
pub use visage_gallery as gallery;
pub use visage_geometry as geometry;
pub use visage_geometry::progress;
pub use visage_http as http;
pub use visage_picture as picture;
pub use visage_pipeline as pipeline;
pub use visage_registration as registration;
pub use visage_report as report;
pub use visage_service::{app, config, jobs, machine, storage, traces};
pub use visage_shape::{descriptor, faces, saliency, standards};
pub use visage_surface as surface;
pub use visage_synthetic as synthetic;
