//! Lists of cells, and the triangles that they make.

use super::arrays::{Cursor, Scalar, text_words};
use crate::budget::Budget;
use crate::points::NONE;
use crate::{FormatError, ReadLimits, quote};

/// Cells one after the other, by the indices of their points.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// Where each cell ends among the points.
    ends: Vec<u32>,
    /// Indices as they stand; [`NONE`] for those that can't be.
    points: Vec<u32>,
}

impl Cells {
    /// Reads a list that is declared by two numbers: cells and numbers in all, or, from version 5 on, those of two arrays.
    pub(super) fn read(
        cursor: &mut Cursor,
        (first, second): (u64, u64),
        budget: &mut Budget,
    ) -> Result<Cells, FormatError> {
        let next = cursor.peek().map(text_words).unwrap_or_default();
        if next.first().is_some_and(|word| word.eq_ignore_ascii_case("OFFSETS")) {
            return Cells::arrays(cursor, (first, second), budget);
        }
        cursor.check(second, Scalar::I32)?;
        if first > second {
            return Err(cursor.wrong(format!("{second} numbers don't make {first} cells")));
        }
        budget.take(second, size_of::<u32>())?;
        let mut cells = Cells::default();
        let mut left = 0;
        cursor.numbers(second, Scalar::I32, |value| {
            if left == 0 {
                left = index(value);
            } else {
                cells.points.push(index(value));
                left -= 1;
                if left > 0 {
                    return;
                }
            }
            if left == 0 {
                cells.ends.push(cells.points.len() as u32);
            }
        })?;
        if left > 0 || cells.ends.len() as u64 != first {
            return Err(cursor.wrong(format!("{second} numbers don't make {first} cells")));
        }
        Ok(cells)
    }

    /// Version 5: where each cell begins, and then the points of all.
    fn arrays(cursor: &mut Cursor, counts: (u64, u64), budget: &mut Budget) -> Result<Cells, FormatError> {
        let mut array = |keyword: &str, count: u64| {
            let line = cursor.line().unwrap_or_default();
            let words = text_words(line);
            let scalar = words.get(1).and_then(|name| Scalar::of(name));
            let scalar = scalar.filter(|_| words.first().is_some_and(|word| word.eq_ignore_ascii_case(keyword)));
            let scalar =
                scalar.ok_or_else(|| cursor.wrong(format!("{keyword} is expected, but here is {}", quote(line))))?;
            cursor.check(count, scalar)?;
            budget.take(count, size_of::<u32>())?;
            let mut values = Vec::with_capacity(count as usize);
            cursor.numbers(count, scalar, |value| values.push(index(value)))?;
            Ok(values)
        };
        let (offsets, points) = (array("OFFSETS", counts.0)?, array("CONNECTIVITY", counts.1)?);
        let fits = offsets.windows(2).all(|pair| pair[0] <= pair[1]);
        let ends = match offsets.split_first() {
            Some((0, ends)) if fits && ends.last().is_none_or(|end| *end as usize == points.len()) => ends.to_vec(),
            None => Vec::new(),
            _ => return Err(cursor.wrong("the offsets of the cells don't go up from 0 to the number of their points")),
        };
        Ok(Cells { ends, points })
    }

    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let mut start = 0;
        self.ends.iter().map(move |end| {
            let cell = self.points.get(start..*end as usize).unwrap_or_default();
            start = *end as usize;
            cell
        })
    }
}

/// An index as it is kept: [`NONE`] for what is none.
fn index(value: f64) -> u32 {
    if value >= 0.0 && value < f64::from(NONE) && value.fract() == 0.0 { value as u32 } else { NONE }
}

/// How the points of a cell make triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Fan,
    Strip,
    /// Two rows of two points.
    Pixel,
    /// A point or a line: no surface.
    None,
    /// A body: not read.
    Body,
}

impl Shape {
    /// By the number that VTK gives it.
    pub(super) fn of(cell_type: f64) -> Self {
        match cell_type as i64 {
            0..=4 => Shape::None,
            5 | 7 | 9 => Shape::Fan,
            6 => Shape::Strip,
            8 => Shape::Pixel,
            _ => Shape::Body,
        }
    }
}

/// The triangles so far.
pub(super) struct Triangles<'a> {
    pub(super) faces: Vec<[u32; 3]>,
    /// Those that name a point which isn't there.
    pub(super) dropped: u64,
    /// Cells that are bodies.
    pub(super) bodies: u64,
    points: u32,
    limits: &'a ReadLimits,
}

impl<'a> Triangles<'a> {
    pub(super) fn new(points: usize, limits: &'a ReadLimits) -> Self {
        Triangles { faces: Vec::new(), dropped: 0, bodies: 0, points: points as u32, limits }
    }

    pub(super) fn take(
        &mut self,
        cells: &Cells,
        shape: impl Fn(usize) -> Shape,
        budget: &mut Budget,
    ) -> Result<(), FormatError> {
        for (index, cell) in cells.iter().enumerate() {
            match (shape(index), cell) {
                (Shape::Fan, [first, rest @ ..]) => {
                    for pair in rest.windows(2) {
                        self.push([*first, pair[0], pair[1]], budget)?;
                    }
                }
                (Shape::Strip, strip) => {
                    for (turn, corners) in strip.windows(3).enumerate() {
                        let (a, b, c) = (corners[0], corners[1], corners[2]);
                        // triangles with a vertex twice join strips and are nothing
                        if a != b && b != c && c != a {
                            self.push(if turn % 2 == 0 { [a, b, c] } else { [b, a, c] }, budget)?;
                        }
                    }
                }
                (Shape::Pixel, [a, b, c, d]) => {
                    self.push([*a, *b, *d], budget)?;
                    self.push([*a, *d, *c], budget)?;
                }
                (Shape::Body, _) => self.bodies += 1,
                _ => {}
            }
        }
        Ok(())
    }

    fn push(&mut self, face: [u32; 3], budget: &mut Budget) -> Result<(), FormatError> {
        if face.iter().any(|vertex| *vertex >= self.points) {
            self.dropped += 1;
            return Ok(());
        }
        let limit = self.limits.max_faces;
        if self.faces.len() as u64 >= limit {
            return Err(FormatError::TooLarge { what: "faces", found: limit + 1, limit });
        }
        budget.take(1, size_of::<[u32; 3]>())?;
        self.faces.push(face);
        Ok(())
    }
}
