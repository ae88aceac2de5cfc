//! What of one scan or model is not the object: planes that it stands on or before ([`support`]), points far off
//! ([`strays`]). Each is looked at alone, by a coarse [`Survey`].

pub mod strays;
pub mod support;
mod survey;

pub use survey::Survey;
