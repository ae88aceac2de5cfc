//! How placed scans become one cloud, and the cloud a surface. Pure.
//!
//! ```
//! use visage_geometry::progress::Progress;
//! use visage_geometry::{Cloud, Motion, Point3};
//! use visage_registration::view::View;
//! use visage_surface::merge::{PosedView, merge};
//!
//! let place = |k: usize| Point3::new((k % 20) as f64, (k / 20) as f64, 0.0);
//! let scan = Cloud::from_points((0..400).map(place).collect());
//! let view = View::new(&scan)?;
//! let local_pose = view.local_pose(&Motion::identity());
//! let posed = PosedView { view: &view, scan: &scan, local_pose, placed: true, sensor: None };
//! let (model, _) = merge(&[posed], &Progress::silent())?;
//! assert_eq!(model.cloud.len(), 400);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`merge`](mod@merge): every point of every placed view in the world, with an outward normal
//! - [`reconstruct`](mod@reconstruct): from such a cloud to triangles, with what is known of them
//! - [`simplify`](mod@simplify): the same surface with fewer triangles; [`distance`]: how far two are from each other
//! - [`deviation`], [`nearest`]: how far each place of a model is from another one

pub mod deviation;
pub mod distance;
pub mod merge;
pub mod nearest;
pub mod reconstruct;
pub mod simplify;
mod surface_mesh;

pub use surface_mesh::SurfaceMesh;
