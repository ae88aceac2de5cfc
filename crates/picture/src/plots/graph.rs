//! What hangs together with what: things on a circle, in their order, and lines between them.

use super::sides;
use crate::color::{ALARM, CALM, FAINT, GROUND, INK};
use crate::drawing::{Anchor, Drawing, Item, shortened};
use crate::image::Rgb;
use crate::legend::font;
use crate::size::Size;

/// A thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// Its colour.
    pub color: Rgb,
    /// Whether it is part of the whole.
    pub is_placed: bool,
}

/// What holds two things together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// The one.
    pub i: usize,
    /// The other.
    pub j: usize,
    /// How much they share, 0 to 1.
    pub share: f64,
    /// Whether it holds badly.
    pub is_weak: bool,
}

/// Things and what holds them together.
pub fn graph(size: Size, title: &str, nodes: &[Node], edges: &[Edge]) -> Drawing {
    let mut drawing = Drawing::new(size);
    let [width, height] = sides(&drawing);
    let font = font(&drawing);
    let (line, rim) = (font.height(), 12.0);
    let most = ((width - 2.0 * rim) / font.advance()).max(3.0) as usize;
    drawing.text([rim, rim + line / 2.0], shortened(title, most), Anchor::Start, font, INK);
    legend(&mut drawing);
    // names stand at the sides, as far as there is room
    let longest = nodes.iter().map(|node| node.name.chars().count()).max().unwrap_or(0).min(24);
    let room = font.advance() * longest as f64 + 2.0 * line;
    let (top, bottom) = (rim + 2.4 * line, height - rim - 2.4 * line);
    let half = [(width / 2.0 - rim - room).max(0.2 * width), ((bottom - top) / 2.0 - line).max(0.2 * height)];
    let middle = [width / 2.0, (top + bottom) / 2.0];
    let count = nodes.len().max(1) as f64;
    let angle = |index: usize| std::f64::consts::TAU * index as f64 / count - std::f64::consts::FRAC_PI_2;
    let place = |index: usize, stretch: f64| {
        let (sine, cosine) = angle(index).sin_cos();
        [middle[0] + half[0] * cosine + stretch * cosine, middle[1] + half[1] * sine + stretch * sine]
    };
    // what holds badly lies above what holds well
    let mut ordered: Vec<&Edge> = edges.iter().filter(|edge| edge.i.max(edge.j) < nodes.len()).collect();
    ordered.sort_by_key(|edge| edge.is_weak);
    let thick = (height / 160.0).clamp(1.5, 14.0);
    for edge in ordered {
        let strength = edge.share.clamp(0.0, 1.0);
        let color = if edge.is_weak { ALARM } else { mixed(FAINT, CALM, 0.25 + 0.75 * strength) };
        let points = vec![place(edge.i, 0.0), place(edge.j, 0.0)];
        let width = if edge.is_weak { thick * 0.6 } else { (thick * strength).max(1.0) };
        drawing.items.push(Item::Line { points, width, color, dashed: edge.is_weak });
    }
    let radius = (0.35 * half[0].min(half[1]) * std::f64::consts::TAU / count).clamp(2.5, 0.55 * line);
    // of many things only some have room for their name
    let step = (line / ((half[0] + half[1]) / 2.0 * std::f64::consts::TAU / count).max(1e-3)).ceil().max(1.0) as usize;
    for (index, node) in nodes.iter().enumerate() {
        let color = if node.is_placed { node.color } else { GROUND };
        let rim = if node.is_placed { INK } else { ALARM };
        drawing.items.push(Item::Disc { at: place(index, 0.0), radius, color, rim });
        if index % step != 0 {
            continue;
        }
        let cosine = angle(index).cos();
        let anchor = match cosine {
            c if c > 0.2 => Anchor::Start,
            c if c < -0.2 => Anchor::End,
            _ => Anchor::Middle,
        };
        let ink = if node.is_placed { INK } else { ALARM };
        let beside = radius + if anchor == Anchor::Middle { 0.9 * line } else { 0.5 * line };
        drawing.text(place(index, beside), shortened(&node.name, 24), anchor, font, ink);
    }
    drawing
}

/// What the lines mean, below.
fn legend(drawing: &mut Drawing) {
    let [width, height] = sides(drawing);
    let font = font(drawing);
    let y = height - 12.0 - font.height() / 2.0;
    let entries = [("share surface", CALM, false), ("weak: look here", ALARM, true)];
    let mut x = 12.0;
    for (text, color, dashed) in entries {
        if x + 40.0 + font.width(text) > width {
            return;
        }
        drawing.items.push(Item::Line { points: vec![[x, y], [x + 28.0, y]], width: 3.0, color, dashed });
        drawing.text([x + 36.0, y], text, Anchor::Start, font, INK);
        x += 36.0 + font.width(text) + 2.0 * font.advance();
    }
}

fn mixed(from: Rgb, to: Rgb, share: f64) -> Rgb {
    std::array::from_fn(|k| (f64::from(from[k]) + share * (f64::from(to[k]) - f64::from(from[k]))).round() as u8)
}
