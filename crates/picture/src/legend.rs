//! What the sizes and colours of a picture mean.

use crate::color::{GROUND, INK, Map};
use crate::drawing::{Anchor, Drawing, Font, shortened};
use crate::image::Rgb;
use crate::size::Size;

/// Room to the rim of the picture.
const RIM: f64 = 12.0;

/// A bar that shows a length, in the lower left corner: a round number of units, about a fifth of the picture.
pub fn scale_bar(drawing: &mut Drawing, pixels_per_unit: f64, unit: &str) {
    let (width, height) = (f64::from(drawing.size.width()), f64::from(drawing.size.height()));
    let length = round_below(0.24 * width / pixels_per_unit);
    let pixels = length * pixels_per_unit;
    if !(pixels.is_finite() && pixels > 4.0) {
        return;
    }
    let font = font(drawing);
    let y = height - RIM;
    for x in [RIM, RIM + pixels] {
        drawing.line([x, y - 4.0], [x, y + 4.0], 2.0, INK);
    }
    drawing.line([RIM, y], [RIM + pixels, y], 2.0, INK);
    let unit = if unit == "unknown" || unit.is_empty() { " (unit unknown)".to_owned() } else { format!(" {unit}") };
    drawing.text([RIM, y - 6.0 - font.height() / 2.0], number(length) + &unit, Anchor::Start, font, INK);
}

/// What the colours of a map mean: a bar at the right with figures at its ends and in its middle.
pub fn color_bar(drawing: &mut Drawing, map: Map, [least, most]: [f64; 2], title: &str) {
    let (width, height) = (f64::from(drawing.size.width()), f64::from(drawing.size.height()));
    let font = font(drawing);
    let line = font.height();
    let (thick, top) = (line.max(0.02 * width), RIM + 1.8 * line);
    let tall = (height - top - RIM - line).min(0.7 * height).max(2.0 * line);
    let left = width - RIM - thick;
    let steps = 64;
    for step in 0..steps {
        let share = f64::from(step) / f64::from(steps - 1);
        let step_height = tall / f64::from(steps);
        let y = top + tall - f64::from(step + 1) * step_height;
        drawing.rect([left, y], [thick, step_height + 0.6], map.color(share));
    }
    drawing.frame([left, top], [thick, tall], 1.0, INK);
    for (share, figure) in [(0.0, least), (0.5, (least + most) / 2.0), (1.0, most)] {
        let y = top + tall * (1.0 - share);
        drawing.line([left - 4.0, y], [left, y], 1.0, INK);
        drawing.text([left - 8.0, y], number(figure), Anchor::End, font, INK);
    }
    drawing.text([width - RIM, RIM + line / 2.0], title, Anchor::End, font, INK);
}

/// The share of a picture's width that a list takes at most.
const KEY: f64 = 0.3;

/// How wide a list of single colours is, with some room beside it.
pub fn key_width(size: Size, entries: &[(String, Rgb)]) -> f64 {
    let font = font_of(size);
    let longest = entries.iter().map(|(name, _)| font.width(name)).fold(0.0, f64::max);
    let wide = if entries.is_empty() { 0.0 } else { 2.0 * RIM + square(font) * 1.6 + longest };
    wide.min(KEY * f64::from(size.width()))
}

/// The side of a square of colour beside a word.
fn square(font: Font) -> f64 {
    0.62 * font.height()
}

/// What single colours mean: a list at the left; what has no room is counted.
pub fn key(drawing: &mut Drawing, entries: &[(String, Rgb)]) {
    let height = f64::from(drawing.size.height());
    let font = font(drawing);
    let line = font.height() * 1.15;
    let side = square(font);
    // the scale bar has its place below
    let room = ((height - 2.0 * RIM - 3.0 * line) / line).max(1.0) as usize;
    let shown = if entries.len() > room { room.saturating_sub(1) } else { entries.len() };
    let room_beside = KEY * f64::from(drawing.size.width()) - RIM - 1.6 * side;
    let letters = (room_beside / font.advance()).max(0.0) as usize;
    for (row, (name, color)) in entries.iter().take(shown).enumerate() {
        let y = RIM + (row as f64 + 0.5) * line;
        drawing.rect([RIM, y - side / 2.0], [side, side], *color);
        drawing.text([RIM + 1.6 * side, y], shortened(name, letters.max(6)), Anchor::Start, font, INK);
    }
    if shown < entries.len() {
        let y = RIM + (shown as f64 + 0.5) * line;
        drawing.text([RIM, y], format!("and {} more", entries.len() - shown), Anchor::Start, font, INK);
    }
}

