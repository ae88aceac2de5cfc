//! Figures as plots: [`matrix`](mod@matrix), [`graph`](mod@graph), [`curves`](mod@curves). Each is a drawing, so it can be had as pixels
//! and as SVG.

mod curves;
mod graph;
mod matrix;

pub use curves::{Series, curves};
pub use graph::{Edge, Node, graph};
pub use matrix::matrix;

use crate::drawing::Drawing;

/// The middle of a drawing's width and height.
fn sides(drawing: &Drawing) -> [f64; 2] {
    [f64::from(drawing.size.width()), f64::from(drawing.size.height())]
}
