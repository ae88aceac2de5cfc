//! The same as SVG.

use std::fmt::Write;

use super::{Anchor, Drawing, Item};
use crate::color::GROUND;
use crate::image::Rgb;

/// The whole as a document of its own.
pub(super) fn written(drawing: &Drawing) -> String {
    let (width, height) = (drawing.size.width(), drawing.size.height());
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace\">\
         <rect width=\"100%\" height=\"100%\" fill=\"{}\"/>",
        name(GROUND)
    );
    for item in drawing.items.iter().filter(|item| is_sound(item)) {
        put(&mut out, item);
    }
    out.push_str("</svg>\n");
    out
}

/// Whether its place can be written as numbers.
fn is_sound(item: &Item) -> bool {
    let is_sound = |numbers: &[f64]| numbers.iter().all(|x| x.abs() < 1e6);
    match item {
        Item::Line { points, width, .. } => is_sound(points.as_flattened()) && is_sound(&[*width]),
        Item::Rect { at, size, .. } => is_sound(at) && is_sound(size),
        Item::Disc { at, radius, .. } => is_sound(at) && is_sound(&[*radius]),
        Item::Text { at, .. } => is_sound(at),
    }
}

fn put(out: &mut String, item: &Item) {
    // writing to a text can't fail
    let _ = match item {
        Item::Line { points, width, color, dashed } => {
            let places: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            let dashes =
                if *dashed { format!(" stroke-dasharray=\"{} {}\"", 4.0 * width, 3.0 * width) } else { String::new() };
            write!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width:.1}\"{dashes}/>",
                places.join(" "),
                name(*color)
            )
        }
        Item::Rect { at: [x, y], size: [width, height], color } => write!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{}\"/>",
            name(*color)
        ),
        Item::Disc { at: [x, y], radius, color, rim } => write!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"/>",
            name(*color),
            name(*rim)
        ),
        Item::Text { at: [x, y], text, anchor, font, color } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            write!(
                out,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" dominant-baseline=\"central\" \
                 font-size=\"{:.0}\" fill=\"{}\">{}</text>",
                // letters are as wide as those of the pictures
                font.advance() / 0.6,
                name(*color),
                escaped(text)
            )
        }
    };
}

fn name([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Names of scans are users' text; XML knows no control characters.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            letter if letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}') => out.push('?'),
            letter => out.push(letter),
        }
    }
    out
}
