//! What of one scan or model is not the object: planes that it stands on or before ([`support_plane`]), points far off
//! ([`outliers`]). Each is looked at alone, by a coarse [`CoarseScan`].

mod coarse_scan;
pub mod outliers;
pub mod support_plane;

pub use coarse_scan::CoarseScan;
