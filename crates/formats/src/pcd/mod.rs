//! PCD, the format of the Point Cloud Library: ASCII, binary and compressed binary, versions 0.5 to 0.7.
//!
//! Files of several rows (`HEIGHT` above 1) are organised scans: they come with their range grid. Points that are NaN
//! are pixels that saw nothing.

mod header;
mod lzf;
mod reader;
mod writer;

pub use reader::read;
pub use writer::write_cloud;

use super::format::{BYTES, Content, Format, Reader, Writers};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "PCD",
    endings: &["pcd"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Normals, Content::Colors, Content::Intensities, Content::Grid, Content::Sensor],
    reader: Reader::Surface(read),
    writers: Writers { cloud: Some(write_cloud), ..Writers::NONE },
};
