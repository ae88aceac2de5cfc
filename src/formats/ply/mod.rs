//! PLY, the Stanford polygon format: ASCII, binary little-endian and binary big-endian.
//!
//! The reader takes what real files hold: headers with stray lines, elements and properties it has no use for
//! (skipped by their declaration), polygons (cut into fans) and the `range_grid` of organised scans.

mod body;
mod faces;
mod grid;
mod header;
mod reader;
mod writer;

pub use reader::read;
pub use writer::{write_cloud, write_mesh};
