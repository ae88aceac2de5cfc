//! The whole of an algorithm on code-made input whose answer is known exactly.

mod additions;
mod conventions;
mod faces;
mod far;
mod registration;
mod surface;
mod turntables;
mod unsound;
