//! Shares between things, each with each.

use super::sides;
use crate::color::{FAINT, GROUND, INK, Map};
use crate::drawing::{Anchor, Drawing, shortened};
use crate::legend::{font, number};
use crate::size::Size;

/// Rows of shares (0 to 1) of the things of these names. The diagonal says nothing and stays empty.
pub fn matrix(size: Size, title: &str, names: &[String], rows: &[Vec<f64>]) -> Drawing {
    let mut drawing = Drawing::new(size);
    let [width, height] = sides(&drawing);
    let font = font(&drawing);
    let (line, rim) = (font.height(), 12.0);
    drawing.text(
        [rim, rim + line / 2.0],
        shortened(title, letters(width - 2.0 * rim, font.advance())),
        Anchor::Start,
        font,
        INK,
    );
    let count = names.len().max(1);
    let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
    // "12 name": the number is that of the column
    let number_width = font.width(&format!("{} ", count - 1));
    let most_label = (0.3 * width).max(number_width);
    let label = (number_width + font.advance() * longest as f64).min(most_label);
    let bar = font.width("0.00") + 2.2 * line;
    let (left, top) = (rim + label + 6.0, rim + 2.6 * line);
    let edge = ((width - left - bar - rim).max(1.0)).min(height - top - rim - line);
    let cell = (edge / count as f64).max(0.0);
    let name_letters = letters(label - number_width, font.advance());
    for (row, name) in names.iter().enumerate() {
        let y = top + (row as f64 + 0.5) * cell;
        // of many only every so-many-th has room
        let step = (line / cell.max(1e-3)).ceil().max(1.0) as usize;
        if row % step == 0 {
            drawing.text([left - 6.0, y], format!("{} {row}", shortened(name, name_letters)), Anchor::End, font, INK);
        }
        let column_step = (font.width("00 ") / cell.max(1e-3)).ceil().max(1.0) as usize;
        if row % column_step == 0 {
            drawing.text(
                [left + (row as f64 + 0.5) * cell, top - 0.7 * line],
                row.to_string(),
                Anchor::Middle,
                font,
                INK,
            );
        }
        for (column, share) in rows.get(row).into_iter().flatten().enumerate().take(count) {
            let at = [left + column as f64 * cell, top + row as f64 * cell];
            // a share of nothing is no colour of the map
            let color = if row == column || *share <= 0.0 { [238, 238, 238] } else { Map::Sequential.color(*share) };
            let gap = if cell > 6.0 { 1.0 } else { 0.0 };
            drawing.rect(at, [cell - gap, cell - gap], color);
            if cell >= font.width("0.00") + 4.0 && row != column {
                let ink = if *share > 0.0 && *share < 0.7 { GROUND } else { INK };
                drawing.text(
                    [at[0] + cell / 2.0, at[1] + cell / 2.0],
                    number((share * 100.0).round() / 100.0),
                    Anchor::Middle,
                    font,
                    ink,
                );
            }
        }
    }
    drawing.frame([left, top], [edge, edge], 1.0, FAINT);
    scale(&mut drawing, [left + edge + 1.2 * line, top], edge.min(12.0 * line));
    drawing
}

/// From 0 to 1, beside the matrix.
fn scale(drawing: &mut Drawing, [left, top]: [f64; 2], tall: f64) {
    let font = font(drawing);
    let steps = 48;
    for step in 0..steps {
        let share = f64::from(step) / f64::from(steps - 1);
        let height = tall / f64::from(steps);
        drawing.rect(
            [left, top + tall - f64::from(step + 1) * height],
            [0.8 * font.height(), height + 0.6],
            Map::Sequential.color(share),
        );
    }
    for (share, text) in [(0.0, "0"), (0.5, "0.5"), (1.0, "1")] {
        let half = font.height() / 2.0;
        let y = (top + tall * (1.0 - share)).min(top + tall - half).max(top + half);
        drawing.text([left + 0.8 * font.height() + 6.0, y], text, Anchor::Start, font, INK);
    }
}

/// How many letters have room.
fn letters(room: f64, advance: f64) -> usize {
    (room / advance).max(3.0) as usize
}
