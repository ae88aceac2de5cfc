//! VTK's legacy format, ASCII and binary, up to version 5.1: the points of any dataset that lists them, with normals,
//! colours and intensities, and the polygons and strips of surfaces.

mod arrays;
mod cells;
mod reader;

pub use reader::read;

use super::format::{BYTES, Content, Format, Reader, Writers};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "VTK",
    endings: &["vtk"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Mesh, Content::Normals, Content::Colors, Content::Intensities],
    reader: Reader::Surface(read),
    writers: Writers::NONE,
};
