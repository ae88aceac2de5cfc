//! One cloud from the posed views. Pure.

pub mod merge;
