//! How scans get their place: from scans and initial poses, or from the scans alone, to accurate poses, their covariance and a
//! verdict. Pure. [`register::register`] does all of it in one call, with an example.
//!
//! [`method`] chooses between [`joint`], the paper's family in [`averaging`], and the ICP of two scans in [`pairwise`]; what
//! any of them leaves is an [`outcome`]. [`global`] finds poses from the scans alone.
//!
//! - [`view`], [`sensor`], [`resolution`]: a scan made ready; how it was taken; what a set can resolve
//! - [`cleaning`]: what is left out of the scans of a set
//! - [`candidates`], [`overlap`], [`view_graph`]: which pairs may meet, by how much they overlap, which are registered
//! - [`pairwise`], [`averaging`], [`joint`]: from poses nearby
//! - [`pose_convention`]: how given poses are meant
//! - [`least_squares`]: what every alignment is made of
//! - [`global`]: from the scans alone; [`hints`], [`hinted`]: what a person says of them
//! - [`covariance`], [`quality`], [`objective`]: how well each pose is known; the verdict; figures of merit
//! - [`conclusion`]: all that is known, weighed at the end
//! - [`report`]: what is said of all of it
//! - [`register`]: all of that in one call

// equations are named as in the paper, [P n], which rustdoc takes for links
#![allow(rustdoc::broken_intra_doc_links, rustdoc::redundant_explicit_links)]

pub use visage_geometry as geometry;

pub mod averaging;
pub mod candidates;
pub mod cleaning;
pub mod conclusion;
pub mod covariance;
pub mod global;
pub mod hinted;
pub mod hints;
pub mod joint;
pub mod least_squares;
pub mod method;
pub mod objective;
pub mod outcome;
pub mod overlap;
pub mod pairwise;
pub mod pose_convention;
pub mod quality;
pub mod register;
pub mod report;
pub mod resolution;
pub mod sensor;
pub mod view;
pub mod view_graph;
