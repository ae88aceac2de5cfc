//! The ROC curves as a picture.

use std::fmt::Write;

use super::Judged;
use super::tables::{METHODS, scores};
use visage::gallery::measures;

/// The edge of the plot, pixels, and the margin around it.
const EDGE: f64 = 320.0;
const MARGIN: f64 = 48.0;
const COLOURS: [&str; 3] = ["#999999", "#d07020", "#1060a0"];

/// An SVG of the three methods' curves.
pub fn picture(all: &[Judged]) -> String {
    let full = EDGE + 2.0 * MARGIN;
    let place = |x: f64, y: f64| format!("{:.1},{:.1}", MARGIN + EDGE * x, MARGIN + EDGE * (1.0 - y));
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{full}\" height=\"{full}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{full}\" height=\"{full}\" fill=\"white\"/>\n\
         <rect x=\"{MARGIN}\" y=\"{MARGIN}\" width=\"{EDGE}\" height=\"{EDGE}\" fill=\"none\" stroke=\"black\"/>\n"
    );
    for ((method, name), (line, colour)) in METHODS.into_iter().zip(COLOURS.into_iter().enumerate()) {
        let [faces, others] = scores(all, method);
        let curve = measures::roc(&faces, &others);
        let points = curve.iter().map(|p| place(p.false_positive_rate, p.true_positive_rate));
        let points: Vec<String> = std::iter::once(place(0.0, 0.0)).chain(points).collect();
        let auc = measures::auc(&faces, &others).unwrap_or(f64::NAN);
        let (x, y) = (MARGIN + 0.4 * EDGE, MARGIN + EDGE - 50.0 + 16.0 * line as f64);
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>\n\
             <text x=\"{x}\" y=\"{y}\" fill=\"{colour}\">{name}: AUC {auc:.3}</text>",
            points.join(" ")
        );
    }
    let (middle, low) = (MARGIN + EDGE / 2.0, MARGIN + EDGE + 28.0);
    let _ = writeln!(
        svg,
        "<text x=\"{middle}\" y=\"{low}\" text-anchor=\"middle\">share of other things taken for faces</text>\n\
         <text x=\"16\" y=\"{middle}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {middle})\">share of faces \
         found</text>\n</svg>"
    );
    svg
}
