//! The paper's figures: Obj of every trial, one panel a level of noise, as SVG.
//!
//! Written by hand: axes, lines and a legend are a page of text, and the plotting crate at hand (plotters) had its last
//! release in 2024.

use std::fmt::Write;

use super::NOISE;
use super::dataset::Dataset;
use super::statistics::trials_of;
use super::trial::{METHODS, TrialRecord};
use visage::pipeline::Method;

const PANEL_WIDTH: f64 = 320.0;
const PANEL_HEIGHT: f64 = 260.0;
/// Around a panel's plot: left, right, top, bottom.
const MARGINS: [f64; 4] = [52.0, 12.0, 58.0, 40.0];

/// Colours that the colour-blind tell apart (Okabe and Ito).
fn colour(method: Method) -> &'static str {
    match method {
        Method::LrsL1alm => "#e69f00",
        Method::MaIcp => "#d55e00",
        Method::MaAticp => "#0072b2",
        _ => "#009e73",
    }
}

/// One panel's mapping from (trial, Obj) to the page; Obj is logarithmic.
struct Panel {
    left: f64,
    trials: usize,
    /// Decimal logarithms of the least and the greatest Obj.
    range: (f64, f64),
}

impl Panel {
    fn x(&self, trial: usize) -> f64 {
        let width = PANEL_WIDTH - MARGINS[0] - MARGINS[1];
        self.left + MARGINS[0] + width * (trial as f64 + 0.5) / self.trials.max(1) as f64
    }

    fn y(&self, obj: f64) -> f64 {
        let height = PANEL_HEIGHT - MARGINS[2] - MARGINS[3];
        let (low, high) = self.range;
        MARGINS[2] + height * (high - obj.max(1e-9).log10()) / (high - low)
    }

    fn ends(&self) -> (f64, f64) {
        (self.left + MARGINS[0], self.left + PANEL_WIDTH - MARGINS[1])
    }
}

/// Draws a set's trials.
pub fn draw(dataset: &Dataset, records: &[&TrialRecord]) -> String {
    let truth = dataset.objective_mm2(&dataset.truth);
    let range = range_of(dataset, records, truth);
    let width = PANEL_WIDTH * NOISE.len() as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {PANEL_HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    legend(&mut svg, &dataset.name);
    for noise in 0..NOISE.len() {
        let trials = trials_of(records, &dataset.name, noise);
        let panel = Panel { left: PANEL_WIDTH * noise as f64, trials: trials.len(), range };
        axes(&mut svg, &panel, noise, truth);
        for method in METHODS {
            let objs: Vec<f64> = trials.iter().filter_map(|t| t.of(method)).map(|result| result.obj_mm2).collect();
            curve(&mut svg, &panel, colour(method), &objs);
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// The common range of all panels, a little wider than the values.
fn range_of(dataset: &Dataset, records: &[&TrialRecord], truth: f64) -> (f64, f64) {
    let of_set = records.iter().filter(|record| record.key.set == dataset.name);
    let objs = of_set.flat_map(|record| record.results.iter().map(|result| result.obj_mm2));
    let (low, high) = objs.fold((truth, truth), |(low, high), obj| (low.min(obj), high.max(obj)));
    ((0.95 * low).log10(), (1.1 * high).log10())
}

/// Writing into a string can't fail.
macro_rules! put {
    ($svg:expr, $($text:tt)*) => { let _ = writeln!($svg, $($text)*); };
}

fn legend(svg: &mut String, set: &str) {
    put!(svg, "<text x=\"12\" y=\"18\" font-weight=\"bold\">{set}: Obj in mm² by trial (logarithmic)</text>");
    for (index, method) in METHODS.into_iter().enumerate() {
        let x = 300.0 + 110.0 * index as f64;
        let colour = colour(method);
        put!(svg, "<circle cx=\"{x}\" cy=\"14\" r=\"3\" fill=\"{colour}\"/>");
        put!(svg, "<text x=\"{}\" y=\"18\">{method}</text>", x + 8.0);
    }
    let x = 300.0 + 110.0 * METHODS.len() as f64;
    put!(svg, "<path d=\"M{} 14H{}\" stroke=\"#888\" stroke-dasharray=\"4 3\"/>", x - 4.0, x + 20.0);
    put!(svg, "<text x=\"{}\" y=\"18\">ground truth</text>", x + 26.0);
}

fn axes(svg: &mut String, panel: &Panel, noise: usize, truth: f64) {
    let (left, right) = panel.ends();
    let bottom = PANEL_HEIGHT - MARGINS[3];
    let top = MARGINS[2];
    put!(svg, "<text x=\"{left}\" y=\"{}\">noise ±{} rad</text>", top - 10.0, NOISE[noise]);
    for tick in ticks(panel.range) {
        let y = panel.y(tick);
        put!(svg, "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#ddd\"/>");
        put!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{tick}</text>", left - 5.0, y + 4.0);
    }
    put!(svg, "<path d=\"M{left} {0:.1}H{right}\" stroke=\"#888\" stroke-dasharray=\"4 3\"/>", panel.y(truth));
    put!(svg, "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#333\"/>");
    put!(svg, "<text x=\"{left}\" y=\"{}\">trial 1</text>", bottom + 15.0);
    put!(svg, "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{}</text>", bottom + 15.0, panel.trials);
}

fn curve(svg: &mut String, panel: &Panel, colour: &str, objs: &[f64]) {
    let points: Vec<(f64, f64)> = objs.iter().enumerate().map(|(trial, obj)| (panel.x(trial), panel.y(*obj))).collect();
    let line: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    put!(svg, "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-opacity=\"0.5\"/>", line.join(" "));
    for (x, y) in points {
        put!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2\" fill=\"{colour}\"/>");
    }
}

/// Round values within a range of decimal logarithms: 1, 2 and 5 of each decade; also those between if they are few.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let within = |mantissas: &[u32]| -> Vec<f64> {
        let decades = low.floor() as i32..=high.ceil() as i32;
        let values = decades.flat_map(|decade| mantissas.iter().map(move |m| (f64::from(*m), decade)));
        // the quotient of a power of ten prints as it should: 3 / 10 is 0.3, 3 * 0.1 is not
        let values =
            values.map(|(m, decade)| if decade < 0 { m / 10f64.powi(-decade) } else { m * 10f64.powi(decade) });
        values.filter(|value| (low..=high).contains(&value.log10())).collect()
    };
    let few = within(&[1, 2, 5]);
    if few.len() >= 3 { few } else { within(&[1, 2, 3, 4, 5, 6, 7, 8, 9]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(ticks((-1.0, 1.0)), [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(ticks((-0.25, 0.01)), [0.6, 0.7, 0.8, 0.9, 1.0]);
    }

    #[test]
    fn greater_is_higher_and_later_is_further_right() {
        let panel = Panel { left: 0.0, trials: 50, range: (-1.0, 1.0) };
        assert!(panel.y(5.0) < panel.y(0.5) && panel.x(3) < panel.x(4));
        assert_eq!(panel.y(10.0), MARGINS[2]);
    }
}
