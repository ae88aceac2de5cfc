//! From scans and initial poses to accurate poses and a verdict. Pure.
//!
//! [`method`] chooses between [`joint`] and the paper's family; [`multiview`] is Algorithm 1 of the paper; the other
//! modules are their parts.

pub mod candidates;
pub mod cleaning;
pub mod colour;
pub mod copies;
pub mod covariance;
pub mod free_space;
pub mod global;
pub mod hinted;
pub mod hints;
pub mod joint;
pub mod low_rank;
pub mod method;
pub mod motion_averaging;
pub mod multiview;
pub mod objective;
pub mod overlap;
pub mod pairwise;
pub mod paper_objective;
pub mod quality;
pub mod report;
pub mod resolution;
pub mod rigid_fit;
pub mod sensor;
pub mod standing_still;
pub mod threshold;
pub mod trimmed_icp;
pub mod view;
pub mod view_graph;
pub mod viewpoint;
pub mod walls;
pub mod weak_axes;
pub mod witness;
