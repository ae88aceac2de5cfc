//! Figures over steps, on a scale of powers of ten.

use super::sides;
use crate::color::{FAINT, INK, category};
use crate::drawing::{Anchor, Drawing, Item, shortened};
use crate::image::Rgb;
use crate::legend::font;
use crate::size::Size;

/// One row of figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// What they are.
    pub name: String,
    /// One for each step; what is not above 0 has no place and leaves a gap.
    pub values: Vec<f64>,
}

/// Rows of figures over the same steps. `breaks` are steps before which something changed, with a word for what begins there.
pub fn curves(size: Size, title: &str, step: &str, series: &[Series], breaks: &[(usize, String)]) -> Drawing {
    let mut drawing = Drawing::new(size);
    let [width, height] = sides(&drawing);
    let font = font(&drawing);
    let (line, rim) = (font.height(), 12.0);
    let most = ((width - 2.0 * rim) / font.advance()).max(3.0) as usize;
    drawing.text([rim, rim + line / 2.0], shortened(title, most), Anchor::Start, font, INK);
    let (left, right) = (rim + font.width("1e-00 "), width - rim - font.advance());
    let (top, bottom) = (rim + (2.4 + series.len() as f64 * 1.15) * line, height - rim - 2.4 * line);
    let steps = series.iter().map(|row| row.values.len()).max().unwrap_or(0);
    let logs =
        || series.iter().flat_map(|row| &row.values).filter(|value| is_shown(**value)).map(|value| value.log10());
    let (low, high) = (logs().fold(f64::INFINITY, f64::min).floor(), logs().fold(f64::NEG_INFINITY, f64::max).ceil());
    if steps == 0 || !low.is_finite() || bottom - top < line {
        drawing.text([width / 2.0, height / 2.0], "nothing to show", Anchor::Middle, font, INK);
        return drawing;
    }
    let high = high.max(low + 1.0);
    let x = |index: f64| left + (right - left) * if steps > 1 { index / (steps - 1) as f64 } else { 0.5 };
    let y = |value: f64| bottom - (bottom - top) * (value.log10() - low) / (high - low);
    let power_step = ((high - low) * 1.6 * line / (bottom - top)).ceil().max(1.0) as i32;
    for power in (low as i32..=high as i32).step_by(power_step as usize) {
        let at = y(10f64.powi(power));
        drawing.line([left, at], [right, at], 1.0, FAINT);
        drawing.text([left - 6.0, at], power_of_ten(power), Anchor::End, font, INK);
    }
    for (index, name) in breaks {
        let at = x((*index as f64 - 0.5).max(0.0));
        let points = vec![[at, top], [at, bottom]];
        drawing.items.push(Item::Line { points, width: 1.0, color: [140, 142, 148], dashed: true });
        drawing.text([at + 4.0, top - 0.6 * line], name.as_str(), Anchor::Start, font, [110, 112, 118]);
    }
    drawing.line([left, bottom], [right, bottom], 1.5, INK);
    let label_step = ((steps as f64 * font.width("000 ")) / (right - left)).ceil().max(1.0) as usize;
    for index in (0..steps).step_by(label_step) {
        drawing.text([x(index as f64), bottom + 0.8 * line], (index + 1).to_string(), Anchor::Middle, font, INK);
    }
    drawing.text([right, bottom + 1.9 * line], step, Anchor::End, font, INK);
    for (row, series) in series.iter().enumerate() {
        curve(&mut drawing, series, category(row), |index, value| [x(index as f64), y(value)]);
        let at = rim + (1.9 + 1.15 * row as f64) * line;
        drawing.line([rim, at], [rim + 24.0, at], 3.0, category(row));
        drawing.text([rim + 32.0, at], series.name.as_str(), Anchor::Start, font, INK);
    }
    drawing
}

fn is_shown(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

fn curve(drawing: &mut Drawing, series: &Series, color: Rgb, place: impl Fn(usize, f64) -> [f64; 2]) {
    let values: Vec<(usize, f64)> = series.values.iter().copied().enumerate().collect();
    for stretch in values.split(|(_, value)| !is_shown(*value)) {
        let points: Vec<[f64; 2]> = stretch.iter().map(|(index, value)| place(*index, *value)).collect();
        for at in &points {
            drawing.items.push(Item::Disc { at: *at, radius: 3.0, color, rim: color });
        }
        drawing.items.push(Item::Line { points, width: 2.0, color, dashed: false });
    }
}

fn power_of_ten(power: i32) -> String {
    match power {
        -3..=3 => format!("{}", 10f64.powi(power)),
        power => format!("1e{power}"),
    }
}
