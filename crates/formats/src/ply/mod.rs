//! PLY, the Stanford polygon format: ASCII, binary little-endian and binary big-endian.
//!
//! The reader takes what real files hold: headers with stray lines, elements and properties it has no use for
//! (skipped by their declaration), polygons (cut into fans) and the `range_grid` of organised scans.

mod body;
mod faces;
mod grid;
mod header;
mod reader;
mod views;
mod writer;

pub use reader::read;
pub use views::{support, views};
pub use writer::{VertexAttributes, write_cloud, write_cloud_text, write_mesh, write_surface};
use writer::{write_content, write_content_text};

use super::format::{BYTES, Content, Format, Reader, TextWriters, Writers};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "PLY",
    endings: &["ply"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Mesh, Content::Normals, Content::Colors, Content::Intensities, Content::Grid],
    reader: Reader::Surface(read),
    writers: Writers {
        cloud: Some(|cloud| write_cloud(cloud, None)),
        mesh: Some(write_content),
        text: Some(TextWriters { cloud: write_cloud_text, mesh: write_content_text }),
        ..Writers::NONE
    },
};
