//! Lines, shapes and text at places in pixels: drawn onto a picture, or written as SVG.

mod font;
mod pixels;
mod svg;

pub use font::Font;

use crate::image::{Image, Rgb};
use crate::size::Size;

/// Where a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Behind it.
    Start,
    /// About it.
    Middle,
    /// Before it.
    End,
}

/// One thing that is drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A line from place to place.
    Line {
        /// The places.
        points: Vec<[f64; 2]>,
        /// How wide.
        width: f64,
        /// Its colour.
        color: Rgb,
        /// Whether it is dashed.
        dashed: bool,
    },
    /// A rectangle that is filled.
    Rect {
        /// Its left upper corner.
        at: [f64; 2],
        /// Width and height.
        size: [f64; 2],
        /// Its colour.
        color: Rgb,
    },
    /// A disc.
    Disc {
        /// Its middle.
        at: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Its colour.
        color: Rgb,
        /// The colour of a rim about it.
        rim: Rgb,
    },
    /// A text in one line; its place is the middle of its height.
    Text {
        /// Its place.
        at: [f64; 2],
        /// What it says.
        text: String,
        /// Where it stands there.
        anchor: Anchor,
        /// How large.
        font: Font,
        /// Its colour.
        color: Rgb,
    },
}

/// Things in the order in which they are drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// How large the whole is.
    pub size: Size,
    /// The things.
    pub items: Vec<Item>,
}

impl Drawing {
    /// An empty one.
    pub fn new(size: Size) -> Drawing {
        Drawing { size, items: Vec::new() }
    }

    /// A line between two places.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: Rgb) {
        self.items.push(Item::Line { points: vec![from, to], width, color, dashed: false });
    }

    /// A filled rectangle.
    pub fn rect(&mut self, at: [f64; 2], size: [f64; 2], color: Rgb) {
        self.items.push(Item::Rect { at, size, color });
    }

    /// The rim of a rectangle.
    pub fn frame(&mut self, at: [f64; 2], size: [f64; 2], width: f64, color: Rgb) {
        let ([x, y], [w, h]) = (at, size);
        let points = vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]];
        self.items.push(Item::Line { points, width, color, dashed: false });
    }

    /// A text.
    pub fn text(&mut self, at: [f64; 2], text: impl Into<String>, anchor: Anchor, font: Font, color: Rgb) {
        self.items.push(Item::Text { at, text: text.into(), anchor, font, color });
    }

    /// Draws all onto a picture.
    pub fn paint(&self, image: &mut Image) {
        self.items.iter().for_each(|item| pixels::paint(item, image));
    }

    /// As a picture of its own.
    pub fn to_image(&self) -> Image {
        let mut image = Image::new(self.size, crate::color::GROUND);
        self.paint(&mut image);
        image
    }

    /// As SVG.
    pub fn to_svg(&self) -> String {
        svg::written(self)
    }
}

/// A text that has at most so many letters: the middle of a longer one is left out.
pub fn shortened(text: &str, most: usize) -> String {
    let letters: Vec<char> = text.chars().collect();
    if letters.len() <= most || most < 3 {
        return letters.into_iter().take(most).collect();
    }
    let tail = (most - 2) / 2;
    let head = most - 2 - tail;
    letters[..head].iter().chain(&['.', '.']).chain(&letters[letters.len() - tail..]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{ALARM, GROUND, INK};

    fn drawing() -> Drawing {
        let mut drawing = Drawing::new(Size::clamped(100, 60));
        drawing.rect([10.0, 10.0], [20.0, 10.0], ALARM);
        drawing.line([0.0, 50.0], [100.0, 50.0], 2.0, INK);
        drawing.text([50.0, 30.0], "<b>&\"\u{1}", Anchor::Middle, Font::SMALL, INK);
        drawing.items.push(Item::Disc { at: [80.0, 20.0], radius: 6.0, color: ALARM, rim: INK });
        drawing
    }

    #[test]
    fn shapes_are_where_they_were_put() {
        let image = drawing().to_image();
        assert_eq!(image.at(15, 15), Some(ALARM));
        assert_eq!(image.at(31, 15), Some(GROUND));
        assert_eq!(image.at(50, 50), Some(INK));
        assert_eq!(image.at(80, 20), Some(ALARM));
        assert_eq!(image.at(80, 30), Some(GROUND));
        let letters = (20..40).flat_map(|y| (20..80).map(move |x| (x, y)));
        assert!(letters.filter(|(x, y)| image.at(*x, *y) != Some(GROUND)).count() > 40);
    }

    #[test]
    fn what_is_off_the_picture_or_no_place_is_left_out() {
        let mut drawing = Drawing::new(Size::clamped(40, 40));
        let far = [f64::NAN, f64::INFINITY, -1e300, 1e9];
        for x in far {
            drawing.line([x, 5.0], [20.0, x], 3.0, INK);
            drawing.line([0.0, -9.0], [9.0, -9.0], x, INK);
            drawing.rect([x, x], [1e300, 5.0], INK);
            drawing.items.push(Item::Disc { at: [x, 9.0], radius: 1e300, color: INK, rim: INK });
            drawing.text([x, 3.0], "far", Anchor::End, Font::SMALL, INK);
        }
        assert_eq!(drawing.to_image().size(), drawing.size);
        assert!(!drawing.to_svg().contains("NaN") && !drawing.to_svg().contains("inf"));
    }

    #[test]
    fn svg_holds_text_as_text() {
        let svg = drawing().to_svg();
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{svg}");
        assert!(svg.contains("&lt;b&gt;&amp;&quot;") && !svg.contains("<b>") && !svg.contains('\u{1}'), "{svg}");
    }

    #[test]
    fn long_names_lose_their_middle() {
        assert_eq!(shortened("scan_0001.ply", 20), "scan_0001.ply");
        assert_eq!(shortened("scan_0001.ply", 9), "scan..ply");
        assert_eq!(shortened("äöüäöüäöü", 5), "äö..ü");
        assert_eq!(shortened("abc", 2), "ab");
    }
}
