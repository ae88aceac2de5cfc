//! PCD, the format of the Point Cloud Library: ASCII, binary and compressed binary, versions 0.5 to 0.7.
//!
//! Files of several rows (`HEIGHT` above 1) are organised scans: they come with their range grid. Points that are NaN
//! are pixels that saw nothing.

mod header;
mod lzf;
mod reader;

pub use reader::read;
