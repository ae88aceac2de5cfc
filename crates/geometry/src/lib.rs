//! What a surface, a motion and a neighbour is: what every other crate of visage stands on. Pure: no files, network, clock or
//! async; parallel inside the caller's rayon pool.
//!
//! ```
//! use visage_geometry::neighbours::IndexedPoints;
//! use visage_geometry::{Motion, Point3, Vector3};
//!
//! let i_from_j = Motion::new(Vector3::new(1.0, 0.0, 0.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
//! assert!((i_from_j * Point3::new(2.0, 0.0, 0.0) - Point3::new(1.0, 2.0, 0.0)).norm() < 1e-12);
//!
//! let indexed = IndexedPoints::new(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
//! let found = indexed.tree.nearest(&[0.9, 0.1, 0.0], 1.0);
//! assert_eq!(found.map(|neighbour| neighbour.index), Some(1));
//! ```
//!
//! - [`cloud`], [`mesh`], [`surface`], [`se3`]: points with attributes, triangles, what one file describes, rigid motions
//! - [`pose_convention`]: what a pose of a file may mean
//! - [`neighbours`]: the kd-tree and its queries
//! - [`normals`], [`thinning`], [`organised`], [`own_frame`], [`viewpoint`], [`coincidence`]: what points alone tell
//! - [`cleaning`]: what of a surface is support or far off
//! - [`union_find`], [`progress`]: which things hang together; what algorithms know of jobs
//! - [`names`]: things that are chosen by name
//! - [`mod@tuning`]: the constants of a stage

pub mod cleaning;
pub mod cloud;
pub mod coincidence;
pub mod mesh;
pub mod names;
pub mod neighbours;
pub mod normals;
pub mod organised;
pub mod own_frame;
pub mod pose_convention;
pub mod progress;
pub mod se3;
pub mod surface;
pub mod thinning;
pub mod tuning;
pub mod union_find;
pub mod viewpoint;

pub use cloud::{Bounds, Cloud};
pub use mesh::Mesh;
pub use pose_convention::PoseConvention;
pub use se3::Motion;
pub use surface::{RangeGrid, Surface, Unit};
pub use union_find::UnionFind;

/// A position in f64, in the unit of the file it came from.
pub type Point3 = nalgebra::Point3<f64>;
/// A direction or displacement in f64.
pub type Vector3 = nalgebra::Vector3<f64>;

/// The largest coordinate that is taken for a measurement, in any unit. Cubes of distances up to it stay finite in
/// f32, and f64 still tells places apart that are 0.0001 from each other there.
pub const MAX_COORDINATE: f64 = 1e12;
