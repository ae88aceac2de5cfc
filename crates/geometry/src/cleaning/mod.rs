//! What of one scan or model, looked at by itself, is not the object: planes that it stands on or before ([`support_plane`]), points far off
//! ([`outliers`]). It is looked at by a coarse [`CoarseScan`].

mod coarse_scan;
pub mod outliers;
pub mod support_plane;

pub use coarse_scan::CoarseScan;
