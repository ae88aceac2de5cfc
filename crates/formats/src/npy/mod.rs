//! Arrays of NumPy: `.npy`, and `.npz`, a zip of several. An array of points has three columns or more; a structured one
//! names them.

mod array;
mod reader;

pub use reader::{read, read_npz};

use super::format::{BYTES, Content, Format, Reader, Writers};

const HOLDS: &[Content] = &[Content::Points, Content::Mesh, Content::Normals, Content::Colors, Content::Intensities];

/// One array.
pub const NPY: Format = Format {
    name: "NPY",
    endings: &["npy"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Normals, Content::Colors, Content::Intensities],
    reader: Reader::Surface(read),
    writers: Writers::NONE,
};

/// Several arrays by name.
pub const NPZ: Format = Format {
    name: "NPZ",
    endings: &["npz"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(read_npz),
    writers: Writers::NONE,
};
