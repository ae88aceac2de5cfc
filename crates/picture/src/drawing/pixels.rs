//! Shapes to pixels; a pixel that is covered in part takes a part of the colour.

use super::{Anchor, Font, Item};
use crate::image::{Image, Rgb};

/// Dashes and the gaps between them, in widths of the line.
const DASH: [f64; 2] = [4.0, 3.0];

/// Draws one thing; one whose place is no number is left out.
pub(super) fn paint(item: &Item, image: &mut Image) {
    match item {
        Item::Line { points, width, color, dashed } => {
            let mut before = 0.0;
            for pair in points.windows(2) {
                stroke(image, [pair[0], pair[1]], *width, *color, dashed.then_some(before));
                before += length(pair[0], pair[1]);
            }
        }
        Item::Rect { at, size, color } => rect(image, *at, *size, *color),
        Item::Disc { at, radius, color, rim } => disc(image, *at, *radius, *color, *rim),
        Item::Text { at, text, anchor, font, color } => letters(image, *at, text, *anchor, *font, *color),
    }
}

fn length([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    (bx - ax).hypot(by - ay)
}

/// The pixels of a box that are on the picture; none if a bound is no number.
fn pixels(image: &Image, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) -> impl Iterator<Item = (i64, i64)> + use<> {
    let cut = |x: f64, most: u32| x.clamp(0.0, f64::from(most)) as i64;
    let (width, height) = (image.size().width(), image.size().height());
    let is_sound = [left, right, top, bottom].iter().all(|x| x.is_finite());
    let columns = cut(left.floor(), width)..cut(right.ceil(), width);
    let rows = if is_sound { cut(top.floor(), height)..cut(bottom.ceil(), height) } else { 0..0 };
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
}

/// A stretch of a line with round ends. `before` is how long the line was up to there, if it is dashed.
fn stroke(image: &mut Image, [a, b]: [[f64; 2]; 2], width: f64, color: Rgb, before: Option<f64>) {
    let half = width / 2.0 + 0.5;
    let (x, y) = ([a[0].min(b[0]) - half, a[0].max(b[0]) + half], [a[1].min(b[1]) - half, a[1].max(b[1]) + half]);
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = (along[0] * along[0] + along[1] * along[1]).max(1e-12);
    for (column, row) in pixels(image, x, y) {
        let at = [column as f64 + 0.5 - a[0], row as f64 + 0.5 - a[1]];
        let share = ((at[0] * along[0] + at[1] * along[1]) / length2).clamp(0.0, 1.0);
        let distance = (at[0] - share * along[0]).hypot(at[1] - share * along[1]);
        let is_gap = before.is_some_and(|before| {
            let place = (before + share * length2.sqrt()) / width.max(1.0);
            place.rem_euclid(DASH[0] + DASH[1]) > DASH[0]
        });
        if !is_gap {
            image.blend(column, row, color, (half - distance).clamp(0.0, 1.0) as f32);
        }
    }
}

fn rect(image: &mut Image, [left, top]: [f64; 2], [width, height]: [f64; 2], color: Rgb) {
    let (right, bottom) = (left + width, top + height);
    let share = |pixel: i64, from: f64, to: f64| ((pixel + 1) as f64).min(to) - (pixel as f64).max(from);
    for (x, y) in pixels(image, [left, right], [top, bottom]) {
        let covered = share(x, left, right).max(0.0) * share(y, top, bottom).max(0.0);
        image.blend(x, y, color, covered as f32);
    }
}

fn disc(image: &mut Image, at: [f64; 2], radius: f64, color: Rgb, rim: Rgb) {
    let rim_width = (radius * 0.25).clamp(1.0, 3.0);
    let outer = radius + rim_width;
    let sides = |middle: f64| [middle - outer - 1.0, middle + outer + 1.0];
    for (x, y) in pixels(image, sides(at[0]), sides(at[1])) {
        let distance = length(at, [x as f64 + 0.5, y as f64 + 0.5]);
        image.blend(x, y, rim, (outer + 0.5 - distance).clamp(0.0, 1.0) as f32);
        image.blend(x, y, color, (radius + 0.5 - distance).clamp(0.0, 1.0) as f32);
    }
}

fn letters(image: &mut Image, [x, y]: [f64; 2], text: &str, anchor: Anchor, font: Font, color: Rgb) {
    let width = font.width(text);
    let left = match anchor {
        Anchor::Start => x,
        Anchor::Middle => x - width / 2.0,
        Anchor::End => x - width,
    };
    let top = y - font.height() / 2.0;
    if !(left.abs() < 1e5 && top.abs() < 1e5) {
        return;
    }
    let most = (f64::from(image.size().width()) - left).max(0.0) / font.advance();
    for (place, letter) in text.chars().enumerate().take(most.ceil() as usize) {
        let Some(raster) = font.letter(letter) else { continue };
        let start = (left + place as f64 * font.advance()).round() as i64;
        for (row, shades) in raster.rows().enumerate() {
            for (column, shade) in shades.iter().enumerate().filter(|(_, shade)| **shade > 0) {
                let (x, y) = (start + column as i64, top.round() as i64 + row as i64);
                image.blend(x, y, color, f32::from(*shade) / 255.0);
            }
        }
    }
}
