//! Points, meshes, rigid motions and neighbours: what every other algorithm stands on. Pure.

pub mod cleaning;
pub mod cloud;
pub mod coincidence;
pub mod mesh;
pub mod neighbours;
pub mod normals;
pub mod organised;
pub mod own_frame;
pub mod progress;
pub mod se3;
pub mod surface;
pub mod thinning;
pub mod union_find;
pub mod viewpoint;

pub use cloud::{Bounds, Cloud};
pub use mesh::Mesh;
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