/// How high a line of words at the top of a picture is, with its rim.
pub fn title_height(size: Size) -> f64 {
    RIM + font_of(size).height()
}

/// A title in the upper left corner.
pub fn title(drawing: &mut Drawing, text: &str) {
    let font = font(drawing);
    let letters = ((f64::from(drawing.size.width()) - 2.0 * RIM) / font.advance()) as usize;
    drawing.text([RIM, RIM + font.height() / 2.0], shortened(text, letters.max(3)), Anchor::Start, font, INK);
}

/// A place with a word.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The place.
    pub at: [f64; 2],
    /// The word.
    pub label: String,
    /// The colour of the place.
    pub color: Rgb,
    /// Whether something is before it: it is drawn pale.
    pub is_hidden: bool,
}

/// Marks with their words beside them, within the picture, where they don't lie on each other.
pub fn marks(drawing: &mut Drawing, marks: &[Mark]) {
    let (width, height) = (drawing.size.width(), drawing.size.height());
    let radius = (f64::from(drawing.size.height()) * 0.009).clamp(3.0, 12.0);
    let pale = |color: Rgb| color.map(|value| 128 + value / 2);
    let font = font(drawing);
    let mut taken: Vec<[f64; 4]> = marks.iter().map(|mark| around(mark.at, [2.0 * radius, 2.0 * radius])).collect();
    for mark in marks {
        let color = if mark.is_hidden { pale(mark.color) } else { mark.color };
        let rim = if mark.is_hidden { pale(INK) } else { GROUND };
        drawing.items.push(crate::drawing::Item::Disc { at: mark.at, radius, color, rim });
    }
    for mark in marks {
        let size = [font.width(&mark.label), 0.8 * font.height()];
        let [x, y] = [radius + 5.0 + size[0] / 2.0, radius + 3.0 + size[1] / 2.0];
        let places = [[x, 0.0], [-x, 0.0], [0.0, -y], [0.0, y], [x, -y], [-x, y], [x, y], [-x, -y]];
        let place = |[dx, dy]: [f64; 2]| [mark.at[0] + dx, mark.at[1] + dy];
        let is_within = |[left, top, right, bottom]: [f64; 4]| {
            left >= 0.0 && top >= 0.0 && right <= f64::from(width) && bottom <= f64::from(height)
        };
        let is_free = |at: &[f64; 2]| taken.iter().all(|other| !overlap(&around(*at, size), other));
        let seen: Vec<[f64; 2]> = places.map(place).into_iter().filter(|at| is_within(around(*at, size))).collect();
        let at = seen.iter().copied().find(is_free).or(seen.first().copied()).unwrap_or(place(places[0]));
        taken.push(around(at, size));
        // letters stand on a bright rim: surfaces are of any colour
        for [x, y] in [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]] {
            drawing.text([at[0] + x, at[1] + y], mark.label.as_str(), Anchor::Middle, font, GROUND);
        }
        let ink = if mark.is_hidden { pale(INK) } else { INK };
        drawing.text(at, mark.label.as_str(), Anchor::Middle, font, ink);
    }
}

/// Left, top, right, bottom of a box about a place.
fn around([x, y]: [f64; 2], [width, height]: [f64; 2]) -> [f64; 4] {
    [x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0]
}

fn overlap(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// The letters that suit a drawing.
pub fn font(drawing: &Drawing) -> Font {
    font_of(drawing.size)
}

fn font_of(size: Size) -> Font {
    Font::for_side(size.width().min(size.height()))
}

/// The largest of 1, 2, 5, 10, ... that is not above a length.
pub fn round_below(length: f64) -> f64 {
    if !(length.is_finite() && length > 0.0) {
        return f64::NAN;
    }
    let power = 10f64.powf(length.log10().floor());
    [5.0, 2.0].into_iter().map(|step| step * power).find(|step| *step <= length * (1.0 + 1e-9)).unwrap_or(power)
}

/// A number in three digits, without what says nothing.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let size = value.abs();
    if size == 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.1e}");
    }
    let digits = (2.0 - size.log10().floor()).clamp(0.0, 6.0);
    let text = format!("{value:.0$}", digits as usize);
    if !text.contains('.') {
        return text;
    }
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::Item;

    fn texts(drawing: &Drawing) -> Vec<&str> {
        fn text(item: &Item) -> Option<&str> {
            if let Item::Text { text, .. } = item { Some(text) } else { None }
        }
        drawing.items.iter().filter_map(text).collect()
    }

    #[test]
    fn numbers_are_short() {
        let told = [0.0, -0.0, 1.0, 0.5, 12.345, 1234.5, 0.000_012, 3e9, -0.25, f64::NAN].map(number);
        assert_eq!(told, ["0", "0", "1", "0.5", "12.3", "1234", "1.2e-5", "3.0e9", "-0.25", "-"]);
    }

    #[test]
    fn scale_bars_have_round_lengths() {
        assert_eq!(
            [0.9, 1.0, 1.9, 2.0, 4.9, 7.0, 99.0, 0.03].map(round_below),
            [0.5, 1.0, 1.0, 2.0, 2.0, 5.0, 50.0, 0.02]
        );
        let mut drawing = Drawing::new(Size::clamped(400, 300));
        scale_bar(&mut drawing, 2.0, "mm");
        assert_eq!(texts(&drawing), ["20 mm"]);
        for wrong in [0.0, f64::NAN, f64::INFINITY, -1.0] {
            let mut drawing = Drawing::new(Size::clamped(400, 300));
            scale_bar(&mut drawing, wrong, "mm");
            assert!(drawing.items.is_empty(), "{wrong}");
        }
    }

    #[test]
    fn a_key_counts_what_it_has_no_room_for() {
        let entries: Vec<(String, Rgb)> = (0..500).map(|k| (format!("scan {k}"), [0; 3])).collect();
        let mut drawing = Drawing::new(Size::clamped(400, 300));
        key(&mut drawing, &entries);
        let told = texts(&drawing);
        assert!(told.len() < 20 && told[0] == "scan 0", "{told:?}");
        assert_eq!(told.last().copied(), Some(format!("and {} more", 500 - (told.len() - 1)).as_str()));
    }

    #[test]
    fn a_key_stays_within_the_room_that_is_left_for_it() {
        let entries = |name: &str| vec![(name.to_owned(), [0; 3])];
        let size = Size::clamped(400, 300);
        assert_eq!(key_width(size, &[]), 0.0);
        for name in ["a.ply", "scan_00.ply", "a scan with a name that is longer than anything.ply"] {
            let mut drawing = Drawing::new(size);
            key(&mut drawing, &entries(name));
            let Some(Item::Text { at, text, font, .. }) = drawing.items.last() else { panic!("no word") };
            let (right, room) = (at[0] + font.width(text), key_width(size, &entries(name)));
            assert!(right <= room && room <= 0.3 * 400.0, "{name}: {right} of {room}");
        }
    }

    #[test]
    fn words_of_neighbours_do_not_lie_on_each_other() {
        let mut drawing = Drawing::new(Size::clamped(400, 300));
        let mark = |x: f64| Mark { at: [200.0 + x, 150.0], label: "a place".to_owned(), color: INK, is_hidden: false };
        marks(&mut drawing, &[mark(0.0), mark(20.0), mark(40.0)]);
        let places: Vec<[f64; 2]> = drawing
            .items
            .iter()
            .filter_map(|item| if let Item::Text { at, color: INK, .. } = item { Some(*at) } else { None })
            .collect();
        let size = [Font::SMALL.width("a place"), 0.8 * Font::SMALL.height()];
        assert_eq!(places.len(), 3);
        for (index, one) in places.iter().enumerate() {
            assert!(
                places[..index].iter().all(|other| !overlap(&around(*one, size), &around(*other, size))),
                "{places:?}"
            );
        }
    }

    #[test]
    fn words_at_a_rim_stay_in_the_picture() {
        let mut drawing = Drawing::new(Size::clamped(400, 300));
        let mark = Mark { at: [395.0, 298.0], label: "a place".to_owned(), color: INK, is_hidden: false };
        marks(&mut drawing, &[mark]);
        let Some(crate::drawing::Item::Text { at, .. }) = drawing.items.last() else { panic!("no word") };
        let [_, _, right, bottom] = around(*at, [Font::SMALL.width("a place"), 0.8 * Font::SMALL.height()]);
        assert!(right <= 400.0 && bottom <= 300.0, "{at:?}");
    }

    #[test]
    fn a_colour_bar_names_its_ends() {
        let mut drawing = Drawing::new(Size::clamped(400, 300));
        color_bar(&mut drawing, Map::Diverging, [-0.5, 0.5], "mm");
        assert_eq!(texts(&drawing), ["-0.5", "0", "0.5", "mm"]);
    }
}
